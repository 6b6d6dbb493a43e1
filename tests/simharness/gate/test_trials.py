"""Names and commands of the trials of a suite."""

import shlex
from itertools import product
from pathlib import Path

import pytest

from simharness.gate.trial_command import TrialKey, command_of, overrides, setting_name
from simharness.scenario.load import load, load_study

CI = Path(__file__).parents[3] / "scenarios" / "ci.toml"

SWEPT = """
name = "swept"
seeds = [3, 5]

[people]
count = 4

[sweep]
cameras.count = [3, 5]
detector.profile = ["poor", "typical"]
cameras.size = [[640, 480], [800, 600]]

[cases.usual]

[cases.dressed]
people.look_alike = 0.5
people.activities = ["walk", "talk"]
faults.dead = [1]
"""


@pytest.fixture(params=["ci", "swept"])
def study(request, tmp_path):
    if request.param == "ci":
        return load_study(CI)
    (tmp_path / "swept file.toml").write_text(SWEPT)
    return load_study(tmp_path / "swept file.toml")


def test_the_command_of_a_trial_runs_its_scenario(study):
    assert len(study.settings) > 10
    for setting, seed in product(study.settings, study.seeds):
        if seed != study.seeds[-1]:
            continue
        program, run, path, *words = shlex.split(
            command_of(study, TrialKey(setting_name(setting, study), seed, study.variants[0]))
        )
        assert (program, run, words[-2:]) == ("simharness", "run", ["--seed", str(seed)])
        assert set(words[:-2:2]) == {"--set"}
        assert load(path, overrides=words[1:-2:2], seed=seed) == study.at(setting, seed)


def test_a_file_of_one_scenario_needs_no_overrides(tmp_path):
    path = tmp_path / "one.toml"
    path.write_text('name = "one"\n')
    study = load_study(path)
    assert overrides(study, study.settings[0]) == []
    assert setting_name(study.settings[0], study) == "one"


def test_names_of_settings_differ(study):
    names = [setting_name(setting, study) for setting in study.settings]
    assert len(set(names)) == len(names)
    scenes = list(product(study.settings, study.seeds))
    assert len(scenes) == study.trials


def test_a_trial_of_another_study_has_no_command(study):
    for trial in (
        TrialKey("nobody", study.seeds[0], "full"),
        TrialKey(setting_name(study.settings[0], study), 99, "full"),
    ):
        with pytest.raises(ValueError, match="has no trial"):
            command_of(study, trial)
