"""Compiled kernels over faces: normals, and selection of shadow casters. Private, on plain arrays."""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit

_BOUND = 0.02  # metres: depth behind a face below which it cannot shade anything


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def normals(vertices: np.ndarray, faces: np.ndarray, smooth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit normals of faces (k, 3), and of vertices (n, 3) area-weighted over the smooth faces; float32."""
    of_face = np.zeros((len(faces), 3), np.float32)
    of_vertex = np.zeros((len(vertices), 3), np.float32)
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        vx, vy, vz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        if smooth[t]:
            for i in (a, b, c):
                of_vertex[i, 0] += nx
                of_vertex[i, 1] += ny
                of_vertex[i, 2] += nz
        scale = np.float32(1.0) / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), np.float32(1e-20))
        of_face[t, 0], of_face[t, 1], of_face[t, 2] = nx * scale, ny * scale, nz * scale
    for i in range(len(vertices)):
        nx, ny, nz = of_vertex[i, 0], of_vertex[i, 1], of_vertex[i, 2]
        scale = np.float32(1.0) / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), np.float32(1e-20))
        of_vertex[i, 0], of_vertex[i, 1], of_vertex[i, 2] = nx * scale, ny * scale, nz * scale
    return of_face, of_vertex


@njit(cache=True, error_model="numpy")
def casters(
    vertices: np.ndarray, faces: np.ndarray, face_normals: np.ndarray, light: np.ndarray, box: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the faces (m, 3) that may cast shadows, and the lowest and highest coordinates of their vertices, (3,).

    These are the faces turned to ``light`` (3,) behind which the bounding box of the scene, that of ``vertices`` and
    ``box`` (2, 3), reaches by more than ``_BOUND``. Without such a face the coordinates are those of ``vertices``.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(vertices)):
        for k in range(3):
            value = np.float64(vertices[i, k])
            low[k], high[k] = min(low[k], value), max(high[k], value)
    around_low, around_high = np.minimum(low, box[0]), np.maximum(high, box[1])
    kept, count = np.empty_like(faces), 0
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    for t in range(len(faces)):
        nx, ny, nz = face_normals[t, 0], face_normals[t, 1], face_normals[t, 2]
        if not nx * light[0] + ny * light[1] + nz * light[2] > 0:
            continue
        a = faces[t, 0]
        behind = nx * ((around_low[0] if nx > 0 else around_high[0]) - vertices[a, 0])
        behind += ny * ((around_low[1] if ny > 0 else around_high[1]) - vertices[a, 1])
        behind += nz * ((around_low[2] if nz > 0 else around_high[2]) - vertices[a, 2])
        if behind > -_BOUND:
            continue
        for j in range(3):
            kept[count, j] = faces[t, j]
            for k in range(3):
                value = np.float64(vertices[faces[t, j], k])
                least[k], most[k] = min(least[k], value), max(most[k], value)
        count += 1
    return kept[:count], least if count else low, most if count else high
