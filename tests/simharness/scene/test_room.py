import numpy as np
import pytest

from simharness.scene.room import make_room

SIZE = (6.0, 8.0, 3.0)


@pytest.fixture(scope="module")
def room():
    return {solid.name: solid for solid in make_room(SIZE)}


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
    vertices = np.concatenate([solid.mesh.vertices for solid in room.values()])
    np.testing.assert_allclose(vertices.min(axis=0), [-3, -4, 0], atol=1e-5)
    np.testing.assert_allclose(vertices.max(axis=0), [3, 4, 3], atol=1e-5)
    inside = np.random.default_rng(0).uniform([-3, -4, 0], [3, 4, 3], (2000, 3)) * 0.999 + [0, 0, 0.001]
    for solid in room.values():
        assert solid.kind == "room"
        assert all(box.distance(inside).min() > 0 for box in solid.boxes)


def test_no_ceiling_and_a_checkered_floor(room):
    assert set(room) == {"floor", "wall +x", "wall -x", "wall +y", "wall -y"}
    floor = room["floor"].mesh
    assert len(floor.faces) == 2 * 12 * 16
    brightness = floor.colors.mean(axis=1).reshape(12, 16, 2)[..., 0]
    light, dark = brightness[::2, ::2], brightness[::2, 1::2]
    assert light.min() > dark.max() + 0.05
    assert brightness[1::2, 1::2].min() > dark.max() + 0.05
