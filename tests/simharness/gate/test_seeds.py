"""Minimum number of seeds of a suite."""

from itertools import product

import pytest

from simharness.gate.baseline import KEPT, Measurement, write_baseline
from simharness.gate.compare import compare
from simharness.gate.score_tests import least_corrected_p, least_seeds
from simharness.gate.suite import baseline_of, fingerprint
from simharness.gate.trial_command import TrialKey, setting_name
from simharness.scenario.load import load_study
from simharness.scenario.sections.gate_section import GateSection


@pytest.mark.parametrize("cases", [1, 3])
@pytest.mark.parametrize("seeds", [2, 5, 7, 12, 13, 20])
def test_no_comparison_has_a_smaller_p_value_than_the_least(seeds, cases):
    def measured(change):
        scores = {
            TrialKey(f"case{case}", seed, "full"): dict.fromkeys(KEPT, 50.0)
            | ({"pcp": 50.0 + change * seed} if not case else {})
            for case in range(cases)
            for seed in range(1, seeds + 1)
        }
        return Measurement("few", "0123456789", "1", "zen", scores)

    changes = compare(measured(0.0), measured(-9.0), GateSection()).changes
    p = min(change.p for change in changes if change.score == "pcp")
    least = least_corrected_p(seeds, cases=cases)
    assert least <= p <= 4 * least
    assert p == pytest.approx(least) or seeds > 12


@pytest.mark.parametrize("cases", [1, 3])
@pytest.mark.parametrize("level", [0.5, 0.05, 0.01, 1e-3])
def test_the_least_seeds_are_enough_and_one_fewer_are_not(level, cases):
    seeds = least_seeds(level, cases=cases)
    assert least_corrected_p(seeds, cases=cases) <= level < least_corrected_p(seeds - 1, cases=cases)


def test_some_levels_are_too_low_for_any_number_of_seeds():
    assert least_seeds(1e-6, cases=1) is None


@pytest.fixture
def read(tmp_path):
    """Write and read the baseline of a suite with a number of seeds and a level."""

    def baseline(seeds, level=0.05):
        path = tmp_path / "few.toml"
        path.write_text(f'name = "few"\nseeds = {seeds}\n[gate]\nlevel = {level}\n')
        study = load_study(path)
        trials = [
            TrialKey(setting_name(setting, study), seed, name)
            for setting, seed in product(study.settings, study.seeds)
            for name in KEPT
        ]
        scores = {trial: dict.fromkeys(KEPT, 1.0) for trial in trials}
        write_baseline(Measurement("few", fingerprint(study), "1", "zen", scores), tmp_path / "few.json")
        return baseline_of(study, tmp_path / "few.json")

    return baseline


def test_a_suite_that_cannot_find_a_regression_is_refused(read):
    with pytest.raises(ValueError, match=r"few\.toml: no regression can be found: 4 seeds .* at least 6 seeds"):
        read(4)
    with pytest.raises(ValueError, match=r"1 seed that .* at least 6 seeds, or a higher level"):
        read(1)
    with pytest.raises(ValueError, match=r"gate\.level is 1e-06; give it a higher level"):
        read(20, level=1e-6)


def test_a_suite_with_enough_seeds_is_accepted(read):
    assert len(read(6).scores) == len(read(6, level=0.04).scores)
    assert read(2, level=0.5).suite == "few"
