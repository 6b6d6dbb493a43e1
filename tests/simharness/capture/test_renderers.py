"""What every renderer must get right, against closed forms; and the two against each other."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from mesh_shapes import _mesh, ball, box, chequered, crowd, disc, room, sheet, with_parts

from simharness.capture.rendering.raster import make_renderer
from simharness.capture.rendering.renderer import NEAR
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.types.lighting import Lighting
from simharness.world.rigs.layouts import build_rig, intrinsics, look_at

MILLIMETRE = 1e-3
SLANTING = Lighting(direction=(-0.8, 0.3, 0.45), key=0.8, sky=0.3, fill=0.05, tint=(1.0, 0.9, 0.75))


def camera_at(center, aim, *, size=(160, 120), fov=70.0, **changes):
    K = intrinsics(fov, size)
    K[:2, 2] += changes.pop("shift", (0.0, 0.0))
    return look_at(center, aim, K=K, size=size, **changes)


def pixel_grid(camera):
    width, height = camera.size
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)


def axis_rays(camera):
    """Rays through all pixel centres, with a length of 1 along the optical axis."""
    rays = camera.rays(pixel_grid(camera))
    return rays / (rays @ camera.R[2])[..., None]


def plane_depth(camera, point, normal):
    """Depth of a plane along the ray of every pixel, inf if it is not ahead."""
    along = axis_rays(camera) @ normal
    with np.errstate(divide="ignore"):
        depth = np.dot(np.subtract(point, camera.center), normal) / along
    return np.where(depth > 0, depth, np.inf)


VIEWS = [
    camera_at((3.0, -1.0, 2.0), (0.0, 0.3, 0.7)),
    camera_at((-2.0, 2.5, 0.4), (0.5, 0.0, 1.4), shift=(7.3, -4.6)),
    camera_at((0.3, 0.2, 2.8), (1.0, 0.1, 0.0), fov=100.0),
]


@pytest.mark.parametrize("camera", VIEWS)
def test_depth_in_a_room_is_the_analytic_distance_to_its_walls(renderer, camera):
    size = np.array([8.0, 8.0, 3.0])
    image = renderer.render(camera, [room(size)])
    low, high = np.array([-4, -4, 0.0]), np.array([4, 4, 3.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        exits = np.maximum((low - camera.center) / axis_rays(camera), (high - camera.center) / axis_rays(camera))
    expected = np.nanmin(exits, axis=-1)
    assert (image.ids == 0).all()
    np.testing.assert_allclose(image.depth, expected, atol=MILLIMETRE / 2)


@pytest.mark.parametrize("reverse", [False, True], ids=["facing", "from behind"])
def test_depth_of_a_floor_that_runs_under_and_behind_the_camera(renderer, reverse):
    camera = camera_at((0.0, 0.0, 0.3), (1.0, 0.2, 0.1), fov=110.0)
    floor = sheet([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)][:: -1 if reverse else 1])
    image = renderer.render(camera, [floor])
    expected = plane_depth(camera, (0, 0, 0), (0, 0, 1))
    hit = camera.center + expected[..., None] * axis_rays(camera)
    with np.errstate(invalid="ignore"):
        on = np.isfinite(expected) & (np.abs(hit[..., :2]) < 9).all(axis=-1) & (expected < 8)
    assert on.mean() > 0.4
    assert (image.ids[on] == 0).all()
    np.testing.assert_allclose(image.depth[on], expected[on], atol=MILLIMETRE)
    assert (image.ids[~np.isfinite(expected)] == -1).all()
    assert np.isinf(image.depth[~np.isfinite(expected)]).all()


def test_depth_of_a_sphere(renderer):
    center, radius, rings = np.array([0.2, -0.1, 1.1]), 0.6, 160
    camera = camera_at((2.5, 1.0, 1.8), (0.0, 0.0, 1.0), size=(240, 180))
    image = renderer.render(camera, [ball(center, radius, rings=rings)])
    rays, offset = axis_rays(camera), camera.center - center
    a, b, c = (rays**2).sum(-1), rays @ offset, offset @ offset - radius**2
    discriminant = b * b - a * c
    obliquity = radius * np.sqrt(a / np.maximum(discriminant, 1e-12))  # 1 / cosine of the angle of incidence
    well_inside, outside = (discriminant > 0) & (obliquity < 3), discriminant < 0
    expected = (-b - np.sqrt(np.maximum(discriminant, 0))) / a
    assert well_inside.sum() > 2000
    assert (image.ids[outside] == -1).all()
    assert (image.ids[well_inside] == 0).all()
    # Flat faces lie inside the sphere by up to their sagitta, which an oblique ray meets further on.
    sagitta = radius * (1 - np.cos(np.pi / (2 * rings)) ** 2)
    error = image.depth[well_inside] - expected[well_inside]
    assert error.min() > -MILLIMETRE / 2
    assert (error < 1.5 * sagitta * obliquity[well_inside] + MILLIMETRE / 2).all()


def test_a_dot_is_drawn_at_its_projection(renderer):
    camera = camera_at((2.0, -3.0, 1.9), (0.1, 0.0, 1.0), size=(640, 480), shift=(3.7, -2.2))
    rng = np.random.default_rng(5)
    columns, rows = np.meshgrid(np.linspace(20, 619, 16), np.linspace(20, 459, 12))
    targets = np.stack([columns, rows], axis=-1).reshape(-1, 2) + rng.uniform(-2, 2, (192, 2))
    rays = camera.rays(targets) / (camera.rays(targets) @ camera.R[2])[:, None]
    depth = rng.uniform(1.0, 6.0, len(targets))
    places = camera.center + depth[:, None] * rays
    radius = 14.2 * depth / camera.K[0, 0]  # 14.2 pixels; parallel to the image, so a disc's centre is its centroid
    image = renderer.render(camera, [disc(p, -camera.R[2], r) for p, r in zip(places, radius, strict=True)])
    centroids = np.array([np.argwhere(image.ids == k)[:, ::-1].mean(axis=0) for k in range(len(places))])
    error = centroids - camera.project(places)
    assert np.abs(error.mean(axis=0)).max() < 0.02  # no shift, which half a pixel would be
    assert np.linalg.norm(error, axis=1).max() < 0.25  # the centroid of a disc of whole pixels is inexact


def test_the_nearer_surface_is_visible_in_any_order(renderer):
    camera = camera_at((4.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    far = sheet([(-1, -2, -1), (-1, 2, -1), (-1, 2, 3), (-1, -2, 3)])
    near = box((1.0, 0.0, 1.0), (0.2, 0.8, 0.8))
    board = box((2.0, 0.0, 1.0), (0.004, 0.3, 0.3))  # as thin as cardboard
    for order in itertools.permutations(range(3)):
        meshes = [(far, near, board)[k] for k in order]
        image = renderer.render(camera, meshes)
        names = np.array([*order, -1])[image.ids]
        assert names[60, 80] == 2
        assert names[60, 80 + 12] == 1
        assert names[60, 80 + 35] == 0
        assert image.depth[60, 80] == pytest.approx(1.998, abs=MILLIMETRE)


def test_crossing_planes_swap_where_they_meet(renderer):
    camera = camera_at((5.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    one = sheet([(-1, -1, 0), (1, 1, 0), (1, 1, 2), (-1, -1, 2)])
    other = sheet([(1, -1, 0), (-1, 1, 0), (-1, 1, 2), (1, -1, 2)])
    image = renderer.render(camera, [one, other])
    left, right = image.ids[60, 62:78], image.ids[60, 82:98]
    assert set(left) == {1}  # the sheet whose near edge is at y = -1, on the left of a camera that looks along -x
    assert set(right) == {0}


def test_winding_does_not_change_visibility(renderer):
    camera = VIEWS[0]
    meshes = [ball((0.2, 0.1, 1.0), 0.5), box((-0.8, 0.5, 0.4), (0.4, 0.3, 0.8))]
    turned = [_mesh(m.vertices, m.faces[:, ::-1], (0.5, 0.5, 0.5)) for m in meshes]
    image, inside_out = renderer.render(camera, meshes), renderer.render(camera, turned)
    assert (image.ids >= 0).mean() > 0.03
    np.testing.assert_array_equal(image.ids, inside_out.ids)
    np.testing.assert_allclose(image.depth, inside_out.depth, atol=MILLIMETRE / 10)


def test_nothing_nearer_than_the_near_plane_is_drawn(renderer):
    camera = camera_at((0.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    corners = np.array([(0, -9, -9), (0, 9, -9), (0, 9, 9), (0, -9, 9)], float) + (0, 0, 1)
    lens = sheet(corners + (NEAR * 0.98, 0, 0))
    wall = sheet(corners + (NEAR * 1.02, 0, 0))
    behind = sheet(corners - (2, 0, 0))
    assert (renderer.render(camera, [lens, behind]).ids == -1).all()
    image = renderer.render(camera, [lens, wall])
    assert (image.ids == 1).all()
    np.testing.assert_allclose(image.depth, NEAR * 1.02, rtol=1e-4)


def test_a_scene_without_meshes_is_empty(renderer):
    image = renderer.render(VIEWS[0], [])
    assert image.ids.shape == (120, 160)
    assert (image.ids == -1).all()
    assert np.isposinf(image.depth).all()
    assert (image.rgb == image.rgb[0, 0]).all()


def test_depth_and_ids_are_the_same_without_colour(renderer):
    scene = crowd(12)
    full, plain = renderer.render(VIEWS[0], scene), renderer.render(VIEWS[0], scene, color=False)
    assert full.rgb.std() > 10
    assert not plain.rgb.any()
    np.testing.assert_array_equal(full.ids, plain.ids)
    np.testing.assert_array_equal(full.depth, plain.depth)


def test_a_kept_scene_is_not_mistaken_for_another(renderer):
    first, second = [ball((0, 0, 1), 0.5)], [ball((0, 0.4, 1), 0.5)]
    before = renderer.render(VIEWS[0], first)
    other = renderer.render(VIEWS[0], second)
    again = renderer.render(VIEWS[0], first)
    assert (before.ids != other.ids).any()
    np.testing.assert_array_equal(before.depth, again.depth)
    np.testing.assert_array_equal(before.rgb, again.rgb)


def test_colours_are_those_of_the_faces(renderer):
    """Light changes how bright a face is, not which of its channels is the strongest."""
    scene = [
        box((0, -1, 1), (0.5, 0.5, 0.5), (0.9, 0.1, 0.1)),
        box((0, 0, 1), (0.5, 0.5, 0.5), (0.1, 0.8, 0.1)),
        ball((0, 1, 1), 0.3, (0.1, 0.1, 0.8)),
    ]
    image = renderer.render(camera_at((4.0, 0.0, 1.5), (0.0, 0.0, 1.0)), scene)
    for k in range(3):
        seen = image.rgb[image.ids == k].astype(int)
        assert len(seen) > 50
        assert (seen.argmax(axis=1) == k).all()


def test_gl_refuses_more_meshes_than_ids(gl):
    with pytest.raises(ValueError, match="distinguishes at most 254 meshes, got 255"):
        gl.render(VIEWS[0], [ball((0, 0, 1), 0.1, rings=3)] * 255)


def test_gl_distinguishes_254_meshes(gl):
    camera = camera_at((8.0, 0.0, 0.0), (0.0, 0.0, 0.0), size=(320, 320), fov=60.0)
    grid = [(0.0, 0.5 * (k % 16 - 7.5), 0.5 * (k // 16 - 7.5)) for k in range(254)]
    image = gl.render(camera, [disc(place, (1, 0, 0), 0.2) for place in grid])
    for k, place in enumerate(grid):
        column, row = np.round(camera.project(place)).astype(int)
        assert image.ids[row, column] == k


def test_unknown_renderer_is_named():
    with pytest.raises(ValueError, match="'raster', 'gl' or 'auto', got 'vulkan'"):
        make_renderer("vulkan")


def assert_agree(one, other, *, share=1e-4):
    """Compare ids for equality and depth within 1 mm, on all except ``share`` of the pixels."""
    assert (one.ids != other.ids).mean() <= share
    with np.errstate(invalid="ignore"):
        apart = np.abs(one.depth - other.depth)
    apart[np.isinf(one.depth) & np.isinf(other.depth)] = 0
    assert (~(apart <= MILLIMETRE)).mean() <= share
    assert np.median(apart) < 0.1 * MILLIMETRE


@pytest.mark.slow
def test_the_renderers_agree_on_a_crowd(raster, gl):
    scene = crowd(32)
    seen = set()
    for camera in build_rig(CamerasSection(count=3, radius=3.4, height=2.2, size=(640, 480))):
        one, other = raster.render(camera, scene), gl.render(camera, scene)
        assert_agree(one, other)
        seen |= set(np.unique(one.ids))
    assert seen >= set(range(len(scene)))


@pytest.mark.slow
def test_the_renderers_agree_on_people_of_a_scenario(raster, gl):
    from simharness.capture.joint_visibility import label_joints
    from simharness.capture.picture import meshes_at
    from simharness.scenario.sections.people_section import PeopleSection
    from simharness.scenario.sections.room_section import ClutterSection
    from simharness.scenario.sections.scenario import Scenario
    from simharness.world.scene.build import build
    from simharness.world.scene.playback import Playback

    scenario = Scenario(
        name="agree",
        duration=0.1,
        people=PeopleSection(count=3, activities=("walk", "wave", "point"), spacing=0.6),
        clutter=ClutterSection(boxes=2, shelves=1),
        cameras=CamerasSection(count=2, size=(800, 600)),
    )
    rig = build_rig(scenario.cameras)
    scene = build(scenario, rig)
    playback = Playback(scene)
    radii = np.stack([body.joint_radii for body in scene.bodies])
    same, joints = 0, 0
    for time in (0.0, 0.05):
        state = playback.at(time)
        meshes = meshes_at(scene, state)
        for camera in rig:
            one, other = raster.render(camera, meshes), gl.render(camera, meshes)
            assert set(range(3)) <= set(np.unique(one.ids))
            assert_agree(one, other)
            labels = [label_joints(image, camera, joints=state.joints, radii=radii) for image in (one, other)]
            same, joints = same + (labels[0] == labels[1]).sum(), joints + labels[0].size
    assert same >= 0.999 * joints


@pytest.mark.slow
@pytest.mark.parametrize("lighting", [Lighting(), SLANTING], ids=["day", "slanting"])
def test_the_renderers_agree_on_colours(raster, gl, lighting):
    scene = crowd(24)
    board = chequered((2.0, 2.0))
    scene[4:4] = [board.moved(board.vertices + np.float32([-1.5, 1.5, 0.3]))]
    for camera in build_rig(CamerasSection(count=2, radius=3.4, height=2.2, size=(640, 480))):
        one, other = (each.render(camera, scene, lighting=lighting).rgb.astype(int) for each in (raster, gl))
        apart = np.abs(one - other).max(axis=-1)
        assert (apart <= 2).mean() > 0.995  # the levels of detail of the board change a few pixels apart
        assert apart.mean() < 0.1


def test_parts_are_the_labels_of_the_faces(renderer):
    """Quarters of a board, seen from the front: each pixel has the label of the quarter that it shows."""
    corners = np.array([(1, y, z) for z in (0, 1, 2) for y in (1, 0, -1)], float)
    quads = [(3 * r + c, 3 * r + c + 1, 3 * r + c + 4, 3 * r + c + 3) for r in range(2) for c in range(2)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    board = with_parts(_mesh(corners, faces, (0.5, 0.5, 0.5)), np.repeat([0, 7, 126, -1], 2))
    plain = box((2, 0, 1), (0.1, 0.1, 0.1))
    camera = camera_at((-1.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    for color in (True, False):
        image = renderer.render(camera, [board, plain], color=color, parts=True)
        assert image.parts.dtype == np.int8
        y, z = np.moveaxis((camera.center + image.depth[..., None] * axis_rays(camera))[..., 1:], -1, 0)
        seen = image.ids == 0
        assert seen.mean() > 0.1
        wanted = np.array([[0, 7], [126, -1]])[(z > 1).astype(int), (y < 0).astype(int)]
        np.testing.assert_array_equal(image.parts[seen], wanted[seen])
        assert (image.parts[~seen] == -1).all()
    assert renderer.render(camera, [board]).parts is None


def test_a_texture_is_drawn_at_its_coordinates(renderer):
    """Colour at every pixel of a board compared with the texel at its coordinates, v down, repeating."""
    board = chequered((1.5, 1.0), repeat=(3, 2))
    camera = camera_at((-1.7, 0.4, 0.8), (0.0, 0.0, 0.4), size=(320, 240))
    flat = Lighting(key=0.0, sky=0.0, fill=0.0, background=(0, 0, 0))
    ambient = replace(flat, sky=1 / 0.65)  # on a vertical board: light of 1, so albedo as it is
    image = renderer.render(camera, [board], lighting=ambient)
    place = camera.center + image.depth[..., None] * axis_rays(camera)
    u, v = 3 * (0.75 - place[..., 1]) / 1.5, 2 * (1.0 - place[..., 2]) / 1.0
    height, width = board.texture.shape[:2]
    with np.errstate(invalid="ignore"):
        column, row = (u % 1) * width, (v % 1) * height
        inner = (image.ids == 0) & (np.abs(column % 8 - 4) < 3) & (np.abs(row % 8 - 4) < 3)  # not at a border of fields
    assert inner.sum() > 3000
    wanted = board.texture[row[inner].astype(int), column[inner].astype(int)]
    assert np.abs(image.rgb[inner].astype(int) - wanted).max() <= 2
    dark = renderer.render(camera, [board], lighting=flat)
    assert not dark.rgb.any()


def test_a_texture_far_away_is_its_mean(renderer):
    """If a whole texture falls into one pixel, no pattern and no aliasing is left."""
    board = chequered((4.0, 4.0), repeat=(64, 64))
    camera = camera_at((-9.0, 0.0, 2.0), (0.0, 0.0, 2.0), size=(160, 120))
    image = renderer.render(camera, [board], lighting=Lighting(key=0, sky=1 / 0.65, fill=0))
    seen = image.rgb[image.ids == 0].astype(float)
    assert len(seen) > 800
    np.testing.assert_allclose(seen.mean(axis=0), board.texture.mean(axis=(0, 1)), atol=3)
    assert seen.std(axis=0).max() < 6 < board.texture.std(axis=(0, 1)).min()


def test_texture_multiplies_the_colour_of_the_face(renderer):
    white, red = chequered((1, 1)), chequered((1, 1), color=(1.0, 0.5, 0.25))
    camera = camera_at((-1.5, 0.0, 0.5), (0.0, 0.0, 0.5))
    one, other = (renderer.render(camera, [board]).rgb.astype(float) for board in (white, red))
    seen = renderer.render(camera, [white]).ids == 0
    np.testing.assert_allclose(other[seen], one[seen] * [1.0, 0.5, 0.25], atol=1.1)


def test_light_follows_the_shading_rule(renderer):
    """A board under each kind of light alone, compared with closed forms."""
    board = sheet([(0, -1, 0), (0, 1, 0), (0, 1, 2), (0, -1, 2)], (1.0, 0.8, 0.6))
    camera = camera_at((3.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    middle = np.s_[60, 80]
    for lighting, light in [
        (Lighting(key=0, sky=0.5, fill=0), 0.5 * 0.65),
        (Lighting(key=0, sky=0, fill=0.4), 0.4),
        (Lighting(direction=(3, 0, 4), key=0.9, sky=0, fill=0), 0.9 * 0.6),
        (Lighting(direction=(-3, 0, 4), key=0.9, sky=0, fill=0), 0.0),
        (Lighting(direction=(3, 0, 4), key=0.9, sky=0.2, fill=0.1), 0.9 * 0.6 + 0.2 * 0.65 + 0.1),
        (Lighting(key=0, sky=0, fill=0.4, tint=(1.0, 0.5, 0.25)), 0.4 * np.array([1.0, 0.5, 0.25])),
    ]:
        wanted = 255 * np.array([1.0, 0.8, 0.6]) * np.sqrt(light)
        np.testing.assert_allclose(renderer.render(camera, [board], lighting=lighting).rgb[middle], wanted, atol=1.01)


def test_lighting_changes_only_colours(renderer):
    scene = crowd(12)
    one, other = renderer.render(VIEWS[0], scene), renderer.render(VIEWS[0], scene, lighting=SLANTING)
    np.testing.assert_array_equal(one.ids, other.ids)
    np.testing.assert_array_equal(one.depth, other.depth)
    assert np.abs(one.rgb.astype(int) - other.rgb).mean() > 5
    np.testing.assert_array_equal(renderer.render(VIEWS[0], scene).rgb, one.rgb)  # and back


@pytest.mark.parametrize("azimuth", [0.0, 2.0, 4.5])
def test_a_shadow_lies_where_the_light_casts_it(renderer, azimuth):
    lighting = Lighting(direction=(np.cos(azimuth), np.sin(azimuth), 1.2))
    floor = sheet([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], (0.8, 0.8, 0.8))
    bird = box((0.2, -0.1, 1.0), (0.5, 0.5, 0.02))
    camera = camera_at((0.05, 0.0, 7.0), (0.0, 0.0, 0.0), size=(240, 240), fov=60.0)
    bare, image = (renderer.render(camera, meshes, lighting=lighting) for meshes in ([floor], [floor, bird]))
    darker = (bare.rgb.astype(int) - image.rgb).max(axis=-1) > 20
    place = camera.center + image.depth[..., None] * axis_rays(camera)
    to_light = np.array(lighting.direction)
    above = (place + (1.0 / to_light[2]) * to_light)[..., :2] - [0.2, -0.1]
    off = 0.25 - np.abs(above).max(axis=-1)  # metres inside the edge of the shadow
    on_floor = image.ids == 0
    assert darker[on_floor & (off > 0.06)].all()
    assert not darker[on_floor & (off < -0.06)].any()
    assert (on_floor & (off > 0.06)).sum() > 50


def test_moved_meshes_are_drawn_at_their_positions(renderer):
    scene = crowd(8)
    renderer.render(VIEWS[0], scene)
    shift = np.float32([0.1, -0.2, 0.05])
    moved = [mesh.moved(mesh.vertices + shift) for mesh in scene]
    fresh = [replace(mesh, vertices=mesh.vertices + shift, faces=mesh.faces.copy()) for mesh in scene]
    one, other = renderer.render(VIEWS[0], moved), renderer.render(VIEWS[0], fresh)
    for key in ("rgb", "depth", "ids"):
        np.testing.assert_array_equal(getattr(one, key), getattr(other, key))
    assert (one.ids != renderer.render(VIEWS[0], scene).ids).any()


@pytest.mark.parametrize("field", ["colors", "smooth", "parts", "texture", "uv"])
def test_changed_arrays_of_a_mesh_are_not_reused(renderer, field):
    """One array of a mesh changes and all others are the same objects."""
    mesh = with_parts(chequered((2.0, 1.6)), [1, 2])
    camera = camera_at((-2.0, 0.3, 0.9), (0.0, 0.0, 0.8))
    changed = {
        "colors": mesh.colors * np.float32(0.5),
        "smooth": True,
        "parts": mesh.parts[::-1].copy(),
        "texture": 255 - mesh.texture,
        "uv": mesh.uv * np.float32(2),
    }
    other = replace(mesh, **{field: changed[field]})
    fresh = replace(other, faces=mesh.faces.copy())
    renderer.render(camera, [fresh], parts=True)
    wanted = renderer.render(camera, [fresh], parts=True)
    before = renderer.render(camera, [mesh], parts=True)
    image = renderer.render(camera, [other], parts=True)
    np.testing.assert_array_equal(image.rgb, wanted.rgb)
    np.testing.assert_array_equal(image.parts, wanted.parts)
    if field != "smooth":  # a flat board has the same normals either way
        assert (image.rgb != before.rgb).any() or (image.parts != before.parts).any()
