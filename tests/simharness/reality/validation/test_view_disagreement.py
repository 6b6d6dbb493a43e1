"""Disagreement of views: of recordings whose errors are known, and against distances of lines by least squares."""

from dataclasses import replace

import numpy as np
import pytest
from test_detection_figures import changed
from turning_people import walkers

from mvpose import Rig
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.reality.validation.detection_figures import measure_detections


@pytest.fixture(scope="module")
def exact():
    return walkers(frames=12, people=2, cameras=4)


def values(recording):
    return measure_detections(recording).values()


def test_exact_views_agree_with_each_other_and_with_the_truth(exact):
    found = values(exact)
    for key, value in found.items():
        if key.partition(".")[0] in ("residual", "gross", "gross_joints", "epipolar", "offset", "annotation"):
            assert value == pytest.approx(0.0, abs=1e-4), key


def test_an_offset_of_one_view_lasts(exact):
    def shift(view, points, scores):
        points[view == 1] += [3.0, 0.0]

    found = values(changed(exact, shift))
    assert found["residual.2"] > max(found[f"residual.{view}"] for view in (1, 3, 4))
    assert found["memory.2"] > 0.99
    assert found["gross"] == 0.0


def test_independent_noise_has_no_memory():
    noisy = values(walkers(frames=60, people=2, cameras=4, noise=3.0))
    assert all(abs(noisy[f"memory.{view}"]) < 0.1 for view in (1, 2, 3, 4))
    twice = values(walkers(frames=60, people=2, cameras=4, noise=6.0))
    assert twice["residual.1"] == pytest.approx(2 * noisy["residual.1"], rel=0.1)


def test_gross_errors_are_counted(exact):
    def throw(view, points, scores):
        points[view == 0, 9] += [300.0, 0.0]  # every left wrist of one of four views

    found = values(changed(exact, throw))
    assert found["gross_joints.wrists"] == pytest.approx(1 / 8)
    assert found["gross"] == pytest.approx(1 / (4 * len(LIMB_JOINTS)))
    assert found["gross_joints.elbows"] == 0.0


def test_distances_of_rays_are_those_of_lines():
    noisy = walkers(frames=3, people=1, cameras=3, noise=4.0)
    apart = []
    for detections in noisy.detections:
        rays = [noisy.rig[view].rays(detections.keypoints[detections.view == view][0]) for view in (0, 2)]
        for joint in LIMB_JOINTS:
            directions = np.stack([rays[0][joint], -rays[1][joint]], axis=1)
            between = noisy.rig.centers[2] - noisy.rig.centers[0]
            apart.append(np.linalg.norm(directions @ np.linalg.lstsq(directions, between, rcond=None)[0] - between))
    found = values(noisy)
    assert found["epipolar.1-3"] == pytest.approx(1000 * np.mean(apart), rel=1e-6)
    assert abs(found["offset.1-3"]) < found["epipolar.1-3"]


def test_a_moved_camera_shows_in_the_sign(exact):
    moved = [replace(exact.rig[0], t=exact.rig[0].t + [0.0, 0.02, 0.0]), *exact.rig[1:]]  # 2 cm along its vertical
    found = values(replace(exact, rig=Rig(moved)))
    for pair in ("1-2", "1-3", "1-4"):
        assert abs(found[f"offset.{pair}"]) == pytest.approx(found[f"epipolar.{pair}"])
        assert 5.0 < found[f"epipolar.{pair}"] < 20.5
    assert found["epipolar.2-3"] == pytest.approx(0.0, abs=1e-4)


def test_a_truth_that_is_off_is_off_by_this(exact):
    found = values(replace(exact, truth=exact.truth + [0.0, 0.0, 0.03]))
    for kind in ("shoulders", "elbows", "wrists", "hips", "knees", "ankles"):
        assert found[f"annotation.{kind}"] == pytest.approx(30.0, abs=0.01)
