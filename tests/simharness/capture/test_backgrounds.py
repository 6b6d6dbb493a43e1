"""Meshes that stay where they are: drawn once for each camera, and nothing of a picture depends on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mesh_shapes import ball, box, chequered, sheet
from test_renderers import SLANTING, VIEWS, camera_at

from simharness.capture.picture import reflected
from simharness.capture.rendering import backgrounds
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.mirror import Mirror

FLOOR = sheet([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], (0.8, 0.8, 0.8))
FURNITURE = [FLOOR, chequered((2.0, 1.6)), box((-1.2, 1.0, 0.4), (0.5, 0.5, 0.8))]
PEOPLE = [ball(place, 0.3, rings=16) for place in ((0.0, 0.0, 0.8), (0.8, -0.5, 1.2), (-0.9, 0.9, 1.1))]
FIELDS = ("rgb", "depth", "ids", "parts")


def standing(meshes):
    return [replace(mesh, still=True) for mesh in meshes]


STILL = standing(FURNITURE)


def moved(step):
    return [mesh.moved(mesh.vertices + np.float32([0.21 * step, -0.13 * step, 0.0])) for mesh in PEOPLE]


def assert_same(one, other):
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_a_kept_background_changes_no_bit_of_a_picture():
    kept = RasterRenderer()
    for step in range(3):
        scene = [*moved(step), *STILL]
        for lighting in (SLANTING, replace(SLANTING, key=0.4)):
            for camera in VIEWS:
                image = kept.render(camera, scene, lighting=lighting, parts=True)
                assert_same(image, RasterRenderer().render(camera, scene, lighting=lighting, parts=True))
    assert (image.ids < len(PEOPLE)).any()
    assert (image.ids >= len(PEOPLE)).any()


@pytest.mark.parametrize("first", [True, False], ids=["people first", "people last"])
def test_still_meshes_are_seen_as_others_are(first):
    """Depth and ids are the same, and colours but for rounding and edges of shadows."""
    order = (lambda people, rest: [*people, *rest]) if first else (lambda people, rest: [*rest, *people])
    for camera in VIEWS:
        one = RasterRenderer().render(camera, order(PEOPLE, STILL), lighting=SLANTING)
        other = RasterRenderer().render(camera, order(PEOPLE, FURNITURE), lighting=SLANTING)
        np.testing.assert_array_equal(one.ids, other.ids)
        np.testing.assert_array_equal(one.depth, other.depth)
        # The shadow maps cover different boxes, so that edges of shadows differ by a pixel of the map.
        assert (np.abs(one.rgb.astype(int) - other.rgb).max(axis=-1) <= 2).mean() > 0.97


def test_shadows_move_with_what_casts_them():
    camera, renderer = camera_at((0.05, 0.0, 7.0), (0.0, 0.0, 0.0), size=(240, 240), fov=60.0), RasterRenderer()
    floor, bird = replace(FLOOR, still=True), box((0.0, 0.0, 1.0), (0.5, 0.5, 0.02))
    bare = renderer.render(camera, [floor, bird.moved(bird.vertices + np.float32([50, 0, 0]))]).rgb.astype(int)
    dark = []
    for shift in (-1.0, 1.0):
        image = renderer.render(camera, [floor, bird.moved(bird.vertices + np.float32([shift, 0, 0]))])
        dark.append((image.ids == 0) & ((bare - image.rgb).max(axis=-1) > 20))
    assert dark[0].sum() > 100
    assert dark[1].sum() > 100
    assert not (dark[0] & dark[1]).any()


def test_a_mesh_that_is_moved_is_not_still_and_a_reflection_is_neither():
    board = STILL[1]
    assert not board.moved(board.vertices).still
    mirror = Mirror(center=(3.0, 0.0, 1.0), normal=(-1.0, 0.0, 0.0), half=(1.0, 1.0))
    assert not reflected(board, mirror).still


def test_other_still_meshes_are_another_scene():
    renderer, ball_here = RasterRenderer(), replace(ball((0.0, 0.0, 1.0), 0.4, rings=12), still=True)
    for scene in (STILL, [*STILL, ball_here], STILL, [ball_here]):
        image = renderer.render(VIEWS[0], [*PEOPLE, *scene], parts=True)
        assert_same(image, RasterRenderer().render(VIEWS[0], [*PEOPLE, *scene], parts=True))


def test_the_memory_of_backgrounds_is_bounded(monkeypatch):
    renderer, scene = RasterRenderer(), [*PEOPLE, *STILL]
    renderer.render(VIEWS[0], scene)
    (kept,) = (each.backgrounds for each in renderer._scenes)
    one = next(iter(kept._kept.values())).nbytes
    monkeypatch.setattr(backgrounds, "MOST_BYTES", int(2.5 * one))
    for camera in VIEWS:
        renderer.render(camera, scene)
    assert len(kept._kept) == 2
    assert_same(renderer.render(VIEWS[0], scene, parts=True), RasterRenderer().render(VIEWS[0], scene, parts=True))


def test_where_not_all_fit_some_stay_from_round_to_round(monkeypatch):
    """Cameras take turns; those that do not come back make room after two rounds."""
    renderer, scene = RasterRenderer(), [*PEOPLE, *STILL]
    renderer.render(VIEWS[0], scene)
    (kept,) = (each.backgrounds for each in renderer._scenes)
    one = next(iter(kept._kept.values())).nbytes
    monkeypatch.setattr(backgrounds, "MOST_BYTES", int(2.5 * one))
    rounds = []
    others = [camera_at((2.0, y, 1.5), (0.0, 0.0, 1.0)) for y in (2.0, 2.5)]
    for cameras in [VIEWS] * 2 + [others] * 5:
        for camera in cameras:
            renderer.render(camera, scene)
        rounds.append({id(each): each for each in kept._kept.values()})  # held, so that no id comes again
    assert rounds[0].keys() & rounds[1].keys()
    assert rounds[-1].keys() == rounds[-2].keys()
    assert not rounds[-1].keys() & rounds[1].keys()
