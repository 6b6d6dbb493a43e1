"""Sizes of the pictures of a rig in a file: of the file, or of the scenario, never of neither."""

from dataclasses import replace

import pytest
from typer.testing import CliRunner

from mvpose.formats.calibration import opencv, pose2sim, voxelpose
from simharness.cli import app
from simharness.scenario.load import load
from simharness.trial.identity import trial_identity
from simharness.world.rigs.layouts import build_rig, preset_rig

RIG = preset_rig("shelf")  # 1032 x 776


def rig_of(path, *overrides):
    scenario = load("quickstart", overrides=['cameras.layout="file"', f'cameras.file="{path}"', *overrides])
    return build_rig(scenario.cameras)


@pytest.fixture
def files(tmp_path):
    voxelpose.write_calibration(tmp_path / "unsized.json", RIG)
    pose2sim.write_calibration(tmp_path / "sized.toml", RIG)
    return tmp_path


def test_a_size_that_nobody_states_is_refused(files):
    with pytest.raises(
        ValueError, match=r"unsized\.json: does not state the size .* cannot be 800 x 600.*; add cameras\.size"
    ):
        rig_of(files / "unsized.json")
    assert {camera.size for camera in rig_of(files / "unsized.json", "cameras.size=[1032,776]")} == {(1032, 776)}


def test_a_size_without_effect_is_refused(files):
    assert {camera.size for camera in rig_of(files / "sized.toml")} == {(1032, 776)}
    with pytest.raises(ValueError, match=r"cameras\.size = \[640, 480\] has no effect, because .* states 1032 x 776"):
        rig_of(files / "sized.toml", "cameras.size=[640,480]")
    rig_of(files / "sized.toml", "cameras.size=[1032,776]")


def test_a_folder_with_a_file_for_each_camera_is_a_rig_that_counts_by_its_content(files):
    (files / "rig").mkdir()
    for camera in RIG:
        opencv.write_values(files / "rig" / f"{camera.name}.yml", camera)
    scenario = load("quickstart", overrides=['cameras.layout="file"', f'cameras.file="{files / "rig"}"'])
    assert build_rig(scenario.cameras)[3].size == (1032, 776)
    before = trial_identity(scenario)
    opencv.write_values(files / "rig" / f"{RIG[0].name}.yml", replace(RIG[0], size=(1040, 780)))
    assert trial_identity(scenario) != before


def test_show_names_the_keys_without_effect_and_can_be_read_again(files):
    overrides = ["--set", 'cameras.layout="file"', "--set", f'cameras.file="{files / "sized.toml"}"']
    shown = CliRunner().invoke(app, ["show", "quickstart", *overrides])
    assert shown.exit_code == 0, shown.output
    comment = " ".join(line.removeprefix("# ") for line in shown.stdout.splitlines() if line.startswith("# "))
    assert "Without effect in [cameras]: count, heights, spread" in comment
    (files / "again.toml").write_text(shown.stdout)
    assert build_rig(load(files / "again.toml").cameras)[0].size == (1032, 776)
    assert "Without effect" not in CliRunner().invoke(app, ["show", "quickstart"]).stdout
