import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walkers import Rays

from simharness.types.mirror import Mirror
from simharness.types.random_streams import stream
from simharness.world.motion.motion import Trajectory
from simharness.world.scene.objects.geoms import Box, Surface, carried
from simharness.world.scene.objects.shapes import TOP, bar_mesh, box_mesh, box_model, joined, lathe
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.placement.sight_lines import intersects

numbers = st.floats(-3, 3)


def signed_volume(mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@given(x=numbers, y=numbers, yaw=st.floats(-7, 7))
def test_a_box_mesh_is_closed_with_outward_faces(x, y, yaw):
    box = Box((x, y, 0.5), (0.3, 0.2, 0.5), yaw)
    mesh = box_mesh([box], np.full((1, 3), 0.5))
    assert signed_volume(mesh) == pytest.approx(8 * 0.3 * 0.2 * 0.5, rel=1e-3)
    normals = np.cross(*(mesh.vertices[mesh.faces][:, k] - mesh.vertices[mesh.faces][:, 0] for k in (1, 2)))
    outward = mesh.vertices[mesh.faces].mean(axis=1) - box.center
    assert (np.einsum("ij,ij->i", normals, outward) > 0).all()


def test_sides_have_their_names():
    mesh = box_mesh([Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))], np.eye(6, 3)[None] * 0.5 + 0.1)
    colors = 0.5 * np.eye(6, 3) + 0.1
    for side, (axis, sign) in enumerate([(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)]):
        of_side = np.isclose(mesh.vertices[mesh.faces][..., axis], sign).all(axis=1)
        assert of_side.sum() == 2
        np.testing.assert_allclose(mesh.colors[of_side], np.tile(colors[side], (2, 1)), atol=1e-6)
    assert TOP == 5


@given(sides=st.integers(3, 40), squash=st.floats(0.3, 2.0))
def test_a_lathe_gives_prisms(sides, squash):
    """The volume of a prism is the area of its polygon times its height, for profiles with and without edges."""
    profile = [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.25, 1.0), (0.25, 2.0), (0.0, 2.0)]
    mesh = lathe(profile, (0.5, 0.5, 0.5), sides=sides, squash=squash)
    polygon = sides / 2 * np.sin(2 * np.pi / sides) * squash
    assert signed_volume(mesh) == pytest.approx(polygon * (0.5**2 + 0.25**2), rel=1e-3)
    edges = np.sort(mesh.vertices[mesh.faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3).round(4), axis=1)
    _, count = np.unique(edges.reshape(-1, 6), axis=0, return_counts=True)
    assert (count == 2).all()  # watertight


