"""Bodies as capsules around joints."""

import numpy as np
import pytest

from mvpose.skeleton import COCO17
from simharness.outputs.figures.mosaic import mosaic, rooms_in_grid
from simharness.outputs.study.body_parts import CAPSULES, HEAD, body_parts


def standing():
    """Return the joints of a person who stands at the origin, (17, 3), metres."""
    heights = {"hip": 0.95, "knee": 0.5, "ankle": 0.08, "shoulder": 1.45, "elbow": 1.15, "wrist": 0.9}
    joints = np.zeros((17, 3))
    for index, name in enumerate(COCO17.joints):
        side = {"left": 0.18, "right": -0.18}.get(name.split("_")[0], 0.0)
        joints[index] = (0.0, side, heights.get(name.split("_")[-1], 1.65))
    return joints


def test_a_whole_person_has_limbs_trunk_neck_and_head():
    parts = body_parts(standing())
    assert sorted(len(points) for points, _ in parts) == [1, *[2] * 9, 4]
    ((head, radius),) = [(points, radius) for points, radius in parts if len(points) == 1]
    np.testing.assert_allclose(head[0], standing()[list(HEAD[0])].mean(axis=0))
    assert 0.07 < radius < 0.13


def test_left_and_right_are_alike():
    radii = {(COCO17.joints[a].split("_")[1], COCO17.joints[b].split("_")[1]): set() for a, b, _ in CAPSULES}
    for a, b, radius in CAPSULES:
        assert COCO17.joints[a].split("_")[0] == COCO17.joints[b].split("_")[0]
        radii[COCO17.joints[a].split("_")[1], COCO17.joints[b].split("_")[1]].add(radius)
    assert all(len(each) == 1 for each in radii.values())


@pytest.mark.parametrize(("missing", "lost"), [("left_elbow", 2), ("left_ankle", 1), ("left_hip", 2), ("nose", 0)])
def test_parts_of_unknown_joints_are_left_out(missing, lost):
    joints = standing()
    joints[COCO17.index(missing)] = np.nan
    parts = body_parts(joints)
    assert len(parts) == 11 - lost
    assert all(np.isfinite(points).all() for points, _ in parts)


def test_a_person_without_joints_has_no_parts():
    assert body_parts(np.full((17, 3), np.nan)) == []


@pytest.mark.parametrize("count", range(1, 13))
def test_the_rooms_of_a_grid_are_those_of_the_mosaic(count):
    tile = np.zeros((60, 80, 3), np.uint8)
    size = mosaic([tile] * count, [""] * count).shape
    full = rooms_in_grid(count)
    assert mosaic([tile] * full, [""] * full, columns=int(np.ceil(np.sqrt(count)))).shape == size
