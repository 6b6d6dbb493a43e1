"""``simharness check`` finds planted bugs and nothing else."""

import json
import shlex
import time
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from suites import SMALL, remember_scenes
from typer.testing import CliRunner

import mvpose.matching
import mvpose.pipeline
from mvpose.affinity import GeometricAffinity
from mvpose.commands.errors import RunError
from mvpose.reconstruction.likelihood import Noise
from simharness.cli import app
from simharness.gate import suite
from simharness.gate.baseline import GATED
from simharness.scenario.load import load

OF_IDENTITIES = 2  # of the gated scores: they do not apply to methods without memory


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Call ``simharness check small.toml --baseline small.json ...``."""
    monkeypatch.chdir(tmp_path)
    remember_scenes(monkeypatch)
    (tmp_path / "small.toml").write_text(SMALL)

    def call(*arguments, file="small.toml", baseline="small.json"):
        return CliRunner(env={"COLUMNS": "120"}).invoke(
            app, ["check", file, "--baseline", baseline, *arguments], catch_exceptions=False
        )

    return call


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The text of the baseline of the small suite."""
    folder = tmp_path_factory.mktemp("measured")
    (folder / "small.toml").write_text(SMALL)
    with pytest.MonkeyPatch.context() as monkeypatch:
        remember_scenes(monkeypatch)
        command = ["check", str(folder / "small.toml"), "--baseline", str(folder / "small.json"), "--update-baseline"]
        result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert result.exit_code == 0
    assert "24 results of the suite small" in result.stdout
    return (folder / "small.json").read_text()


@pytest.fixture
def baseline(tmp_path, measured):
    path = tmp_path / "small.json"
    path.write_text(measured)
    return path


def no_cycle_constraint(monkeypatch):
    """Cluster by connected components, with any number of detections of a view."""

    def cluster(affinity, view, *, alpha):
        return connected_components(affinity > alpha)[1].astype(np.int64)

    monkeypatch.setattr(mvpose.matching, "cluster", cluster)


def swapped_wrists(monkeypatch):
    whole = mvpose.pipeline._estimate

    def estimate(poses, *rest):
        poses.joints[:, [9, 10]] = poses.joints[:, [10, 9]]
        return whole(poses, *rest)

    monkeypatch.setattr(mvpose.pipeline, "_estimate", estimate)


def wrong_sigma(monkeypatch):
    """Assume keypoints five times as exact as they are."""
    sigmas = Noise.sigmas
    monkeypatch.setattr(Noise, "sigmas", lambda self, skeleton: 0.2 * sigmas(self, skeleton))


def wrong_scale(monkeypatch):
    """Accept rays at three times the distance."""
    compare = GeometricAffinity.__call__

    def scaled(self, *seen):
        distances = {key: 3 * getattr(self, key) for key in ("midpoint", "slope", "threshold")}
        return compare(GeometricAffinity(**distances), *seen)

    monkeypatch.setattr(GeometricAffinity, "__call__", scaled)


def ten_times_as_slow(monkeypatch):
    whole = mvpose.pipeline._estimate

    def estimate(poses, matching, start, *rest):
        until = time.thread_time() + 9 * (time.perf_counter() - start)
        while time.thread_time() < until:
            pass
        return whole(poses, matching, start, *rest)

    monkeypatch.setattr(mvpose.pipeline, "_estimate", estimate)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bug", "score"),
    [
        (no_cycle_constraint, "Match F1"),
        (swapped_wrists, "PCP"),
        (wrong_sigma, "MPJPE"),
        (wrong_scale, "Precision"),
        (ten_times_as_slow, "Time"),
    ],
)
def test_a_planted_bug_is_found(check, baseline, measured, monkeypatch, bug, score):
    bug(monkeypatch)
    result = check("--junit", "out.xml", "--summary", "out.md")
    assert result.exit_code == 1
    first = result.stdout.splitlines()
    assert first[0].startswith("small: ")
    assert "regression" in first[0]
    assert any(line.startswith("worse") and score in line for line in first)
    report = ElementTree.parse("out.xml").getroot()
    assert int(report[0].get("failures")) >= 1
    text = Path("out.md").read_text(encoding="utf-8")
    assert text.startswith("## small: ")
    assert "**worse**" in text
    assert baseline.read_text() == measured  # the check does not change the baseline


