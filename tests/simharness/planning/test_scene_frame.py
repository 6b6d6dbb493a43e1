"""Frame of scenes: the least rectangle around a volume, and a rig that sees the same in both frames."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.planning.rehearsal_scene import SceneFrame
from simharness.world.rigs.layouts import preset_rig


def test_an_upright_rectangle_keeps_its_axes():
    frame = SceneFrame.around(np.array([[1.0, 2.0], [5.0, 2.0], [5.0, 4.0], [1.0, 4.0]]))
    assert frame.bearing == 0.0
    assert np.allclose(frame.center, [3.0, 3.0])
    assert np.allclose(frame.half, [2.0, 1.0])


@pytest.mark.parametrize("degrees", [10.0, 37.0, 80.0])
def test_a_turned_rectangle_has_the_area_of_the_rectangle(degrees):
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners = np.array([[-3.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-3.0, 1.0]]) @ turn.T + [4.0, -2.0]
    frame = SceneFrame.around(corners)
    assert np.allclose(4 * frame.half.prod(), 12.0)
    assert np.allclose(np.abs(frame.to_scene(corners)), frame.half)


def test_places_return_from_the_scene_to_the_world():
    frame = SceneFrame.around(np.array([[0.0, 0.0], [3.0, 1.0], [2.0, 4.0], [-1.0, 2.0]]))
    places = np.random.default_rng(0).normal(size=(20, 2))
    assert np.allclose(frame.to_world(frame.to_scene(places)), places)


def test_a_moved_rig_sees_moved_points_at_the_same_pixels():
    rig, frame = preset_rig("shelf"), SceneFrame(np.array([1.0, -2.0]), 0.7, np.ones(2))
    points = np.random.default_rng(1).normal(size=(30, 3)) * 0.5 + [0, 0, 1]
    local = np.column_stack([frame.to_scene(points[:, :2]), points[:, 2]])
    for camera, moved in zip(rig, frame.rig(rig), strict=True):
        assert np.allclose(moved.project(local), camera.project(points), atol=1e-6)
