"""Geometry of a whole scene: merged triangles, normals, shadow maps.

Between frames mostly vertices of people move. So everything that depends on the faces of the meshes is in
:class:`~simharness.capture.rendering.scene_topology.SceneTopology`, reused while they are the same, everything that
depends on the vertices of meshes that stay where they are is in :class:`StillGeometry`, and the rest in
:class:`SceneGeometry`.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.scene_topology import SceneTopology, same_meshes
from simharness.capture.rendering.shadow_maps import LightView, ShadowMap, Shadows, shadow_map
from simharness.capture.rendering.surface_kernels import FaceArrays
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh

Floats = NDArray[np.float32]
ShadowCasters = tuple[NDArray[np.uint32], Floats, Floats]

_CUT = 0.2  # metres beyond a whole metre that need no other one: feet sink in; shadow maps have room at their borders


@dataclass(eq=False)
class StillGeometry:
    """Triangles of the meshes that stay where they are; computed once for a scene."""

    meshes: tuple[Mesh, ...]
    _casters: tuple[tuple[float, float, float], ShadowCasters] | None = field(default=None, init=False, repr=False)
    _shadow: tuple[LightView, ShadowMap] | None = field(default=None, init=False, repr=False)

    def holds(self, meshes: Sequence[Mesh]) -> bool:
        """Return whether the still ones among ``meshes`` are these, in this order."""
        return same_meshes([mesh for mesh in meshes if mesh.still], self.meshes)

    @cached_property
    def topology(self) -> SceneTopology:
        """Faces of these meshes."""
        return SceneTopology(self.meshes)

    @cached_property
    def vertices(self) -> Floats:
        """Vertices in the world, (n, 3)."""
        return _vertices(self.meshes)

    @cached_property
    def normals(self) -> tuple[Floats, Floats]:
        """Normals of the faces, (k, 3), and of the vertices, (n, 3)."""
        return normals(self.vertices, self.topology.faces, self.topology.smooth)

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """Lowest and highest coordinates of the vertices, (2, 3); inf and -inf without vertices."""
        if not len(self.vertices):
            return np.array([[np.inf] * 3, [-np.inf] * 3])
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)], float)

    @cached_property
    def faces(self) -> FaceArrays:
        """Faces as the shading kernels take them."""
        return self.topology.face_arrays(*self.normals)

    def casters(self, direction: tuple[float, float, float]) -> ShadowCasters:
        """Return the faces that cast shadows, (m, 3), and the box of their vertices; the last ones are cached."""
        if self._casters is None or self._casters[0] != direction:
            faces = self.topology.faces
            self._casters = direction, casters(self.vertices, faces, self.normals[0], np.array(direction), self.box)
        return self._casters[1]

    def shadow(self, light: LightView) -> ShadowMap:
        """Return the shadow map of these meshes; the last one is cached."""
        if self._shadow is None or self._shadow[0] != light:
            self._shadow = light, shadow_map(light, self.vertices, self.casters(light.direction)[0])
        return self._shadow[1]


@dataclass(eq=False)
class SceneGeometry:
    """Triangles of a scene at their positions; what only shading needs is computed on first use."""

    topology: SceneTopology
    """Faces of all meshes, those of still meshes first."""
    meshes: tuple[Mesh, ...]
    """Meshes in the order of the topology."""
    still: StillGeometry
    """Triangles of the still meshes."""
    _shadows: Shadows | None = field(default=None, init=False, repr=False)

    @classmethod
    def from_meshes(cls, meshes: Sequence[Mesh], last: "SceneGeometry | None" = None) -> "SceneGeometry":
        """Return the geometry of a scene; reuses the ``last`` one as far as it is unchanged."""
        order = sorted(range(len(meshes)), key=lambda k: not meshes[k].still)
        ordered = tuple(meshes[k] for k in order)
        still = tuple(mesh for mesh in ordered if mesh.still)
        if last is None:
            return cls(SceneTopology(ordered, tuple(order)), ordered, StillGeometry(still))
        if tuple(order) == last.topology.order and same_meshes(ordered, last.meshes):
            return last  # the same frozen objects: nothing changed
        return cls(
            last.topology if last.topology.matches(ordered, order) else SceneTopology(ordered, tuple(order)),
            ordered,
            last.still if same_meshes(still, last.still.meshes) else StillGeometry(still),
        )

    @cached_property
    def moving_vertices(self) -> Floats:
        """Vertices of the meshes that are not still, (n, 3)."""
        return _vertices(self.meshes[len(self.still.meshes) :])

    @cached_property
    def vertices(self) -> Floats:
        """Vertices in the world, (n, 3)."""
        return np.concatenate([self.still.vertices, self.moving_vertices])

    @cached_property
    def normals(self) -> tuple[Floats, Floats]:
        """Normals of the faces, (k, 3), and of the vertices, (n, 3)."""
        of_faces, of_vertices = self._moving_normals
        return (np.concatenate([self.still.normals[0], of_faces]), np.concatenate([self.still.normals[1], of_vertices]))

    @cached_property
    def faces(self) -> FaceArrays:
        """Faces of all meshes as the shading kernels take them."""
        return self.topology.face_arrays(*self.normals)

    @cached_property
    def _moving_normals(self) -> tuple[Floats, Floats]:
        smooth = self.topology.smooth[self.topology.still[0] :]
        return normals(self.moving_vertices, self.topology.moving_faces, smooth)

    def shadows(self, lighting: Lighting) -> Shadows:
        """Return the shadow maps for a lighting; the last ones are cached."""
        if self._shadows is None or self._shadows.light.direction != lighting.direction:
            self._shadows = self._cast(lighting.direction)
        return self._shadows

    def _cast(self, direction: tuple[float, float, float]) -> Shadows:
        """Render the shadow maps of the scene from the light.

        Only faces turned to the light cast shadows: this is sufficient for closed bodies, and lets the light into a
        room, whose walls face inwards. The floor and the walls that receive light have nothing behind them. The maps
        cover these faces; those of meshes that move, to the next metre, so that the map of still meshes serves many
        frames.
        """
        vertices, still = self.moving_vertices, self.still
        faces, low, high = casters(
            vertices, self.topology.moving_faces, self._moving_normals[0], np.array(direction), still.box
        )
        if len(still.vertices):
            _, still_low, still_high = still.casters(direction)
            low, high = np.floor(low + _CUT), np.ceil(high - _CUT)
            low, high = np.minimum(low, still_low), np.maximum(high, still_high)
        light = LightView.on_box(direction, low, high)
        return Shadows(light, still.shadow(light), shadow_map(light, vertices, faces))


def _vertices(meshes: Iterable[Mesh]) -> Floats:
    return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in meshes)])


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


def casters(
    vertices: Floats, faces: NDArray[np.uint32], face_normals: Floats, light: NDArray[np.float64], box: NDArray
) -> ShadowCasters:
    """Return the faces (m, 3) that may cast shadows, and the lowest and highest coordinates of their vertices, (3,).

    These are the faces turned to ``light`` (3,) behind which the bounding box of the scene, that of ``vertices`` and
    ``box`` (2, 3), reaches by more than ``_BOUND``. Without such a face the coordinates are those of ``vertices``.
    """
    low, high = vertices.min(axis=0, initial=np.inf), vertices.max(axis=0, initial=-np.inf)
    around_low, around_high = np.minimum(low, box[0]), np.maximum(high, box[1])
    way = np.where(face_normals > 0, around_low, around_high) - vertices[faces[:, 0]]
    (nx, ny, nz), (x, y, z) = face_normals.T, way.T
    lit = nx * light[0] + ny * light[1] + nz * light[2] > 0
    kept = faces[lit & (nx * x + ny * y + nz * z <= -_BOUND)]
    if len(kept):
        low, high = vertices[kept].min(axis=(0, 1)), vertices[kept].max(axis=(0, 1))
    return kept, low.astype(float), high.astype(float)
