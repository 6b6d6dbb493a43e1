"""Boxes from outlines against boxes from the whole skin."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from test_renderers import camera_at

from simharness.capture.body_outlines import Outline, bounding_box, packed
from simharness.capture.rendering.renderer import NEAR
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.mujoco_model import neutral_transforms
from simharness.world.humans.population import draw_shape
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import draw_looks
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.rigs.projection import project_to_image

BARREL = np.array([-0.37, 0.15, 0.001, -0.001, 0.0])


def somebody(seed):
    return dress(make_body(draw_shape(stream(seed, "test", "shape"))), draw_looks(seed, 1)[0])


def poses(body, count, seed):
    """Return bone transforms (count, B, 3, 4) with joints bent at random within half their ranges."""
    mover, rng = Kinematics(body), stream(seed, "test", "poses")
    root = np.tile([0.0, 0.0, mover.standing_height, 1.0, 0.0, 0.0, 0.0], (count, 1))
    low, high = mover.ranges.T / 2
    return mover.transforms(Motion(np.arange(count) / 10, root, rng.uniform(low, high, (count, len(low)))))


def framed_by_outline(body, transforms, camera, rows=(0.0, 1.0)):
    """Return left, top, right, bottom, (4,)."""
    outline, out = Outline.from_body(body), np.empty((1, 4))
    bounding_box(outline.at(transforms), outline.edges, packed(camera)[None], *rows, out)
    return out[0]


def framed_by_skin(skin, camera, rows=(0.0, 1.0)):
    """Return the same from all vertices of the skin that fall on the image."""
    pixels = project_to_image(camera, skin, near=NEAR)
    share = (pixels[:, 1] + 0.5) / camera.size[1]
    pixels = pixels[camera.inside(pixels) & (share >= rows[0]) & (share < rows[1])]
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def assert_close(found, expected):
    """Compare within 2 pixels, or 2 % of the larger side of the box."""
    allowed = max(2.0, 0.02 * max(expected[2] - expected[0], expected[3] - expected[1]))
    np.testing.assert_allclose(found, expected, atol=allowed)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("distortion", [np.zeros(5), BARREL], ids=["pinhole", "barrel"])
def test_the_box_of_an_outline_is_that_of_the_skin(seed, distortion):
    body = somebody(seed)
    rng = stream(seed, "test", "cameras")
    for transforms in poses(body, 6, seed):
        bearing = rng.uniform(0, 2 * np.pi)
        place = (3.5 * np.cos(bearing), 3.5 * np.sin(bearing), rng.uniform(0.5, 2.5))
        camera = replace(camera_at(place, (0, 0, 1), size=(800, 600), fov=75.0), distortion=distortion)
        assert_close(framed_by_outline(body, transforms, camera), framed_by_skin(body.skin(transforms), camera))


@pytest.mark.slow
def test_boxes_end_at_the_image_border():
    """Close up and off centre: the box is that of the part on the image, and ends where the image does.

    Where an outline meets the border at a flat angle, little beside the skin is far along the border: hence shares.
    """
    errors = []
    for seed in range(2):
        body = somebody(seed)
        for transforms in poses(body, 4, seed):
            skin = between(body.skin(transforms)[body.faces])
            for aim in ((0, 0.9, 1.6), (0, -0.8, 1.0), (0, 0.2, 0.1), (0, 0, 1.9), (0, 1.2, 1.2)):
                camera = camera_at((2.2, 0.3, 1.5), aim, size=(800, 600), fov=50.0)
                inside = camera.inside(project_to_image(camera, skin))
                if inside.any() and not inside.all():
                    expected = framed_by_skin(skin, camera)
                    size = max(expected[2] - expected[0], expected[3] - expected[1])
                    errors.append(np.abs(framed_by_outline(body, transforms, camera) - expected).max() / size)
    assert len(errors) > 20
    assert np.mean(np.array(errors) < 0.02) > 0.8
    assert max(errors) < 0.2


def between(corners):
    """Points all over triangles (k, 3, 3), (n, 3)."""
    steps = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4
    return np.einsum("bk,fkc->bfc", steps, corners).reshape(-1, 3)


def test_outlines_are_clipped_at_the_near_plane():
    body = make_body(Shape())
    transforms = neutral_transforms(body)
    camera = camera_at((0.1, 0.45, 1.0), (0.0, 0.0, 1.2), size=(800, 600), fov=90.0)
    skin = between(body.skin(transforms)[body.faces])
    assert camera.depth(skin).min() < NEAR < camera.depth(skin).max()
    assert_close(framed_by_outline(body, transforms, camera), framed_by_skin(skin, camera))


def test_a_person_outside_the_image_has_no_box():
    body = make_body(Shape())
    transforms = neutral_transforms(body)
    for aim in ((9, 0, 1), (4, 5, 1)):  # behind the camera; beside the image
        left, _, right, _ = framed_by_outline(body, transforms, camera_at((4, 0, 1), aim, size=(800, 600)))
        assert left > right


@pytest.mark.slow
def test_boxes_of_bands_join_to_the_whole():
    body = make_body(Shape())
    transforms = neutral_transforms(body)
    camera = camera_at((3, 1, 1.5), (0, 0, 1), size=(800, 600))
    whole = framed_by_outline(body, transforms, camera)
    edges = np.linspace(0, 1, 13)
    bands = np.array([framed_by_outline(body, transforms, camera, rows) for rows in pairwise(edges)])
    np.testing.assert_allclose(np.concatenate([bands[:, :2].min(axis=0), bands[:, 2:].max(axis=0)]), whole, atol=1e-6)
    for k, rows in enumerate(pairwise(edges)):
        if bands[k, 0] <= bands[k, 2]:
            assert rows[0] * 600 - 0.5 <= bands[k, 1] <= bands[k, 3] <= rows[1] * 600 - 0.5
            expected = framed_by_skin(between(body.skin(transforms)[body.faces]), camera, rows)
            np.testing.assert_allclose(bands[k], expected, atol=0.02 * 400)  # of the whole, about 400 pixels high


def test_an_outline_is_a_few_hundred_points_of_the_skin():
    body = somebody(1)
    outline = Outline.from_body(body)
    assert 200 < len(outline.vertices) < 900
    transforms = poses(body, 1, 1)[0]
    skin = body.skin(transforms)
    moved = outline.at(transforms)
    for point in moved[::20]:
        assert np.linalg.norm(skin - point, axis=1).min() < 1e-6
