"""Reports of a gate check: terminal, JUnit, Markdown."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from simharness.cli.check_command import _print
from simharness.gate.baseline import FRAMES, GATED, TIME, Measurement
from simharness.gate.compare import FailedCase, GateResult, compare
from simharness.gate.gate_reports import SPEED, WHOLE, difference, junit, markdown
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection
from simharness.scoring.catalogue import SCORES

COMMAND = "simharness run a.toml --set 'cases={}' --seed 3"


def made(change=lambda trial: {}, *, failed=(), cases=("base", "a<b|c", "crowd"), seeds=12):
    """Return the result of a check of three cases whose scores changed by ``change``."""
    usual = {
        "pcp": 90.0,
        "recall": 95.0,
        "precision": 96.0,
        "mpjpe_mm": 40.0,
        "match_f1": 97.0,
        "ghosts": 0.3,
        "missed": 0.1,
        "map": 80.0,
        "coverage_90": 86.0,
        "score_brier": 0.1,
        "hota": 82.0,
        "idf1": 88.0,
        FRAMES: 10.0,
        TIME: 1.0,
    }
    trials = [TrialKey(case, seed, variant) for case in cases for seed in range(seeds) for variant in ("full", "fast")]
    before = Measurement("ci", "0" * 10, "1", "zen", {trial: dict(usual) for trial in trials})
    after = {trial: {key: value + change(trial).get(key, 0) for key, value in usual.items()} for trial in trials}
    comparison = compare(before, Measurement("ci", "0" * 10, "1", "zen", after), GateSection())
    return GateResult("ci", ("full", "fast"), GateSection(), comparison, tuple(failed), 36, trials[0], COMMAND, 61.25)


def crowded(trial):
    return {"pcp": -7.0, "ghosts": 0.2} if trial[::2] == ("crowd", "full") else {}


def worse_parts(trial):
    return {"pcp": -7.0} if trial[::2] == ("crowd", "full") else {}


def slower(trial):
    return {TIME: 1.0} if trial.variant == "fast" else {}


def better(trial):
    return {"mpjpe_mm": -0.8}


def much_better(trial):
    return {"mpjpe_mm": -5.0}


def cases_of(check):
    root = ElementTree.fromstring(junit(check))
    assert root.tag == "testsuites"
    (suite,) = root
    return suite, {case.get("name"): case for case in suite}


def test_a_difference_that_rounds_to_zero_has_no_sign():
    """The differences of MPJPE have both signs and are smaller than the last printed digit."""
    jitter = {seed: 0.003 * (-1) ** seed - 0.001 for seed in range(12)}
    check = made(lambda trial: {"mpjpe_mm": jitter[trial.seed]})
    (change,) = (each for each in check.comparison.changes_of("full") if each.score == "mpjpe_mm")
    assert change.low < change.difference < 0 < change.high
    assert difference(change) == "0.0 (0.0 to 0.0)"


class TestTerminal:
    @pytest.mark.parametrize("more", [{}, {"mpjpe_mm": 412.34, TIME: 123.4}, {"pcp": -89.0, "ghosts": 12.3}])
    def test_tables_are_complete_at_80_columns(self, more, monkeypatch, capsys):
        """Large changes with wide intervals, in a terminal of 80 columns."""
        check = made(lambda trial: {key: value * (1 + 0.3 * (trial.seed % 3)) for key, value in more.items()})
        monkeypatch.setenv("COLUMNS", "80")
        _print(check)
        _, *tables, _ = capsys.readouterr().out.split("\n\n")  # verdict and changes, a table for each variant, command
        assert len(tables) == 2
        tables = "\n".join(tables).splitlines()
        assert "…" not in "".join(tables)
        assert max(map(len, tables)) <= 80
        for key in GATED:
            assert sum(SCORES[key].title in line for line in tables) == 2
        for change in check.comparison.changes_of("full"):
            for cell in difference(change).split(" (", 1):
                assert any(cell in line for line in tables)
        if more:
            assert sum("worse" in line for line in tables) >= 2


class TestJUnit:
    def test_a_case_for_each_case_and_none_fails(self):
        suite, cases = cases_of(made())
        assert list(cases) == [WHOLE, "a<b|c", "base", "crowd", SPEED]
        assert [suite.get(key) for key in ("name", "tests", "failures", "errors", "time")] == [
            *("ci", "5", "0", "0", "61.2")
        ]
        assert not [child for case in cases.values() for child in case]

    def test_a_regression_fails_its_case(self):
        check = made(crowded)
        suite, cases = cases_of(check)
        assert (suite.get("failures"), suite.get("errors")) == ("2", "0")  # the whole suite lost 2.3 points, too
        assert [name for name, case in cases.items() if len(case)] == [WHOLE, "crowd"]
        failure = cases["crowd"].find("failure")
        assert "PCP" in failure.text
        assert "Ghosts" in failure.text
        assert len(failure.text.splitlines()) == 2
        assert all(line.startswith("worse: full, crowd: ") for line in failure.text.splitlines())
        assert "90.0 before, 83.0 now: -7.0" in failure.text

    def test_time_fails_its_own_case(self):
        _, cases = cases_of(made(slower))
        assert [name for name, case in cases.items() if len(case)] == [SPEED]
        assert "×2.00" in cases[SPEED].find("failure").get("message")

    def test_a_failed_trial_is_an_error(self):
        failed = [FailedCase("crowd", 3, "no \x00 room & <more>\nin two lines")]
        suite, cases = cases_of(made(failed=failed))
        assert suite.get("errors") == "1"
        assert "no ? room & <more>" in cases["crowd"].find("error").text

    def test_a_suite_without_cases_is_one_case(self):
        _, cases = cases_of(made(lambda trial: {"pcp": -5}, cases=("only",), failed=[FailedCase("only", 1, "no")]))
        assert list(cases) == [WHOLE, SPEED]
        assert cases[WHOLE].find("error") is not None

    def test_an_undecided_loss_fails_nothing_and_is_printed(self):
        suite, cases = cases_of(made(worse_parts, seeds=5))
        assert (suite.get("failures"), suite.get("errors")) == ("0", "0")
        assert [name for name, case in cases.items() if len(case)] == [WHOLE, "crowd"]
        text = cases["crowd"].find("system-out").text
        assert "too few seeds" in text
        assert "PCP" in text

    def test_a_gain_within_its_bound_fails_nothing(self):
        suite, _ = cases_of(made(better))
        assert suite.get("failures") == "0"

    def test_an_unexpected_improvement_is_a_failure_until_it_is_accepted(self):
        suite, cases = cases_of(made(much_better))
        assert suite.get("failures") == "4"
        text = cases["crowd"].find("failure").text
        assert text.startswith("unexpected improvement: ")
        assert "--accept-better" in text
        suite, _ = cases_of(replace(made(much_better), accept_better=True))
        assert suite.get("failures") == "0"


class TestMarkdown:
    def test_tables_are_complete(self):
        text = markdown(made(crowded))
        rows = [line for line in text.splitlines() if line.startswith("|")]
        assert len(rows) == 2 * (2 + len(GATED) + 1)
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {7}
        for key in GATED:
            assert sum(row.startswith(f"| {SCORES[key].title}") for row in rows) == 2

    def test_the_order_is_verdict_losses_gains(self):
        text = markdown(made(lambda trial: crowded(trial) | better(trial)))
        assert text.startswith("## ci: 4 regressions\n")
        places = [text.index(each) for each in ("### Worse", "### Better\n", "### full", "### fast", COMMAND)]
        assert places == sorted(places)
        text = markdown(made(lambda trial: crowded(trial) | much_better(trial)))
        assert text.startswith("## ci: 4 regressions, 8 unexpected improvements\n")
        places = [
            text.index(each) for each in ("### Worse", "### Better than its bound\n", "--accept-better", "### full")
        ]
        assert places == sorted(places)
        assert markdown(made()).startswith("## ci: no regression\n")

    def test_undecided_losses_are_listed(self):
        assert "### Worse, but too few seeds to judge\n\n- full, " in markdown(made(worse_parts, seeds=5))
        assert "too few" not in markdown(made(crowded)) + markdown(made(seeds=5))

    def test_the_command_can_be_copied(self):
        assert f"\n```sh\n{COMMAND}\n```\n" in markdown(made())

    def test_special_characters_in_names_are_escaped(self):
        text = markdown(made(lambda trial: {"pcp": -5} if trial.case == "a<b|c" else {}))
        assert "a&lt;b\\|c" in text
        assert "a<b|c" not in text

    def test_a_hundred_regressions_are_not_all_listed(self):
        everything = {key: -30 if SCORES[key].better == "higher" else 30 for key in GATED}
        text = markdown(made(lambda trial: everything, seeds=14))  # so many tests need more seeds
        assert text.startswith(f"## ci: {2 * 4 * len(GATED)} regressions")
        assert f"- and {2 * 4 * len(GATED) - 20} more" in text


@pytest.mark.parametrize(
    ("changes", "passed", "verdict"),
    [
        ({}, True, "no regression"),
        ({"change": better}, True, "no regression"),
        ({"change": much_better}, False, "8 unexpected improvements"),
        ({"change": much_better, "accept_better": True}, True, "no regression, 8 unexpected improvements accepted"),
        ({"change": slower}, False, "4 regressions"),  # over the whole suite, and in each case
        (
            {"change": worse_parts, "seeds": 5},
            True,
            "no regression, but 2 losses beyond tolerance that 5 seeds are too few to judge",
        ),
        ({"failed": [FailedCase("base", 0, "no")]}, False, "1 of 36 trials could not be run"),
        (
            {"change": slower, "failed": [FailedCase("base", 0, "no")]},
            False,
            "4 regressions, 1 of 36 trials could not be run",
        ),
    ],
)
def test_the_verdict(changes, passed, verdict):
    options = dict(changes)
    accept_better = options.pop("accept_better", False)
    check = replace(made(**options), accept_better=accept_better)
    assert (check.passed, check.verdict) == (passed, verdict)


def test_the_worst_trial_is_described():
    assert made().worst_description == "the trial that has the lowest PCP: base, seed 0, full"
    assert made(crowded).worst_description.startswith("the trial that lost most")
    assert replace(made(), failed=(FailedCase("base", 0, "no"),)).worst_description.startswith(
        "the trial that could not be run"
    )