def test_meshes_from_corners_and_joined_meshes():
    box = Box((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7)
    both = joined(box_mesh([box], np.ones((1, 3))), box_mesh([box.moved((5, 0), 0.0)], [(0.2, 0.4, 0.6)]))
    assert signed_volume(both) == pytest.approx(2 * 0.96, rel=1e-4)
    np.testing.assert_allclose(both.colors[-1], (0.2, 0.4, 0.6))


@given(tilt=st.floats(0.1, 3.0), way=st.floats(-3, 3))
def test_a_bar_has_its_ends_and_its_radius(tilt, way):
    axis = np.array([np.sin(tilt) * np.cos(way), np.sin(tilt) * np.sin(way), np.cos(tilt)])
    middle = np.array([0.3, -0.2, 1.0])
    mesh = bar_mesh(middle - 0.6 * axis, middle + 0.6 * axis, 0.2, (0.5, 0.5, 0.5), sides=48)
    assert signed_volume(mesh) == pytest.approx(np.pi * 0.2**2 * 1.2, rel=0.01)
    vertices = mesh.vertices - middle
    along = vertices @ axis
    assert np.abs(along).max() == pytest.approx(0.6, abs=1e-4)
    assert np.linalg.norm(vertices - along[:, None] * axis, axis=1).max() == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize("end", [(0.4, 0.0, 0.9), (0.5, 0.6, 0.3), (0.0, -0.7, 0.3), (0.1, 0.1, 1.2)])
def test_rays_hit_a_tilted_bar_at_its_mesh(end):
    mesh = bar_mesh((0, 0, 0.3), end, 0.08, (0.5,) * 3, sides=48)
    geom = Surface(mesh.vertices.astype(float), mesh.faces)
    solid = ObjectModel(mesh, (geom,)).at((1, 2), 0.7, kind="prop", name="bar")
    rng, middle = np.random.default_rng(0), np.array(solid.hull.center)
    start = middle + [2.0, -1.5, 1.0]
    ends = start + 2 * (middle + rng.uniform(-1, 1, (500, 3)) * solid.hull.half - start)
    seen = intersects(solid.mesh, np.tile(start, (500, 1)), ends)
    met = np.isfinite(Rays([solid]).distance(start, ends))
    assert seen.sum() > 30
    assert (seen != met).sum() <= 5


def test_distances_computed_by_hand():
    box = Box((1.0, 0.0, 0.5), (0.5, 0.25, 0.5), np.pi / 2)  # turned: 0.25 along x, 0.5 along y
    points = [[1.0, 0.0, 0.5], [2.25, 0.0, 0.5], [1.0, 0.9, 0.2], [1.0, 0.0, 1.7], [1.25 + 0.3, 0.5 + 0.4, 0.5]]
    np.testing.assert_allclose(box.distance(points), [0, 1.0, 0.4, 0.7, 0.5], atol=1e-12)
    np.testing.assert_allclose(box.distance_on_floor(points), [0, 1.0, 0.4, 0.0, 0.5], atol=1e-12)


@given(x=numbers, y=numbers, first=st.floats(0, 6), second=st.floats(0, 6))
def test_gap_never_exceeds_the_true_distance(x, y, first, second):
    one, two = Box((0.0, 0.0, 0.5), (0.5, 0.3, 0.5), first), Box((x, y, 0.5), (0.2, 0.4, 0.5), second)
    unit = stream(0, "inside").uniform(-1, 1, (4000, 3))
    inside = np.array(two.center) + (unit * two.half) @ two.axes.T
    nearest = one.distance_on_floor(inside).min()
    gap = one.gap_on_floor(two)
    assert gap == pytest.approx(two.gap_on_floor(one))
    assert gap <= nearest + 1e-9
    apart = [
        max((a.corners @ axis).min() - (b.corners @ axis).max() for a, b in ((one, two), (two, one)))
        for axis in (*one.axes.T[:2], *two.axes.T[:2])
    ]
    assert gap == pytest.approx(max(0.0, *apart), abs=1e-9)  # the separating axes, corner by corner


def test_moved_rotates_about_the_vertical_and_translates():
    box = Box((1.0, 0.0, 0.5), (0.5, 0.25, 0.5), 0.1).moved([2.0, 3.0], np.pi / 2)
    np.testing.assert_allclose(box.center, (2.0, 4.0, 0.5), atol=1e-12)
    assert box.yaw == pytest.approx(0.1 + np.pi / 2)
    np.testing.assert_allclose(
        Surface(np.array([[1.0, 0, 0.5]]), np.zeros((0, 3), np.int32)).moved([2.0, 3.0], np.pi / 2).vertices,
        [[2, 4, 0.5]],
    )


def assembly(**decoy):
    box, bar = Box((0, 0, 0.1), (0.3, 0.2, 0.1)), bar_mesh((0, 0.05, 0.2), (0, 0.05, 1.0), 0.05, (0.5, 0.5, 0.5))
    cone = lathe([(0, 1.0), (0.2, 1.1), (0, 1.3)], (0.5, 0.5, 0.5))
    surfaces = (Surface(mesh.vertices.astype(float), mesh.faces) for mesh in (bar, cone))
    return ObjectModel(joined(box_mesh([box], [(0.5, 0.5, 0.5)]), bar, cone), (box, *surfaces), **decoy)


@given(x=numbers, y=numbers, yaw=st.floats(-7, 7))
def test_all_parts_of_a_model_are_placed(x, y, yaw):
    figure, glass = np.full((17, 3), 0.7), Mirror((0.3, 0.1, 0.5), (1.0, 0.0, 0.0), (0.2, 0.4))
    loose = assembly(figure=figure, mirror=glass)
    placed = loose.at((x, y), yaw, kind="decoy", name="it")
    expected = carried(loose.mesh.vertices, (x, y), yaw)
    np.testing.assert_allclose(placed.mesh.vertices, expected, atol=1e-5)
    np.testing.assert_allclose(placed.figure, carried(figure, (x, y), yaw))
    np.testing.assert_allclose(placed.mirror.center, carried(glass.center, (x, y), yaw))
    np.testing.assert_allclose(placed.mirror.normal, carried(glass.normal, (0, 0), yaw), atol=1e-12)
    assert placed.hull.distance(expected).max() < 1e-5
    np.testing.assert_allclose(placed.hull.half, loose.extent.half)
    assert placed.hull_at(3.0) == placed.hull


def test_names_of_geoms():
    spec = mujoco.MjSpec()
    slab = box_model([Box((0, 0, 0.5), (0.5, 0.5, 0.5))], [(0.5, 0.5, 0.5)])
    single = slab.at((3, 0), 0.0, kind="room", name="floor")
    several = assembly().at((0, 0), 0.0, kind="clutter", name="box0")
    moving = assembly().along(Trajectory(np.zeros(1), np.eye(7)[[3]]), kind="prop", name="cart0")
    for solid in (single, several, moving):
        solid.add_to(spec)
    model = spec.compile()
    names = {model.geom(k).name for k in range(model.ngeom)}
    assert names == {"floor", *(f"{name} {k}" for name in ("box0", "cart0") for k in range(3))}
    assert model.body("cart0").mocapid[0] == 0
    assert model.geom("box0 1").bodyid[0] == 0


def test_a_moving_solid_follows_its_trajectory():
    """Rays hit it at its pose, and its hulls contain it, rotated, tilted and lifted."""
    time = np.linspace(0, 2, 21)
    turn, tilt = 2.0 * time, 0.4 * np.sin(3 * time)
    zero = np.zeros(21)
    yawed = np.column_stack([np.cos(turn / 2), zero, zero, np.sin(turn / 2)])
    tilted = np.column_stack([np.cos(tilt / 2), np.sin(tilt / 2), zero, zero])
    quat = np.empty((21, 4))
    for k in range(21):
        mujoco.mju_mulQuat(quat[k], yawed[k], tilted[k])
    pose = np.column_stack([time, -0.5 * time, 0.3 * time, quat])
    solid = assembly().along(Trajectory(time, pose), kind="prop", name="it")
    rays = Rays([solid])
    for moment in (0.0, 0.7, 1.9):
        rays.put(moment)
        vertices = np.empty_like(solid.mesh.vertices, float)
        where = solid.trajectory.at(moment)
        for k, vertex in enumerate(solid.mesh.vertices.astype(float)):
            mujoco.mju_rotVecQuat(vertices[k], vertex, where[3:])
        vertices += where[:3]
        assert solid.hull_at(moment).distance(vertices).max() < 1e-5
        assert solid.hull.distance(vertices).max() < 0.02  # over the whole trajectory, at its samples
        middle = vertices.mean(axis=0)
        assert np.isfinite(rays.distance(middle + [0, 0, 3], np.array([middle - [0, 0, 1]]))).all()