@pytest.mark.slow
def test_the_unchanged_method_passes_ten_times(check, baseline):
    for _ in range(10):
        result = check()
        assert result.exit_code == 0, result.stdout
        assert result.stdout.startswith("small: no regression, 24 trials")
        assert result.stdout.count("none") == len(GATED) - OF_IDENTITIES  # no score changed at all


@pytest.mark.slow
def test_an_unexpected_improvement_fails_until_it_is_accepted(check, baseline, monkeypatch):
    with monkeypatch.context() as planted:
        swapped_wrists(planted)
        assert check("--update-baseline", baseline="worse.json").exit_code == 0
    result = check("--summary", "out.md", baseline="worse.json")
    assert result.exit_code == 1
    assert "unexpected improvements" in result.stdout.splitlines()[0]
    assert "unexpected fast, whole suite: PCP" in result.stdout
    assert "accept them with --accept-better" in result.stdout
    assert "### Better than its bound" in Path("out.md").read_text(encoding="utf-8")
    accepted = check("--accept-better", baseline="worse.json")
    assert accepted.exit_code == 0
    assert "no regression" in accepted.stdout.splitlines()[0]
    assert accepted.stdout.splitlines()[0].count("accepted") == 1


@pytest.mark.slow
def test_the_printed_command_runs_the_worst_trial(check, baseline, tmp_path):
    result = check()
    *_, description, command = result.stdout.splitlines()
    case, seed = description.removeprefix("the trial that has the lowest PCP: ").split(", ")[:2]
    worst = min((row["pcp"], row["case"], row["seed"]) for row in json.loads(baseline.read_text())["trials"])
    assert (case, seed) == (worst[1], f"seed {worst[2]}")
    program, *words = shlex.split(command)
    assert program == "simharness"
    scenario = load(words[1], overrides=words[3:-2:2], seed=int(words[-1]))
    assert scenario.people.count == {"phantoms": 3, "crowd": 5}[case]
    ran = CliRunner().invoke(app, [*words, "--out", "runs"], catch_exceptions=False)
    assert ran.exit_code == 0
    (summary,) = tmp_path.glob("runs/*/summary.json")
    assert json.loads(summary.read_text())["variants"]["fast"]["pcp"] == pytest.approx(worst[0], abs=1e-3)


@pytest.mark.slow
def test_two_workers_give_the_result_of_one(check, tmp_path):
    two = SMALL.replace("seeds = 12", "seeds = 3").replace("duration = 0.8", "duration = 0.4")
    (tmp_path / "two.toml").write_text(two.replace("[gate]\n", "[gate]\nlevel = 0.5\n"))
    updated = check("--update-baseline", file="two.toml", baseline="new/two.json")
    assert updated.exit_code == 0
    assert "Changes that 3 seeds show" in updated.stdout
    result = check("--workers", "2", file="two.toml", baseline="new/two.json")
    assert result.exit_code == 0
    assert result.stdout.count("none") == len(GATED) - OF_IDENTITIES


def test_help_lists_the_options():
    result = CliRunner(env={"COLUMNS": "120"}).invoke(app, ["check", "--help"])
    assert result.exit_code == 0
    for option in (
        "--baseline",
        "--junit",
        "--summary",
        "--update-baseline",
        "--accept-better",
        "--workers",
        "section [gate]",
    ):
        assert option in result.stdout


def refused(result, *messages):
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert "Traceback" not in result.stderr
    for text in messages:
        assert text in result.stderr


