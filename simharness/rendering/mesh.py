"""The one thing that renderers draw: a triangle mesh in the world with a colour for each face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh in the world.

    Faces are opaque from both sides, so a board may be a single sheet and a room may be seen from within.

    Attributes:
        vertices: metres, (n, 3) float32.
        faces: vertex indices, (k, 3) int32, counter-clockwise as seen from outside.
        colors: sRGB albedo of each face, 0 to 1, (k, 3) float32.
        smooth: shade with normals interpolated over the faces (skin) or with one normal a face (boxes).

    Raises:
        ValueError: a wrong shape, a vertex that is not finite, a face that names a vertex that does not
            exist, a colour outside 0..1.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]
    smooth: bool = False

    def __post_init__(self) -> None:
        vertices = as_array(self.vertices, ("n", 3), "mesh vertices", np.float32)
        faces = as_array(self.faces, ("k", 3), "mesh faces", np.int32)
        colors = as_array(self.colors, (len(faces), 3), "mesh colors", np.float32)
        if not np.isfinite(vertices).all():
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise ValueError(f"mesh vertices must be finite, got {vertices[bad].tolist()} at vertex {bad}")
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(
                f"mesh faces must index the {len(vertices)} vertices from 0, got {faces.min()} to {faces.max()}"
            )
        if len(faces) and not (colors.min() >= 0 and colors.max() <= 1):  # NaN fails both
            raise ValueError(f"mesh colors must lie in 0..1, got {colors.min():.3g} to {colors.max():.3g}")
        for key, value in (("vertices", vertices), ("faces", faces), ("colors", colors)):
            object.__setattr__(self, key, value)
