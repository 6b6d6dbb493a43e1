"""Benchmark of calibration from people: what it prints of a recording, its errors, and poses as its peer reads them."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.doctor.measures import aligned, camera_errors
from benchmarks.from_people.__main__ import main
from benchmarks.from_people.peer import write_poses
from benchmarks.method.scenes import ring
from mvpose import Rig


@pytest.mark.slow
def test_cameras_of_the_first_recording_are_found(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["from_people", "--count", "1"])
    main()
    first, total = capsys.readouterr().out.splitlines()
    assert first.startswith("0: 3 cameras, mvpose 0.")
    degrees, percent = (float(each) for each in total.split("median ")[1].replace("°", "").split()[:3:2])
    assert degrees < 0.5
    assert percent < 1.0


@pytest.mark.parametrize("resized", [False, True])
def test_a_rig_in_another_world_has_no_error_once_it_is_aligned(resized):
    true = ring(4, 2)
    turn, shift, size = Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(), np.array([1.0, -2.0, 0.5]), 1.3
    moved = Rig(
        [replace(each, R=each.R @ turn.T, t=-each.R @ (size * each.center) - each.R @ turn.T @ shift) for each in true]
    )
    degrees, metres = camera_errors(aligned(moved, true, resized=resized), true)
    np.testing.assert_allclose(degrees, 0, atol=1e-5)
    spread = np.linalg.norm(true.centers - true.centers.mean(0), axis=1)
    np.testing.assert_allclose(metres, 0 if resized else (size - 1) * spread, atol=1e-9)


def test_poses_of_the_peer_have_necks_between_shoulders_and_no_joint_that_is_not_seen(tmp_path):
    rng = np.random.default_rng(0)
    points, scores = rng.uniform(0, 500, (3, 17, 2)), rng.uniform(0.5, 1, (3, 17))
    points[1, 9] = np.nan
    write_poses(tmp_path, "2d_joint", 2, points, scores)
    file = json.loads((tmp_path / "2d_joint" / "A001_P001_G001_C003.json").read_text())["data"]
    poses = np.array([each["skeleton"][0]["pose"] for each in file]).reshape(3, 25, 2)
    certain = np.array([each["skeleton"][0]["score"] for each in file])
    np.testing.assert_allclose(poses[:, 1], points[:, [5, 6]].mean(1))
    np.testing.assert_allclose(poses[[0, 2], 7], points[[0, 2], 9])  # left wrist
    assert certain[1, 7] == 0
    np.testing.assert_allclose(certain[0, 8], scores[0, [11, 12]].min())  # middle of the hips
    assert not certain[:, 19:].any()  # feet
