"""Breaks of a rig by the command line alone: a small part of ``python -m benchmarks.doctor.breaks``."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.doctor.breaks import BREAKS, VIEW, Lab, measure, pose2sim, table, turned, write_cameras
from benchmarks.method.scenes import ring, stick_people
from mvpose import Rig
from mvpose.cli.app import app
from mvpose.formats.detections.openpose import people_file

DATA = Path(os.environ.get("SIMHARNESS_DATA", "/nowhere"))
FIRST = 100  # number of the first picture


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Two people who walk to and fro before four cameras, for four seconds at 10 Hz, as OpenPose's files."""
    rng, folder = np.random.default_rng(0), tmp_path_factory.mktemp("lab")
    rig = Rig([replace(each, name=f"cam{view}") for view, each in enumerate(ring(4, 2))])
    people = stick_people(np.array([[0.2, 0.8], [0.9, -0.8]]), rng)
    for frame in range(40):
        way = np.array(
            [
                [1.1 * np.sin(0.13 * frame), 0.6 * np.cos(0.21 * frame), 0.0],
                [-0.03 * frame, 0.9 * np.cos(0.17 * frame), 0.0],
            ]
        )
        pixels = rig.project(people + way[:, None])
        pixels = pixels + rng.normal(scale=1.5, size=pixels.shape)
        for camera, bodies in zip(rig, pixels, strict=True):
            file = folder / camera.name / f"{camera.name}_{frame + FIRST:012d}_keypoints.json"
            file.parent.mkdir(exist_ok=True)
            file.write_text(json.dumps(people_file(bodies, np.full(bodies.shape[:2], 0.9))))
    return Lab("walkers", rig, folder, ("--fps", "10", "--frames", f"{FIRST}:{FIRST + 39}"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["untouched", "millimetres, one", "moved by 2 degrees"])
def test_a_break_is_found_named_and_mended_by_what_is_printed(lab, tmp_path, name):
    row = measure(lab, name, tmp_path)
    assert row.right, row
    assert name in table([row])
    if name == "untouched":
        assert (row.verdict, row.command) == ("fine", "")
    else:
        assert row.after == "fine"
        assert f"--fps 10 --frames {FIRST}:{FIRST + 39}" in row.command  # as given, else the rate would be another


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.6, 1.0])
def test_a_camera_that_is_off_is_never_called_fine(lab, tmp_path, degrees):
    """By any axis: a turn about the axis of the view shows least."""
    cameras = list(lab.rig)
    cameras[VIEW] = turned(degrees)(cameras[VIEW])
    write_cameras(tmp_path / "Calib.toml", cameras)
    result = CliRunner().invoke(app, ["doctor", str(tmp_path / "Calib.toml"), str(lab.detections), *lab.options])
    assert not result.stdout.startswith("verdict: fine"), result.stdout


@pytest.mark.skipif(not (DATA / "pose2sim").is_dir(), reason="SIMHARNESS_DATA names no folder with pose2sim/")
@pytest.mark.parametrize("name", ["untouched", "two exchanged"])
def test_breaks_of_a_real_rig(tmp_path, name):
    row = measure(pose2sim(DATA, tmp_path), name, tmp_path)
    assert row.right, row


def test_every_break_changes_the_calibration(lab):
    for name, case in BREAKS.items():
        changed = case.change(list(lab.rig))
        same = all(
            np.array_equal(a.K, b.K) and np.array_equal(a.R, b.R) and np.array_equal(a.t, b.t) and a.size == b.size
            for a, b in zip(changed, lab.rig, strict=True)
        )
        assert same == (name == "untouched")
