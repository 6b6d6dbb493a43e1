"""Triangle mesh with a colour per face: the only primitive that renderers draw.

Its finish says what reflects light other than a matte surface does, and how cloth and hair are grained.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array


class Material(IntEnum):
    """Material of a face, by which light is reflected."""

    MATTE = 0
    SKIN = 1
    HAIR = 2
    CLOTH = 3
    LEATHER = 4
    PLASTIC = 5
    EYE = 6
    METAL = 7


@dataclass(frozen=True)
class Finish:
    """Materials of the k faces of a mesh with n vertices, and the grain of its surface.

    The grain is a direction at every vertex: of hair along its strands, of cloth along limb or trunk. It is given by
    another vertex, towards which it points, so that it follows every pose. Where cloth becomes shorter along its grain
    than at rest, it folds.

    Raises:
        ValueError: a wrong shape, or a vertex that does not exist.
    """

    materials: NDArray[np.int8]
    """:class:`Material` of every face, (k,) int8."""
    toward: NDArray[np.int32]
    """Vertex to which the grain of each vertex points, itself where there is none, (n,) int32."""
    rest: NDArray[np.float32]
    """Distance to it at rest, metres, (n,) float32."""
    place: NDArray[np.float32]
    """Coordinate of the pattern, metres, (n,) float32: of hair across the strands, from 0 to ``around`` once around the
    head; of cloth along the grain."""
    looseness: NDArray[np.float32]
    """How deep cloth folds: 0 not at all, 1 as loose clothes, (n,) float32."""
    around: float = 0.6
    """Period of ``place``, metres."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "materials", as_array(self.materials, ("k",), "materials", np.int8))
        toward = as_array(self.toward, ("n",), "grain", np.int32)
        if len(toward) and not (toward.min() >= 0 and toward.max() < len(toward)):
            raise ValueError(
                f"the grain must point to the {len(toward)} vertices, got {toward.min()} to {toward.max()}"
            )
        object.__setattr__(self, "toward", toward)
        for key in ("rest", "place", "looseness"):
            object.__setattr__(self, key, as_array(getattr(self, key), (len(toward),), key, np.float32))


@dataclass(frozen=True)
class Mesh:
    """Triangle mesh in the world.

    Faces are opaque from both sides, so a board may be a single sheet and a room may be seen from inside.

    Raises:
        ValueError: a wrong shape, a vertex or texture coordinate that is not finite, a face that refers to a missing
            vertex, a colour outside 0..1, a texture without pixels, an emission below 0, one of ``texture`` and
            ``uv`` alone, or a finish of another number of faces or vertices.
    """

    vertices: NDArray[np.float32]
    """Positions in metres, (n, 3) float32."""
    faces: NDArray[np.int32]
    """Vertex indices, (k, 3) int32, counter-clockwise as seen from outside."""
    colors: NDArray[np.float32]
    """SRGB albedo of each face, 0 to 1, (k, 3) float32."""
    smooth: bool = False
    """Whether normals are interpolated over the faces (skin) or constant per face (boxes)."""
    texture: NDArray[np.uint8] | None = None
    """Image that multiplies ``colors``, sRGB, (h, w, 3) uint8; None for plain faces."""
    uv: NDArray[np.float32] | None = None
    """Texture coordinates of the three corners of each face, (k, 3, 2) float32: u to the right and v down, the whole
    texture from 0 to 1; outside this range it repeats. Required with a texture, forbidden without."""
    parts: NDArray[np.int8] | None = None
    """Label of each face, -1 for none, (k,) int8; for a body the :class:`simharness.world.humans.anatomy.Segment`. None
    if no face has a label."""
    still: bool = False
    """Whether the mesh stays where it is as long as the scene lasts: renderers draw it once for each camera that stays
    too."""
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance that the surface sends out, linear RGB, multiplied by ``colors`` and ``texture``: what a picture shows
    of a lamp or a window. It lights nothing else (that is an :class:`~simharness.types.lighting.AreaLight`), and only
    lighting with ``sources`` shows it."""
    finish: Finish | None = None
    """Materials of the faces, and grain of hair and cloth. It changes colours alone, of moving meshes, in lighting with
    ``sources``; None for a matte surface."""

    def __post_init__(self) -> None:
        vertices = _checked_vertices(self.vertices, "n")
        faces = as_array(self.faces, ("k", 3), "mesh faces", np.int32)
        colors = as_array(self.colors, (len(faces), 3), "mesh colors", np.float32)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(
                f"mesh faces must index the {len(vertices)} vertices from 0, got {faces.min()} to {faces.max()}"
            )
        if len(faces) and not (colors.min() >= 0 and colors.max() <= 1):  # NaN fails both
            raise ValueError(f"mesh colors must lie in 0..1, got {colors.min():.3g} to {colors.max():.3g}")
        for key, value in (("vertices", vertices), ("faces", faces), ("colors", colors)):
            object.__setattr__(self, key, value)
        if (self.texture is None) != (self.uv is None):
            missing = "uv" if self.uv is None else "texture"
            raise ValueError(f"a mesh needs both texture and uv, or neither; {missing} is missing")
        if self.texture is not None and self.uv is not None:
            texture = as_array(self.texture, ("h", "w", 3), "mesh texture", np.uint8)
            uv = as_array(self.uv, (len(faces), 3, 2), "mesh uv", np.float32)
            if not texture.size:
                raise ValueError(f"mesh texture must have pixels, got {texture.shape}")
            if not np.isfinite(uv).all():
                bad = int(np.flatnonzero(~np.isfinite(uv).all(axis=(1, 2)))[0])
                raise ValueError(f"mesh uv must be finite, got {uv[bad].tolist()} at face {bad}")
            object.__setattr__(self, "texture", texture)
            object.__setattr__(self, "uv", uv)
        if self.parts is not None:
            parts = as_array(self.parts, (len(faces),), "mesh parts", np.int8)
            if len(parts) and parts.min() < -1:
                raise ValueError(f"mesh parts must be labels from 0, or -1 for none, got {parts.min()}")
            object.__setattr__(self, "parts", parts)
        if len(self.emission) != 3 or not all(0 <= value < np.inf for value in self.emission):
            raise ValueError(f"mesh emission must be three numbers of at least 0, got {self.emission}")
        if self.finish is not None:
            counts = len(self.finish.materials), len(self.finish.toward)
            if counts != (len(faces), len(vertices)):
                raise ValueError(
                    f"the finish of a mesh of {len(faces)} faces and {len(vertices)} vertices must have as many, got "
                    f"{counts[0]} and {counts[1]}: make it from the body that the mesh shows"
                )

    def moved(self, vertices: ArrayLike) -> Self:
        """Return the mesh with other vertex positions, (n, 3); it is not ``still``.

        All other arrays are shared: they are not checked again, and renderers reuse what they computed from them.

        Raises:
            ValueError: a different number of vertices, or a vertex that is not finite.
        """
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        object.__setattr__(other, "vertices", _checked_vertices(vertices, len(self.vertices)))
        object.__setattr__(other, "still", False)
        return other


def _checked_vertices(vertices: ArrayLike, count: int | str) -> NDArray[np.float32]:
    result = as_array(vertices, (count, 3), "mesh vertices", np.float32)
    if not np.isfinite(result).all():
        bad = int(np.flatnonzero(~np.isfinite(result).all(axis=1))[0])
        raise ValueError(f"mesh vertices must be finite, got {result[bad].tolist()} at vertex {bad}")
    return result
