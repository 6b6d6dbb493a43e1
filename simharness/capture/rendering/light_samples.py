"""Places on still surfaces at which their light is computed; between them it is interpolated.

A large triangle has a lattice of samples, as in Yuksel et al., "Mesh colors" (2010): with n divisions of each side,
sample (i, j), ``i + j <= n``, is at the share i / n of the way to the second corner and j / n to the third. A small
triangle has samples at its corners, which it shares with its neighbours if it is smooth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.scene_topology import SceneTopology
from simharness.types.srgb import to_linear

Floats = NDArray[np.float32]

_FINE, _COARSE = 0.08, 0.20  # metres between samples: on the floor, where shadows lie, and elsewhere
_COARSEST = 0.25  # metres between samples of what faces down
_WIDEST = 0.3  # metres: largest neighbourhood that a sample stands for
_NARROW = 3.0  # at most so many times these distances between the samples along a narrow triangle
_BESIDE, _LARGE = 0.5, 0.95  # metres: reach of fine shadows; pieces of walls are larger than those of things
_FLOOR = 0.05  # metres: what faces up below it is floor
_MOST_SAMPLES = 60_000  # beyond, they are farther apart
_MOST_DIVISIONS = 32
_SPECK = 0.10  # metres: a flat triangle with shorter sides has one sample
_NUDGE = 2e-3  # share of the way to the middle of the triangle, so that rays do not start in the surface beside it


@dataclass(frozen=True)
class LightSamples:
    """Light samples of k triangles."""

    places: Floats
    """Positions, (n, 3) float32."""
    normals: Floats
    """Unit normals, (n, 3) float32."""
    albedo: Floats
    """Linear albedo, (n, 3) float32."""
    apart: Floats
    """Distance to the neighbours, metres, (n,) float32."""
    corner_samples: NDArray[np.int32]
    """Samples of the corners of each triangle; with more than one division the first is that of the lattice, (k, 3)
    int32."""
    divisions: NDArray[np.int32]
    """Divisions of the sides of each triangle, (k,) int32."""


def light_samples(
    topology: SceneTopology, vertices: Floats, face_normals: Floats, vertex_normals: Floats, *, sunny: bool = False
) -> LightSamples:
    """Return the light samples of the faces of a scene.

    Args:
        topology: faces.
        vertices: positions of all vertices, (v, 3).
        face_normals: unit normals of the faces, (k, 3).
        vertex_normals: unit normals of the vertices, (v, 3).
        sunny: whether the sun shines, so that light on all of the floor has edges.
    """
    faces, smooth = topology.faces.astype(np.int64), topology.smooth
    corners = vertices[faces].reshape(-1, 3, 3)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1, initial=0)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    floor = (face_normals[:, 2] > 0.9) & (corners[..., 2].max(axis=1, initial=0) < _FLOOR)
    if not sunny:
        floor[floor] = _beside_things(topology, corners[floor])
    apart = np.where(floor, _FINE, np.where(face_normals[:, 2] < -0.9, _COARSEST, _COARSE))
    # Of the sides of a narrow triangle, the short ones count more.
    divisions = _divided(np.maximum(np.sqrt(area), sides / _NARROW), apart, smooth)
    divisions[(sides < _SPECK) & ~smooth] = 0
    first, parts = 0, []
    corner_samples = np.zeros((len(faces), 3), np.int32)
    albedo = _albedo(topology)

    used = np.unique(faces[smooth])
    index = np.zeros(len(vertices), np.int32)
    index[used] = np.arange(len(used))
    corner_samples[smooth] = index[faces[smooth]]
    of_vertex = np.zeros((len(vertices), 3), np.float32)
    of_vertex[faces[smooth]] = albedo[smooth][:, None]
    parts.append((vertices[used], vertex_normals[used], of_vertex[used], np.zeros((len(used), 1))))
    first = len(used)
    for n in np.unique(divisions[~smooth]):
        chosen = np.flatnonzero((divisions == n) & ~smooth)
        weights = _lattice(int(n))
        weights = (1 - _NUDGE) * weights + _NUDGE / 3
        places = np.einsum("sc,kcj->ksj", weights, corners[chosen]).reshape(-1, 3)
        each = len(weights)
        near = np.repeat(np.minimum(np.sqrt(area[chosen]) / max(int(n), 1), _WIDEST), each)[:, None]
        parts.append(
            (places, *(np.repeat(each_face[chosen], each, axis=0) for each_face in (face_normals, albedo)), near)
        )
        begin = first + each * np.arange(len(chosen), dtype=np.int32)
        # Of a lattice with one division the samples are the first, the third and the second corner.
        offsets = np.array([0, 2, 1] if n == 1 else [0, 0, 0], np.int32)
        corner_samples[chosen] = begin[:, None] + offsets
        first += each * len(chosen)
    places, normals, colors, near = (np.concatenate([part[k] for part in parts]).astype(np.float32) for k in range(4))
    return LightSamples(places, normals, colors, near[:, 0], corner_samples, divisions)


def _beside_things(topology: SceneTopology, corners: Floats) -> NDArray[np.bool_]:
    """Return which triangles of the floor, (k, 3, 3), lie under or beside a thing that may shade them."""
    low, high = corners[..., :2].min(axis=1) - _BESIDE, corners[..., :2].max(axis=1) + _BESIDE
    near = np.zeros(len(corners), bool)
    for mesh in topology.meshes:
        if not len(mesh.faces) or mesh.vertices[:, 2].max() < _FLOOR:
            continue
        pieces = mesh.vertices[mesh.faces][..., :2]
        least, most = pieces.min(axis=1), pieces.max(axis=1)
        small = (most - least).max(axis=1) < _LARGE
        cells = np.unique(np.round((least + most)[small] / 2 / _BESIDE).astype(int), axis=0) * _BESIDE
        for place in cells:
            near |= ((low < place) & (high > place)).all(axis=1)
    return near


def _divided(sides: Floats, apart: NDArray[np.float64], smooth: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the divisions of triangles with longest ``sides``, with samples about ``apart`` or farther."""
    for _ in range(20):
        divisions = np.clip(np.ceil(sides / apart), 1, _MOST_DIVISIONS).astype(np.int32)
        divisions[smooth] = 1
        if ((divisions + 1) * (divisions + 2) // 2)[divisions > 1].sum() < _MOST_SAMPLES:
            break
        apart = 1.25 * apart
    return divisions


def _lattice(n: int) -> NDArray[np.float64]:
    """Return the weights of the three corners at the samples of a lattice; the middle alone for 0 divisions."""
    if n == 0:
        return np.full((1, 3), 1 / 3)
    pairs = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)], float) / n
    return np.column_stack([1 - pairs.sum(axis=1), pairs])


def _albedo(topology: SceneTopology) -> Floats:
    """Return the linear albedo of every face, (k, 3): of its texture the mean."""
    mean = [
        np.ones(3) if mesh.texture is None else to_linear(mesh.texture[::4, ::4].reshape(-1, 3)).mean(axis=0)
        for mesh in topology.meshes
    ]
    counts = [len(mesh.faces) for mesh in topology.meshes]
    dye = np.repeat(np.array(mean, np.float32).reshape(-1, 3), counts, axis=0)
    return (to_linear(255 * topology.colors) * dye).astype(np.float32)
