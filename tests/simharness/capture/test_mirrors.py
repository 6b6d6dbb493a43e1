from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_shapes import ball, box, room

from mvpose import Camera
from simharness.capture.picture import reflected, with_mirrors
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.lighting import Lighting
from simharness.types.mesh import Finish, Mesh
from simharness.types.mirror import Mirror

angles = st.floats(-3.1, 3.1)
GLASS = Mirror((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.6, 0.9))


def camera(center, aim, size=(160, 120), focal=120.0) -> Camera:
    center, ahead = np.array(center, float), np.array(aim, float) - center
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(ahead, right), ahead])
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    return Camera(K=K, R=R, t=-R @ center, size=size)


def pane(mirror: Mirror) -> Mesh:
    """The glass as one sheet."""
    across = np.cross([0, 0, 1.0], mirror.normal) * mirror.half[0]
    up = np.array([0, 0, mirror.half[1]])
    corners = np.array(mirror.center) + [-across - up, across - up, across + up, -across + up]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners.astype(np.float32), faces.astype(np.int32), np.full((2, 3), 0.5, np.float32))


@given(yaw=angles, seed=st.integers(0, 99))
def test_reflection_keeps_distances_and_undoes_itself(yaw, seed):
    mirror = GLASS.moved((0.5, -1.0), yaw)
    points = np.random.default_rng(seed).uniform(-3, 3, (20, 3))
    behind = mirror.reflect(points)
    np.testing.assert_allclose(mirror.reflect(behind), points, atol=1e-12)
    np.testing.assert_allclose(mirror.in_front(behind), -mirror.in_front(points), atol=1e-12)
    np.testing.assert_allclose(np.diff(behind, axis=0) ** 2 @ np.ones(3), np.diff(points, axis=0) ** 2 @ np.ones(3))
    np.testing.assert_allclose(behind[:, 2], points[:, 2])


@given(yaw=angles, seed=st.integers(0, 99))
def test_light_takes_the_shortest_path_by_the_glass(yaw, seed):
    """Fermat: if the mirror shows a point, the path by the glass is as long as the line to its image."""
    mirror = GLASS.moved((0.5, -1.0), yaw)
    rng = np.random.default_rng(seed)
    eye, points = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, (30, 3))
    shown = mirror.shows(eye, points)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), axis=-1).reshape(-1, 2) * mirror.half
    on = np.array(mirror.center) + grid[:, :1] * np.cross([0, 0, 1], mirror.normal) + grid[:, 1:] * [0, 0, 1]
    for point, seen in zip(points, shown, strict=True):
        if mirror.in_front(eye) <= 0.05 or mirror.in_front(point) <= 0.05:
            assert not seen or mirror.in_front(eye) > 0
            continue
        ways = np.linalg.norm(on - eye, axis=1) + np.linalg.norm(on - point, axis=1)
        straight = np.linalg.norm(mirror.reflect(point) - eye)
        assert ways.min() >= straight - 1e-9
        if seen:
            assert ways.min() <= straight + 0.02
    assert not mirror.shows(mirror.reflect(eye), points)[mirror.in_front(points) * mirror.in_front(eye) > 0].any()


def test_a_mirror_shows_the_picture_of_the_reflected_camera():
    """The picture in the glass is that of the reflected camera, flipped horizontally."""
    ground, thing = room(), ball((1.5, 0.4, 1.1), 0.35, (0.9, 0.1, 0.1))
    eye = camera((2.5, -0.8, 1.3), (0, 0, 1.0))
    meshes, renderer = [thing, pane(GLASS), ground], RasterRenderer()
    options = {"lighting": Lighting(key=0.0, sky=0.9, fill=0.0)}  # light without shadows, the same from all sides
    image = renderer.render(eye, meshes, **options)
    got = with_mirrors(renderer, eye, meshes, {1: GLASS}, image, **options)
    glass = image.ids == 1
    assert 500 < glass.sum() < 0.7 * glass.size
    np.testing.assert_array_equal(got[~glass], image.rgb[~glass])

    row, column = np.nonzero(glass)
    ways = eye.rays(np.column_stack([column, row]))
    meets = eye.center + ways * ((-GLASS.in_front(eye.center)) / (ways @ np.array(GLASS.normal)))[:, None]
    on = ways - 2 * (ways @ np.array(GLASS.normal))[:, None] * np.array(GLASS.normal)
    center = np.array([1.5, 0.4, 1.1])
    along = ((center - meets) * on).sum(axis=1)
    miss = np.linalg.norm(meets + along[:, None] * on - center, axis=1)
    red = got[row, column, 0] > 2.0 * got[row, column, 1]
    assert red[miss < 0.32].all()  # the sphere is flat-sided
    assert not red[miss > 0.36].any()
    assert red.sum() > 60


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_the_glass_shows_nothing_behind_it():
    """A wall close behind, and a box across the plane beside the glass: both are clipped at the plane."""
    wall = box((-0.4, 0.0, 1.0), (0.2, 6.0, 3.0), color=(0.1, 0.9, 0.1))
    across = box((0.0, 1.5, 1.0), (1.0, 0.5, 1.0), color=(0.1, 0.1, 0.9))
    eye = camera((2.0, 0.0, 1.2), (0, 0, 1.0))
    meshes, renderer = [wall, across, pane(GLASS)], RasterRenderer()
    image = renderer.render(eye, meshes)
    got = with_mirrors(renderer, eye, meshes, {2: GLASS}, image)
    glass = got[image.ids == 2].astype(int)
    assert not (glass[:, 1] > 1.5 * glass[:, 0]).any()  # no green
    cut = reflected(across, GLASS)
    assert cut.vertices[cut.faces][..., 0].max() <= 1e-6
    assert area(cut) == pytest.approx(area(across) / 2, rel=1e-5)  # half the sides and one of two ends
    assert len(reflected(wall, GLASS).faces) == 0


