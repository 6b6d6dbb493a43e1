import numpy as np
import pytest
from walkers import Rays

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import Lighting
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.rooms.lamps import area_lights, has_ceiling, make_ceiling, shown_lamps
from simharness.world.scene.rooms.openings import draw_openings
from simharness.world.scene.rooms.room_lighting import LIGHTS, MOODS, room_lighting
from simharness.world.scene.rooms.shell import make_room
from simharness.world.scene.rooms.tiled_textures import FLOORS, WALLS, finish

SIZE = (6.0, 8.0, 3.0)
ROOM = RoomSection(size=SIZE)


@pytest.fixture(scope="module")
def room():
    return {solid.name: solid for solid in make_room(ROOM, 0)}


def normals_and_areas(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    return cross / area[:, None], area / 2


@pytest.mark.parametrize(
    ("name", "normal", "area"),
    [
        ("floor", (0, 0, 1), 48),
        ("wall +x", (-1, 0, 0), 24),
        ("wall -x", (1, 0, 0), 24),
        ("wall +y", (0, -1, 0), 18),
        ("wall -y", (0, 1, 0), 18),
    ],
)
def test_every_face_looks_into_the_room_and_they_cover_it(room, name, normal, area):
    normals, areas = normals_and_areas(room[name].mesh)
    np.testing.assert_allclose(normals, np.tile(normal, (len(normals), 1)), atol=1e-6)
    assert areas.sum() == pytest.approx(area, rel=1e-5)


def test_the_room_has_its_size_and_its_solids_lie_outside(room):
    assert set(room) == {"floor", "wall +x", "wall -x", "wall +y", "wall -y"}  # no ceiling
    vertices = np.concatenate([solid.mesh.vertices for solid in room.values()])
    np.testing.assert_allclose(vertices.min(axis=0), [-3, -4, 0], atol=1e-5)
    np.testing.assert_allclose(vertices.max(axis=0), [3, 4, 3], atol=1e-5)
    inside = np.random.default_rng(0).uniform([-3, -4, 0], [3, 4, 3], (2000, 3)) * 0.999 + [0, 0, 0.001]
    for solid in room.values():
        assert solid.kind == "room"
        assert all(box.distance(inside).min() > 0 for box in solid.geoms)
    assert sum(len(solid.mesh.faces) for solid in room.values()) < 3000


def test_rays_from_inside_hit_the_visible_surfaces(room):
    rays = Rays(list(room.values()))
    start, ways = np.array([0.5, -0.4, 1.2]), np.random.default_rng(0).normal(size=(300, 3))
    ways[:, 2] = -np.abs(ways[:, 2]) * 0.3
    ways *= 20 / np.linalg.norm(ways, axis=1, keepdims=True)
    where = start + rays.distance(start, start + ways)[:, None] * ways
    edge = np.stack([3 - np.abs(where[:, 0]), 4 - np.abs(where[:, 1]), np.abs(where[:, 2])])
    np.testing.assert_allclose(np.abs(edge).min(axis=0), 0, atol=1e-6)


def test_textures_have_their_given_size(room):
    """A metre of floor or wall is the same share of the texture everywhere; textures of walls start at the floor."""
    for name, solid in room.items():
        mesh = solid.mesh
        a, b = mesh.vertices[mesh.faces][:, 0], mesh.vertices[mesh.faces][:, 2]
        ua, ub = mesh.uv[:, 0], mesh.uv[:, 2]
        grain = np.linalg.norm((ub - ua) * mesh.texture.shape[1::-1], axis=1) / np.linalg.norm(b - a, axis=1)
        assert grain.min() > 100
        assert np.ptp(grain) < 1e-2 * grain.min()
        if name != "floor":
            at_floor = mesh.vertices[mesh.faces][..., 2] == 0
            np.testing.assert_allclose(mesh.uv[at_floor][:, 1], 1.0, atol=1e-6)
            at_top = np.isclose(mesh.vertices[mesh.faces][..., 2], 3)
            np.testing.assert_allclose(mesh.uv[at_top][:, 1], 0.0, atol=1e-2)


@pytest.mark.parametrize("look", [*FLOORS, *WALLS])
def test_textures_repeat_without_a_seam(look):
    """Across the seam, neighbouring pixels differ no more than elsewhere."""
    rng = np.random.default_rng(3)
    texture = finish(look, rng, None if look in FLOORS else 3.0).texture.astype(float)
    for axis in (0, 1) if look in FLOORS else (1,):
        steps = np.abs(np.diff(texture, axis=axis)).mean(axis=(1 - axis, 2))
        seam = np.abs(np.take(texture, 0, axis) - np.take(texture, -1, axis)).mean()
        assert seam <= steps.max() + 1.0
    assert texture.std() > 0.5


def test_a_finish_changes_only_its_surface():
    one = {solid.name: solid for solid in make_room(ROOM, 4)}
    two = {solid.name: solid for solid in make_room(ROOM.model_copy(update={"wall": "brick"}), 4)}
    np.testing.assert_array_equal(one["floor"].mesh.texture, two["floor"].mesh.texture)
    assert not np.array_equal(one["wall +x"].mesh.texture, two["wall +x"].mesh.texture)
    three = {solid.name: solid for solid in make_room(ROOM.model_copy(update={"floor": "wood"}), 4)}
    np.testing.assert_array_equal(one["wall +x"].mesh.texture, three["wall +x"].mesh.texture)


@pytest.mark.slow
def test_any_draws_each_finish():
    floors, walls = set(), set()
    for seed in range(5):
        floor, wall = (solid.mesh.texture for solid in make_room(RoomSection(floor="any", wall="any"), seed)[:2])
        for kinds, looks, key, texture, place in ((floors, FLOORS, "floor", floor, 0), (walls, WALLS, "wall", wall, 1)):
            same = {
                n
                for n in looks
                if np.array_equal(make_room(RoomSection(**{key: n}), seed)[place].mesh.texture, texture)
            }
            assert len(same) == 1  # a drawn finish equals the named one
            kinds.update(same)
    lights = {room_lighting(RoomSection(light="any"), seed).key for seed in range(24)}
    assert len(floors) >= 3
    assert len(walls) >= 3
    assert lights == {light.key for light in LIGHTS.values()}


def test_lighting_by_name():
    assert room_lighting(ROOM, 0) == Lighting()
    seen = {name: (light.key + light.sky) for name, light in LIGHTS.items()}
    assert seen["dim"] < 0.5 * seen["day"]
    assert LIGHTS["warm"].tint[0] > LIGHTS["warm"].tint[2]
    assert LIGHTS["side"].direction[2] < 0.6 < LIGHTS["day"].direction[2]


def test_a_ceiling_is_for_pictures_alone_and_looks_into_the_room():
    ceiling = make_ceiling(ROOM)
    normals, areas = normals_and_areas(ceiling.mesh)
    np.testing.assert_allclose(normals, np.tile((0, 0, -1), (len(normals), 1)), atol=1e-6)
    assert areas.sum() == pytest.approx(SIZE[0] * SIZE[1], rel=1e-5)
    assert ceiling.mesh.vertices[:, 2].min() == SIZE[2]
    lights = area_lights(ROOM, 0, draw_openings(ROOM, 0))
    assert not any(solid.geoms for solid in (ceiling, *shown_lamps(ROOM, 0, lights)))


@pytest.mark.parametrize(("height", "walls", "has"), [(2.8, True, True), (2.8, False, False), (3.0, True, False)])
def test_a_room_has_a_ceiling_if_all_cameras_hang_below_it(height, walls, has):
    rig = build_rig(CamerasSection(count=2, radius=2.0, height=height))
    assert has_ceiling(ROOM.model_copy(update={"walls": walls}), rig) == has


@pytest.mark.parametrize("name", LIGHTS)
def test_lamps_and_windows_shine_into_the_room(name):
    room = ROOM.model_copy(update={"light": name})
    areas = area_lights(room, 0, draw_openings(room, 0))
    assert {area.kind for area in areas} >= ({"lamp"} if any(MOODS[name].lamp) else {"window"})
    for area in areas:
        low, high = area.corners.min(axis=0), area.corners.max(axis=0)
        assert (low >= [-3.01, -4.01, 0]).all()
        assert (high <= [3.01, 4.01, 3]).all()
        assert area.normal @ (np.array([0, 0, 1.5]) - area.center) > 0
    sources = room_lighting(room, 0, areas).sources
    assert sources.areas == areas
    assert room_lighting(room, 0).sources is None


def test_without_walls_the_ground_fades_outwards():
    floor, ground = make_room(ROOM.model_copy(update={"walls": False}), 0)
    assert (floor.name, ground.name) == ("floor", "ground")
    low, high = ground.mesh.vertices.min(axis=0), ground.mesh.vertices.max(axis=0)
    np.testing.assert_allclose([low, high], [[-7, -8, 0], [7, 8, 0]], atol=1e-5)
    normals, areas = normals_and_areas(ground.mesh)
    np.testing.assert_allclose(normals, np.tile((0, 0, 1), (len(normals), 1)), atol=1e-6)
    assert areas.sum() == pytest.approx(14 * 16 - 48, rel=1e-4)
    light = Lighting()
    out = np.abs(ground.mesh.vertices[ground.mesh.faces].mean(axis=1)[:, :2] / [7, 8]).max(axis=1)
    rim = ground.mesh.colors[out.argmax()] * np.sqrt(light.key * light.direction[2] + light.sky)
    np.testing.assert_allclose(rim, light.background, atol=0.02)  # it ends in the colour of the background
