import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from tools.body.mesh_cutting import CutMesh, cut


def square(count):
    """Return a grid of triangles on the unit square: points (n, 3) and faces (k, 3), normals up."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    a, b, c, d = corner, corner + count, corner + count + 1, corner + 1
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def whole(points, faces):
    return CutMesh(sparse.eye_array(len(points), format="csr"), faces, np.arange(len(faces)))


def areas(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)[:, 2] / 2


@given(angle=st.floats(0, 6.3), offset=st.floats(-0.6, 0.6))
def test_cutting_keeps_the_surface_and_leaves_no_face_across_the_line(angle, offset):
    points, faces = square(8)
    field = (points[:, 0] - 0.5) * np.cos(angle) + (points[:, 1] - 0.5) * np.sin(angle) - offset
    mesh = cut(whole(points, faces), np.ones(len(faces), bool), field)
    new = mesh.blend @ points
    area = areas(new, mesh.faces)
    assert area.min() > 0
    np.testing.assert_allclose(area.sum(), 1, atol=1e-9)
    value = (mesh.blend @ field)[mesh.faces]
    slack = 0.05 * np.median(np.abs(field[faces] - field[np.roll(faces, 1, axis=1)])) + 1e-9
    assert not ((value.min(1) < -slack) & (value.max(1) > slack)).any()
    pieces = np.zeros(len(faces))
    np.add.at(pieces, mesh.origin, area)
    np.testing.assert_allclose(pieces, areas(points, faces), atol=1e-12)


def test_only_the_region_is_cut():
    points, faces = square(5)
    region = points[faces].mean(1)[:, 1] < 0.5
    mesh = cut(
        CutMesh(sparse.eye_array(len(points), format="csr"), faces, np.zeros(len(faces), int)),
        region,
        points[:, 0] - 0.4,
    )
    assert len(mesh.faces) > len(faces)
    middle = (mesh.blend @ points)[mesh.faces].mean(1)
    assert (middle[:, 1] > 0.5).sum() == (~region).sum()
