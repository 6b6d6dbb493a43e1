"""Seeing by rays against seeing by pictures, on whole scenes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mvpose.camera import Rig
from simharness.capture.filming import PictureObserver
from simharness.capture.ray_casting import RayCaster
from simharness.capture.ray_visibility import RayObserver
from simharness.capture.rendering.raster import make_renderer
from simharness.scenario.sections.scenario import Scenario
from simharness.types.views import Visibility
from simharness.world.rigs.layouts import build_rig
from simharness.world.rigs.projection import project_to_image
from simharness.world.scene.build import build
from simharness.world.scene.playback import Playback

SCENES = {
    "walking about": (1, ("walk", "wave"), {"boxes": 6, "shelves": 1}),
    "low": (2, ("sit", "squat", "crouch", "kneel"), {"tables": 1, "plants": 2}),
    "busy hands": (3, ("reach", "point", "turn", "talk"), {"pillars": 2, "carts": 1}),
    "in pairs": (4, ("shake_hands", "hug"), {"partitions": 1, "chairs": 2}),
}


@cache
def played(name):
    """Return a scene and its rig."""
    seed, activities, clutter = SCENES[name]
    scenario = Scenario(
        name="rays",
        seed=seed,
        duration=1.5,
        people={"count": 4, "activities": activities},
        clutter=clutter,
        cameras={"count": 4, "radius": 3.7, "height": 1.7, "start": 18.0},
    )
    rig = build_rig(scenario.cameras)
    return Playback(build(scenario, rig)), rig


@cache
def compared(name):
    """Pairs of observations by rays and pictures: every camera at four times."""
    playback, rig = played(name)
    rays, pictures = RayObserver(playback), PictureObserver(playback, make_renderer("raster"))
    pairs = []
    for time in (0.1, 0.5, 1.0, 1.4):
        state = playback.at(time)
        pairs += zip(rays.observe([state], list(rig)), pictures.observe([state], list(rig)), strict=True)
    return pairs


def confusion(names):
    """Return counts of labels by pictures (rows) and by rays (columns), (5, 5)."""
    table = np.zeros((5, 5), int)
    for name in names:
        for by_rays, by_picture in compared(name):
            np.add.at(table, (by_picture.visibility.ravel(), by_rays.visibility.ravel()), 1)
    return table


@pytest.mark.slow
def test_rays_and_pictures_agree_on_97_of_100_labels():
    table = confusion(SCENES)
    assert np.trace(table) / table.sum() >= 0.97, f"\n{table}"
    assert (table.sum(axis=1) > 50).all()  # every label occurs


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_rays_and_pictures_agree_in_every_scene(name):
    table = confusion([name])
    assert np.trace(table) / table.sum() >= 0.95, f"\n{table}"
    assert table[4, :4].sum() == table[:4, 4].sum() == 0  # OUTSIDE does not depend on the observer
    hidden = table[2:4].sum()
    assert np.trace(table[2:4, 2:4]) / hidden > 0.85


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_pixels_are_the_same_and_boxes_nearly(name):
    off = []
    for by_rays, by_picture in compared(name):
        np.testing.assert_array_equal(by_rays.pixels, by_picture.pixels)
        low, high = (by_rays.boxes[:, :2] - by_picture.boxes[:, :2]), by_rays.boxes - by_picture.boxes
        wrong = np.abs(np.concatenate([low, high[:, :2] + high[:, 2:]], axis=1)).max(axis=1)
        off += (wrong > np.maximum(2.0, 0.02 * by_picture.boxes[:, 2:].max(axis=1))).tolist()
    assert np.mean(off) < 0.06  # people cut by the border at a small angle


def test_the_estimated_visible_area_is_right_on_average():
    pairs = [pair for name in SCENES for pair in compared(name)]
    estimate, area = (np.concatenate([pair[k].area_visible for pair in pairs]) for k in (0, 1))
    seen = area > 500
    assert 0.8 < np.median(estimate[seen] / area[seen]) < 1.25
    assert np.corrcoef(estimate, area)[0, 1] > 0.8


def test_distortion_shifts_pixels_but_changes_no_visibility():
    """Rays are straight in the world: joints that both lenses image have the same labels."""
    playback, rig = played("walking about")
    bent = [replace(camera, distortion=np.array([-0.3, 0.1, 0.0, 0.0, 0.0])) for camera in rig]
    observer, state = RayObserver(playback), playback.at(1.0)
    for camera, straight, curved in zip(
        bent, observer.observe([state], list(rig)), observer.observe([state], bent), strict=True
    ):
        np.testing.assert_array_equal(curved.pixels, project_to_image(camera, state.joints))
        both = (straight.visibility != Visibility.OUTSIDE) & (curved.visibility != Visibility.OUTSIDE)
        np.testing.assert_array_equal(curved.visibility[both], straight.visibility[both])
        assert both.sum() > 0
        on = camera.inside(curved.pixels)
        boxes = np.repeat(curved.boxes[:, None], on.shape[1], axis=1)[on]
        assert (np.abs(curved.pixels[on] - boxes[:, :2] - boxes[:, 2:] / 2) <= boxes[:, 2:] / 2 + 2).all()


def test_a_rolling_shutter_changes_nothing_in_a_static_scene():
    playback, rig = played("low")
    observer, state = RayObserver(playback), playback.at(0.8)
    for at_once, rolled in zip(
        observer.observe([state], list(rig)), observer.observe([state] * 12, list(rig)), strict=True
    ):
        np.testing.assert_array_equal(rolled.visibility, at_once.visibility)
        np.testing.assert_allclose(rolled.pixels, at_once.pixels)
        np.testing.assert_allclose(rolled.boxes, at_once.boxes, atol=1e-6)


def test_a_rolling_shutter_observes_each_joint_at_the_time_of_its_row():
    """The upper half of the rows is exposed at one time, the lower half at another."""
    playback, rig = played("walking about")
    observer = RayObserver(playback)
    early, late = playback.at(0.1), playback.at(1.4)
    halves = zip(observer.observe([early], list(rig)), observer.observe([late], list(rig)), strict=True)
    differ = 0
    for seen, (first, second) in zip(observer.observe([early] * 6 + [late] * 6, list(rig)), halves, strict=True):
        rows = np.stack([first.pixels[..., 1], second.pixels[..., 1]]) - 299.5
        for half, clear in ((first, (rows < -60).all(axis=0)), (second, (rows > 60).all(axis=0))):
            np.testing.assert_array_equal(seen.visibility[clear], half.visibility[clear])
            np.testing.assert_allclose(seen.pixels[clear], half.pixels[clear])
            differ += (first.visibility != second.visibility)[clear].sum()
    assert differ > 10


def test_observations_do_not_depend_on_earlier_ones():
    playback, rig = played("busy hands")
    observer = RayObserver(playback)
    states = [playback.at(time) for time in (0.5, 1.2)]
    whole = [observer.observe([state], list(rig)) for state in states]
    for k, state in reversed(list(enumerate(states))):
        fresh = RayObserver(playback)
        for v in reversed(range(len(rig))):
            (alone,) = fresh.observe([state], [rig[v]])
            np.testing.assert_array_equal(alone.visibility, whole[k][v].visibility)
            np.testing.assert_array_equal(alone.boxes, whole[k][v].boxes)


def test_a_room_without_people():
    scenario = Scenario(name="empty", people={"count": 0}, clutter={"boxes": 1})
    rig = Rig(list(build_rig(scenario.cameras))[:2])
    playback = Playback(build(scenario, rig))
    for seen in RayObserver(playback).observe([playback.at(0.0)], list(rig)):
        assert seen.pixels.shape == (0, 17, 2)
        assert seen.visibility.shape == (0, 17)
        assert seen.boxes.shape == (0, 4)
        assert seen.area_visible.shape == (0,)
    assert RayCaster(playback.scene).cast(rig[0], np.zeros((1, 3)))[0].tolist() in ([-1], [0])
