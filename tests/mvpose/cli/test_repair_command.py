"""``mvpose repair``: the new calibration in the format of the old one, or one line that says why there is none."""

from dataclasses import replace
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