class TestBadInput:
    """Errors that are found before anything is run."""

    @pytest.fixture(autouse=True)
    def nothing_is_run(self, monkeypatch):
        def run(*_, **__):
            raise AssertionError("ran")

        monkeypatch.setattr("simharness.gate.suite.run_suite", run)
        monkeypatch.setattr("simharness.gate.suite.run_suite", run)

    @pytest.fixture
    def written(self, tmp_path):
        """Write a baseline with made-up scores, without running the suite."""
        from simharness.gate.baseline import KEPT, Measurement, write_baseline
        from simharness.gate.suite import fingerprint
        from simharness.gate.trial_command import TrialKey, setting_name
        from simharness.scenario.load import load_study

        (tmp_path / "small.toml").write_text(SMALL)
        study = load_study(tmp_path / "small.toml")
        scores = {
            TrialKey(setting_name(setting, study), seed, "fast"): dict.fromkeys(KEPT, 1.0)
            for setting, seed in product(study.settings, study.seeds)
        }
        write_baseline(Measurement("small", fingerprint(study), "1", "zen", scores), tmp_path / "small.json")
        return tmp_path / "small.json"

    def test_no_baseline(self, check):
        refused(check(), "small.json: no such file", "--update-baseline")

    def test_a_baseline_that_was_cut_off(self, check, written):
        written.write_text(written.read_text()[:200])
        refused(check(), "small.json, line", "not valid JSON", "--update-baseline")

    def test_a_baseline_of_another_suite(self, check, written, tmp_path):
        other = SMALL.replace('"small"', '"other"').replace("[cases.crowd]", "[cases.masses]")
        (tmp_path / "other.toml").write_text(other)
        refused(
            check(file="other.toml"),
            "the baseline of suite small",
            "other.toml is suite other",
            "12 trials are only in the baseline, the first crowd, seed 0, fast and 12 trials are not in it",
            "--update-baseline",
        )

    def test_a_baseline_of_other_settings_under_the_same_names(self, check, written, tmp_path):
        (tmp_path / "small.toml").write_text(SMALL.replace("count = 5", "count = 4"))
        refused(check(), "the same names, but different settings")

    def test_a_suite_with_too_few_seeds(self, check, written, tmp_path):
        (tmp_path / "few.toml").write_text(SMALL.replace("seeds = 12", "seeds = 4"))
        messages = ("few.toml: no regression can be found: 4 seeds", "at least 7 seeds")
        refused(check(file="few.toml"), *messages)
        refused(check("--update-baseline", file="few.toml"), *messages)

    @pytest.mark.parametrize("option", ["--junit", "--summary"])
    def test_a_report_that_cannot_be_written(self, check, written, option):
        refused(check(option, "small.toml/out"), f"{option} small.toml/out: cannot be written")

    def test_a_baseline_that_cannot_be_written(self, check, written):
        refused(check("--update-baseline", baseline="small.toml/b.json"), "--baseline small.toml/b.json: cannot be")

    @pytest.mark.slow
    @pytest.mark.parametrize("option", ["--junit", "--summary"])
    def test_a_report_of_a_comparison_that_is_not_made(self, check, written, option):
        refused(check("--update-baseline", option, "out"), f"{option}: cannot be combined with --update-baseline")

    def test_improvements_of_a_comparison_that_is_not_made(self, check, written):
        refused(
            check("--update-baseline", "--accept-better"), "--accept-better: --update-baseline accepts every change"
        )

    def test_no_suite(self, check):
        refused(check(file="none.toml"), "none.toml: no such file")


class TestFailedTrials:
    @pytest.fixture(autouse=True)
    def a_fault(self, monkeypatch):
        run_trial = suite.run_trial

        def sometimes(scenario, **options):
            if scenario.seed == 3 and scenario.people.count == 5:
                raise RunError("the ceiling came down")
            return run_trial(scenario, **options)

        monkeypatch.setattr(suite, "run_trial", sometimes)

    @pytest.mark.slow
    def test_failed_trials_fail_the_check_and_are_listed(self, check, baseline):
        result = check("--junit", "out.xml")
        assert result.exit_code == 1
        assert "1 of 24 trials could not be run" in result.stdout
        assert "crowd, seed 3: the ceiling came down" in result.stdout
        assert result.stdout.splitlines()[-1].endswith("--set people.count=5 --seed 3")
        assert ElementTree.parse("out.xml").getroot()[0].get("errors") == "1"

    @pytest.mark.slow
    def test_no_baseline_is_written_if_a_trial_failed(self, check, tmp_path):
        result = check("--update-baseline")
        assert result.exit_code == 1
        assert "the ceiling came down" in result.stderr
        assert not (tmp_path / "small.json").exists()