def test_reflected_meshes_keep_colours_textures_and_labels():
    """The orientation of faces is kept, and textures and labels stay with their faces."""
    thing = ball((0.1, 0.0, 1.0), 0.5, (0.5, 0.5, 0.5))
    k = len(thing.faces)
    uv = np.random.default_rng(0).uniform(size=(k, 3, 2)).astype(np.float32)
    marked = replace(thing, texture=np.full((2, 2, 3), 200, np.uint8), uv=uv, parts=(np.arange(k) % 7).astype(np.int8))
    cut = reflected(marked, GLASS)
    corners = cut.vertices[cut.faces].astype(float)
    outward = corners.mean(axis=1) - GLASS.reflect((0.1, 0.0, 1.0))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = np.linalg.norm(normal, axis=1) > 1e-9
    assert ((normal * outward).sum(axis=1)[solid] > 0).all()
    assert cut.uv.shape == (len(cut.faces), 3, 2)
    back = GLASS.reflect(corners)  # a corner that existed before keeps its texture coordinates
    for n in range(0, len(cut.faces), 7):
        for corner, place in zip(back[n], cut.uv[n], strict=True):
            same = (np.abs(thing.vertices[thing.faces] - corner).max(axis=2) < 1e-6).nonzero()
            if len(same[0]):
                assert np.abs(uv[same] - place).max(axis=1).min() < 1e-5
    whole = reflected(replace(marked, vertices=marked.vertices + np.float32([2, 0, 0])), GLASS)
    np.testing.assert_array_equal(whole.parts, marked.parts)
    np.testing.assert_array_equal(whole.uv[:, ::-1], marked.uv)


def test_a_body_across_the_plane_of_the_glass_keeps_its_materials_and_grain():
    thing = ball((0.1, 0.0, 1.0), 0.5, (0.5, 0.5, 0.5))
    n, k = len(thing.vertices), len(thing.faces)
    toward = np.where(np.arange(n) % 2, np.arange(n), (np.arange(n) + 1) % n)  # every second one has a grain
    values = [np.linspace(0, 1, n)] * 3
    finish = Finish((np.arange(k) % 7).astype(np.int8), toward, *values)
    cut = reflected(replace(thing, finish=finish), GLASS)
    assert len(cut.faces)
    assert len(cut.vertices) > n
    labels = reflected(replace(thing, parts=finish.materials), GLASS).parts
    np.testing.assert_array_equal(cut.finish.materials, labels)
    np.testing.assert_array_equal(cut.finish.toward[:n], toward)
    new = np.arange(n, len(cut.vertices))
    itself = cut.finish.toward[new] == new
    assert 0 < itself.mean() < 1
    assert (cut.finish.toward[new][~itself] < n).all()


def test_from_behind_a_mirror_is_a_board():
    eye = camera((-2.0, 0.0, 1.2), (0, 0, 1.0))
    meshes, renderer = [pane(GLASS), room()], RasterRenderer()
    image = renderer.render(eye, meshes)
    assert with_mirrors(renderer, eye, meshes, {0: GLASS}, image) is image.rgb


def test_a_frame_in_front_of_the_glass_does_not_reflect():
    frame = box((0.02, 0.0, 1.0), (0.04, 0.2, 2.0), color=(0.9, 0.2, 0.2))
    glass = pane(GLASS)
    both = Mesh(
        np.concatenate([glass.vertices, frame.vertices]),
        np.concatenate([glass.faces, frame.faces + 4]),
        np.concatenate([glass.colors, frame.colors]),
    )
    eye = camera((2.0, 0.3, 1.2), (0, 0, 1.0))
    renderer = RasterRenderer()
    image = renderer.render(eye, [both, room()])
    got = with_mirrors(renderer, eye, [both, room()], {0: GLASS}, image)
    points = np.stack(np.meshgrid([0.04], np.linspace(-0.08, 0.08, 5), np.linspace(0.3, 1.7, 5)), axis=-1).reshape(
        -1, 3
    )
    column, row = np.round(eye.project(points)).astype(int).T
    np.testing.assert_array_equal(got[row, column], image.rgb[row, column])
    assert (got != image.rgb).any()
