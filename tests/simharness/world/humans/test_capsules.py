"""Distance between the skin of a body and its capsules, in both directions."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mvpose.camera import Camera
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.capsules import fit_capsules
from simharness.world.humans.clothing import dress
from simharness.world.humans.population import draw_shape
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import draw_looks

SHAPES = {
    "slight woman": Shape(gender=1.0, muscle=0.2, weight=0.2, height=0.25),
    "heavy man": Shape(gender=0.0, muscle=0.8, weight=1.0, height=0.5),
    "old and tall": Shape(gender=0.5, age=1.0, weight=0.7, height=0.6, proportions=0.9),
}


@cache
def body_of(name):
    if name in SHAPES:
        return make_body(SHAPES[name])
    i = int(name.removeprefix("dressed "))
    return dress(make_body(draw_shape(stream(3, "people", i, "shape"))), draw_looks(3, i + 1)[i])


@cache
def fitted(name):
    return fit_capsules(body_of(name))


NAMES = (*SHAPES, "dressed 0", "dressed 1", "dressed 2")


@pytest.fixture(params=NAMES)
def name(request):
    return request.param


def placed(body, capsules):
    """Return starts (c, 3), ends (c, 3) and radii (c,) of capsules in the world, the body at rest."""
    heads = np.array([body.heads[body.index(capsule.bone)] for capsule in capsules])
    starts, ends = (np.array([getattr(capsule, key) for capsule in capsules]) for key in ("start", "end"))
    return heads + starts, heads + ends, np.array([capsule.radius for capsule in capsules])


def signed_distances(points, starts, ends, radii):
    """Return the signed distances of points (n, 3) to the surface of each capsule, (n, c)."""
    axes = ends - starts
    share = np.clip(((points[:, None] - starts) * axes).sum(-1) / np.maximum((axes**2).sum(-1), 1e-12), 0, 1)
    return np.linalg.norm(points[:, None] - starts - share[..., None] * axes, axis=-1) - radii


def on_skin(body, count=20_000):
    """Draw points uniformly on the skin, (count, 3)."""
    rng = stream(1, "test", "skin")
    corners = body.vertices[body.faces].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    return (rng.dirichlet(np.ones(3), count)[:, :, None] * corners[face]).sum(1)


def is_visible(body, points):
    """Return the mask of skin points (n, 3) seen by some camera around the body: not those under a skirt or hair."""
    mesh = Mesh(vertices=body.vertices, faces=body.faces, colors=np.full((len(body.faces), 3), 0.5, np.float32))
    renderer, seen = RasterRenderer(), np.zeros(len(points), bool)
    aim = np.array([0.0, 0.0, body.stature / 2])
    for height in (-1.0, 0.5, 2.5):
        for bearing in np.arange(0, 2 * np.pi, np.pi / 4):
            camera = look_at(aim + [2.5 * np.cos(bearing), 2.5 * np.sin(bearing), height], aim)
            depth = renderer.render(camera, [mesh], color=False).depth
            column, row = np.rint(camera.project(points)).astype(int).T
            seen |= camera.depth(points) < depth[row, column] + 0.01
    return seen


def look_at(place, aim):
    z = (aim - place) / np.linalg.norm(aim - place)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    return Camera(K=[[400, 0, 250], [0, 400, 250], [0, 0, 1]], R=R, t=-R @ place, size=(501, 501), name="test")


def on_capsules(starts, ends, radii):
    """Draw points of equal density on the outer surface of the union of capsules, (n, 3)."""
    rng = stream(1, "test", "capsules")
    points = []
    for start, end, radius in zip(starts, ends, radii, strict=True):
        length = np.linalg.norm(end - start)
        count = int(2e4 * 2 * np.pi * radius * (length + 2 * radius))
        out = rng.standard_normal((count, 3))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        axis = (end - start) / length
        beside = out - (out @ axis)[:, None] * axis
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        middle = rng.random(count) < length / (length + 2 * radius)
        cap = np.where((out @ axis > 0)[:, None], end, start) + radius * out
        points.append(np.where(middle[:, None], start + rng.random((count, 1)) * (end - start) + radius * beside, cap))
    points = np.concatenate(points)
    return points[signed_distances(points, starts, ends, radii).min(axis=1) > -1e-6]


@cache
def from_the_skin(name):
    """Return the distances of visible skin points to the capsules, metres."""
    body = body_of(name)
    points = on_skin(body)
    return np.abs(signed_distances(points[is_visible(body, points)], *placed(body, fitted(name))).min(axis=1))


@cache
def from_the_capsules(name):
    """Return the distances of points on the outer surface of the capsules to the skin, metres."""
    body = body_of(name)
    return cKDTree(on_skin(body, 60_000)).query(on_capsules(*placed(body, fitted(name))))[0]


@pytest.mark.slow
@pytest.mark.parametrize("distances", [from_the_skin, from_the_capsules])
def test_skin_and_capsules_differ_little(name, distances):
    """Mean within 1 cm, 95 % within 2 cm; more for skirts and long hair, which are not shaped like capsules."""
    assert distances(name).mean() < 0.01
    assert np.quantile(distances(name), 0.95) < (0.018 if name in SHAPES else 0.035)
    assert distances(name).max() < 0.11


@pytest.mark.parametrize("distances", [from_the_skin, from_the_capsules])
def test_skin_and_capsules_of_a_crowd_differ_little(distances):
    crowd = np.concatenate([distances(name) for name in NAMES])
    assert crowd.mean() < 0.007
    assert np.quantile(crowd, 0.95) < 0.02


def test_capsules_end_at_the_crown_and_at_the_soles(name):
    body = body_of(name)
    starts, ends, radii = placed(body, fitted(name))
    ends = np.stack([starts, ends])[..., 2]
    assert (ends + radii).max() == pytest.approx(body.vertices[:, 2].max(), abs=0.015)
    assert (ends - radii).min() == pytest.approx(body.vertices[:, 2].min(), abs=0.015)


def test_the_number_of_capsules_is_limited_for_ray_casting(name):
    capsules = fitted(name)
    assert 35 <= len(capsules) <= 46
    assert min(capsule.radius for capsule in capsules) > 0.005


def test_capsules_scale_with_the_body():
    """No size in the fit is absolute: half the body gives half the capsules."""
    body = body_of("slight woman")
    half = replace(body, vertices=body.vertices * np.float32(0.5), heads=body.heads * 0.5)
    for whole, small in zip(fitted("slight woman"), fit_capsules(half), strict=True):
        assert small.bone == whole.bone
        np.testing.assert_allclose(small.start, whole.start / 2, atol=2e-4)
        np.testing.assert_allclose(small.end, whole.end / 2, atol=2e-4)
        assert small.radius == pytest.approx(whole.radius / 2, abs=2e-4)


def test_the_capsule_of_a_tube_is_that_tube():
    """The skin of the forearm is replaced by a tube; its capsule has the radius and axis of the tube."""
    body = body_of("heavy man")
    elbow, wrist = (body.heads[body.index(bone)] for bone in ("LeftForeArm", "LeftHand"))
    bones = [body.index(bone) for bone in ("LeftForeArm", "LeftForeArmTwist")]
    arm = np.isin(body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(1)], bones)
    points = body.vertices.astype(float)
    share = np.clip((points - elbow) @ (wrist - elbow) / ((wrist - elbow) @ (wrist - elbow)), 0, 1)[:, None]
    foot = elbow + share * (wrist - elbow)
    out = points - foot
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    tube = np.where(arm[:, None], foot + 0.04 * out, points)
    for capsule in fit_capsules(replace(body, vertices=tube.astype(np.float32))):
        if capsule.bone == "LeftForeArmTwist":
            assert capsule.radius == pytest.approx(0.04, abs=0.002)
            axis = (capsule.end - capsule.start) / np.linalg.norm(capsule.end - capsule.start)
            assert axis @ (wrist - elbow) / np.linalg.norm(wrist - elbow) > 0.995


def test_the_volume_of_a_capsule_is_that_of_a_cylinder_and_a_ball():
    capsule = replace(fitted("heavy man")[0], start=np.zeros(3), end=np.array([0.0, 0.3, 0.4]), radius=0.1)
    assert capsule.volume == pytest.approx(np.pi * 0.01 * 0.5 + 4 / 3 * np.pi * 0.001)
