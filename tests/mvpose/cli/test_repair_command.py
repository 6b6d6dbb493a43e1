"""``mvpose repair``: the new calibration in the format of the old one, or one line that says why there is none."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.calibration import Repair
from mvpose.cli.app import app
from mvpose.formats.calibration import easymocap, pose2sim
from mvpose.formats.calibration.calibration_formats import read_calibration

NAMES = ["cam0", "cam1", "cam2", "cam3"]


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Return a function that runs the command with a known result: camera 1 is 2 cm higher, and 10 ms behind."""
    rig, _, pixels = filmed(frames=3)
    write_openpose(tmp_path / "openpose", NAMES, pixels)
    moved = [replace(camera, t=camera.t - 0.02 * camera.R[:, 2]) if k == 1 else camera for k, camera in enumerate(rig)]

    def run(*arguments, refused=None):
        def repair(given, frames, *, period, free, size):
            assert size == ("people" if "--rig-size" in arguments else "calibration")
            corrections, clocks = np.zeros((4, 6)), np.array([0.0, 0.01, 0.0, 0.0])
            corrections[1, 5] = 0.02
            return Repair(
                given if refused else Rig(moved), clocks, corrections, np.zeros((4, 6, 6)), np.full(4, 0.002),
                np.ones(4), np.zeros((4, 2)), ("the clock of cam0: it is the reference",), refused, np.full(4, 6.0),
                np.full(4, 3.0), 2,
            )  # fmt: skip

        def estimate_clocks(given, frames, *, period):
            times = period * np.arange(len(frames))[:, None] + np.array([0.0, 0.01, 0.0, 0.0])
            return SimpleNamespace(names=NAMES, times=times)

        monkeypatch.setattr("mvpose.calibration.repair", repair)
        monkeypatch.setattr("mvpose.calibration.estimate_clocks", estimate_clocks)
        return CliRunner().invoke(app, [str(each) for each in ("repair", *arguments)])

    return run, tmp_path, rig, Rig(moved)


@pytest.mark.parametrize(("write", "file"), [(pose2sim, "Calib.toml"), (easymocap, "intri.yml")])
def test_the_new_calibration_has_the_format_of_the_old(call, write, file):
    run, folder, rig, moved = call
    (folder / "old").mkdir()
    write.write_calibration(folder / "old" if write is easymocap else folder / "old" / file, rig)
    out, times = folder / "new" / file, folder / "times.csv"
    options = "--out", out, "--fps", 25, "--new-times", times, "--rig-size", "people"
    result = run(folder / "old" / file, folder / "openpose", *options)
    assert result.exit_code == 0, result.output
    assert "cam1: turned by 0.00 degrees, moved by 2.0 cm, clock +10 ms (standard deviation 2)" in result.stdout
    assert "note: not changed: the clock of cam0: it is the reference" in result.stderr
    for one, two in zip(read_calibration(out, size=(1, 1)), moved, strict=True):
        np.testing.assert_allclose(one.center, two.center, atol=1e-9)
    np.testing.assert_allclose(
        np.loadtxt(times, delimiter=",", skiprows=1), np.arange(3)[:, None] / 25 + [0, 0.01, 0, 0], atol=1e-6
    )
    assert not list(folder.glob(".*")) + list((folder / "new").glob(".*"))


def test_what_is_there_is_never_replaced(call):
    run, folder, rig, _ = call
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    before = (folder / "Calib.toml").read_bytes()
    result = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "Calib.toml")
    assert result.exit_code == 2
    assert "exists, and is not replaced" in result.stderr
    assert (folder / "Calib.toml").read_bytes() == before


def test_a_refused_repair_writes_nothing(call):
    run, folder, rig, _ = call
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    result = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "new.toml", refused="two cameras only")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "error: nothing was repaired: two cameras only"
    assert not (folder / "new.toml").exists()
    wrong = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "new.toml", "--free", "colour")
    assert wrong.exit_code == 2
    assert "--free colour: expected some of extrinsics, focal, center" in wrong.stderr
    wrong = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "new.toml", "--rig-size", "me")
    assert wrong.exit_code == 2
    assert "--rig-size me: expected calibration, people or both" in wrong.stderr


def test_named_mends_are_applied_and_nothing_else(call):
    """The rig of the file in millimetres and inverted is the true one again; no camera is estimated."""
    run, folder, rig, _ = call
    wrong = Rig.unchecked([replace(each, R=each.R.T, t=1000 * each.center) for each in rig])
    pose2sim.write_calibration(folder / "Calib.toml", wrong)
    mends = "--mend", "unit:0.001", "--mend", "inverted"
    result = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "new.toml", "--fps", 25, *mends)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[:2] == ["unit:0.001: applied", "inverted: applied"]
    for one, two in zip(read_calibration(folder / "new.toml", size=(1, 1)), rig, strict=True):
        np.testing.assert_allclose(one.R, two.R, atol=1e-12)
        np.testing.assert_allclose(one.t, two.t, atol=1e-12)


def test_corrected_times_alone_leave_the_calibration(call):
    run, folder, rig, _ = call
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    result = run(folder / "Calib.toml", folder / "openpose", "--fps", 25, "--new-times", folder / "new" / "times.csv")
    assert result.exit_code == 0, result.output
    assert [each.name for each in (folder / "new").iterdir()] == ["times.csv"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "--out: expected the file of the new calibration"),
        (("--mend", "inverted", "--new-times", "t.csv"), "--mend and --free change the calibration: give --out"),
        (("--out", "new.toml", "--mend", "bent"), "--mend bent: expected NAME"),
        (("--out", "new.toml", "--mend", "inverted@cam9"), "there is no camera 'cam9'"),
        (("--out", "new.toml", "--mend", "unit:1e6"), "which cannot be metres"),
        (("--out", "new.toml", "--mend", "inverted", "--rig-size", "both"), "--rig-size: has an effect only where"),
    ],
)
def test_options_that_do_nothing_or_harm_are_refused(call, options, message):
    run, folder, rig, _ = call
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    result = run(folder / "Calib.toml", folder / "openpose", "--fps", 25, *options)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not Path("new.toml").exists()


def test_an_axis_that_points_up_has_no_effect_and_says_so(call):
    run, folder, rig, moved = call
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    result = run(folder / "Calib.toml", folder / "openpose", "--out", folder / "new.toml", "--fps", 25, "--up", "-y")
    assert "--up has no effect" in result.stderr
    for one, two in zip(read_calibration(folder / "new.toml", size=(1, 1)), moved, strict=True):
        np.testing.assert_allclose(one.R, two.R, atol=1e-12)
