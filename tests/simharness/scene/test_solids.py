import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.random import stream
from simharness.scene.solids import TOP, Box, box_mesh

numbers = st.floats(-3, 3)


def signed_volume(mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@given(x=numbers, y=numbers, yaw=st.floats(-7, 7))
def test_mesh_is_closed_and_looks_outwards(x, y, yaw):
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


def test_distance_by_hand():
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
    if nearest == 0:
        assert gap == 0


def test_moved_turns_about_the_vertical_and_carries():
    box = Box((1.0, 0.0, 0.5), (0.5, 0.25, 0.5), 0.1).moved([2.0, 3.0], np.pi / 2)
    np.testing.assert_allclose(box.center, (2.0, 4.0, 0.5), atol=1e-12)
    assert box.yaw == pytest.approx(0.1 + np.pi / 2)
