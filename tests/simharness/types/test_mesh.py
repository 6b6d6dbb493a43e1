from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from mesh_shapes import ball, box, chequered, room, with_parts

from simharness.types.mesh import Mesh

GOOD = {"vertices": np.eye(3), "faces": [[0, 1, 2]], "colors": [[0.5, 0.5, 0.5]]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": np.zeros((3, 2))}, r"mesh vertices must be \(n, 3\), got \(3, 2\)"),
        ({"vertices": [[0, 0, np.nan], [0, 1, 0], [0, 0, 1]]}, "must be finite, .* at vertex 0"),
        ({"faces": [[0, 1, 3]]}, "must index the 3 vertices from 0, got 0 to 3"),
        ({"faces": [[-1, 1, 2]]}, "must index the 3 vertices from 0, got -1 to 2"),
        ({"colors": [[0.5, 0.5, 0.5], [0.1, 0.1, 0.1]]}, r"mesh colors must be \(1, 3\), got \(2, 3\)"),
        ({"colors": [[0.5, 255, 0.5]]}, r"must lie in 0..1, got 0.5 to 255"),
        ({"colors": [[0.5, np.nan, 0.5]]}, r"must lie in 0..1"),
        ({"texture": np.zeros((2, 2, 3), np.uint8)}, "needs both texture and uv, or neither; uv is missing"),
        ({"uv": np.zeros((1, 3, 2))}, "texture is missing"),
        ({"texture": np.zeros((2, 2), np.uint8), "uv": np.zeros((1, 3, 2))}, r"texture must be \(h, w, 3\)"),
        ({"texture": np.zeros((0, 2, 3), np.uint8), "uv": np.zeros((1, 3, 2))}, "texture must have pixels"),
        ({"texture": np.zeros((2, 2, 3), np.uint8), "uv": np.zeros((3, 2))}, r"uv must be \(1, 3, 2\), got \(3, 2\)"),
        ({"texture": np.zeros((2, 2, 3), np.uint8), "uv": np.full((1, 3, 2), np.nan)}, "uv must be finite.* at face 0"),
        ({"parts": [1, 2]}, r"mesh parts must be \(1,\), got \(2,\)"),
        ({"parts": [-2]}, "labels from 0, or -1 for none, got -2"),
    ],
)
def test_bad_meshes_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Mesh(**{**GOOD, **change})


def test_a_mesh_keeps_copies_of_its_arrays():
    vertices = np.eye(3, dtype=np.float32)
    mesh = Mesh(**{**GOOD, "vertices": vertices})
    vertices[:] = 9
    np.testing.assert_array_equal(mesh.vertices, np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 1


def test_a_mesh_may_be_empty():
    mesh = Mesh(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3)), colors=np.zeros((0, 3)))
    assert mesh.faces.shape == (0, 3)


@pytest.mark.parametrize(("mesh", "volume"), [(box((1, 2, 3), (1, 2, 3)), 6.0), (room((2, 2, 2)), -8.0)])
def test_test_meshes_have_outward_faces(mesh, volume):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume)


def test_the_test_ball_is_closed_with_outward_faces():
    mesh = ball((0.3, 0, 1), 0.5, rings=40)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(4 / 3 * np.pi * 0.125, rel=0.01)


def test_a_moved_mesh_shares_all_other_arrays():
    mesh = with_parts(chequered((1, 1)), [3, -1])
    moved = mesh.moved(mesh.vertices + 1)
    np.testing.assert_array_equal(moved.vertices, mesh.vertices + 1)
    assert moved.vertices.dtype == np.float32
    for field in fields(Mesh):
        if field.name != "vertices":
            assert getattr(moved, field.name) is getattr(mesh, field.name)
    with pytest.raises(ValueError, match="read-only"):
        moved.vertices[0, 0] = 1


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        (np.zeros((3, 3)), r"mesh vertices must be \(4, 3\), got \(3, 3\)"),
        (np.full((4, 3), np.inf), "must be finite, .* at vertex 0"),
    ],
)
def test_moved_vertices_are_checked(vertices, message):
    with pytest.raises(ValueError, match=message):
        chequered((1, 1)).moved(vertices)
