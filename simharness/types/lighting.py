"""Lighting of a scene: a key light that casts shadows, a sky light from above and a fill light at the camera."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.types.light_sources import LightSources
from simharness.types.mirror import Mirror
from simharness.types.panorama import Panorama

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Lighting:
    """Lighting of a whole scene.

    With ``sources``, the renderer ``raster`` shows the light of these sources: soft shadows, light that surfaces
    reflect to each other, and the tone curve of a camera. All other attributes are then the nearest lighting in closed
    form, which ``gl`` shows. Without ``sources`` both renderers show the lighting in closed form:

    For a surface with unit normal n on the side of the camera, the light is ``key max(n . direction, 0)`` (0 in
    shadow) ``+ sky (0.65 + 0.35 n_z) + fill max(n . direction to the camera, 0)``. The surface reflects this times
    ``tint`` times its albedo; sRGB is approximated as the square root of linear light. Light of 1 shows the albedo
    unchanged, and brighter values are clipped.

    Attributes:
        direction: vector to the key light, of any length except 0; stored as a unit vector.
        key: strength of the key light, which is far away (parallel rays).
        sky: strength of the ambient light, most of it from above.
        fill: strength of the light at the camera, which keeps surfaces in shadow from looking flat.
        tint: colour of all light, linear, 0 to 1.
        background: sRGB of pixels that show no surface, 0 to 1; light does not change it.
        panorama: what these pixels show instead, as bright as light of 1 makes it without ``sources``; None for
            ``background``.
        sources: lamps, windows, sun and sky; None for the lighting in closed form.
        mirror: mirror in which the meshes of the picture are reflected; ``sources`` are those before it.

    Raises:
        ValueError: a wrong shape, a direction of length 0 or below the horizon, a negative strength, or a colour
            outside 0..1.
    """

    direction: Vector = (0.38, 0.24, 0.89)  # high above, so that shadows are short
    key: float = 0.62
    sky: float = 0.40
    fill: float = 0.12
    tint: Vector = (1.0, 1.0, 1.0)
    background: Vector = (0.82, 0.85, 0.88)
    sources: LightSources | None = None
    mirror: Mirror | None = None
    panorama: Panorama | None = None

    def __post_init__(self) -> None:
        for entry in fields(self):
            if entry.name in ("sources", "mirror", "panorama"):
                continue
            value = np.asarray(getattr(self, entry.name), float)
            shape = () if entry.name in ("key", "sky", "fill") else (3,)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(
                    f"lighting {entry.name} must be finite, {shape or 'a number'}, got {getattr(self, entry.name)!r}"
                )
            object.__setattr__(self, entry.name, tuple(value.tolist()) if shape else float(value))
        if min(self.key, self.sky, self.fill) < 0:
            raise ValueError(
                f"lighting strengths must not be negative, got key {self.key:g}, sky {self.sky:g}, fill {self.fill:g}"
            )
        for name in ("tint", "background"):
            if not all(0 <= channel <= 1 for channel in getattr(self, name)):
                raise ValueError(f"lighting {name} must lie in 0..1, got {getattr(self, name)}")
        length = float(np.linalg.norm(self.direction))
        if length == 0 or self.direction[2] < 0:
            raise ValueError(
                f"lighting direction must point to a light above the floor (z >= 0, length > 0), got {self.direction}"
            )
        object.__setattr__(self, "direction", tuple(part / length for part in self.direction))


def facing(direction: ArrayLike) -> NDArray[np.float64]:
    """Return the axes of a camera that looks against ``direction`` (3,) as rows x right, y down, z forward, (3, 3)."""
    forward = -np.asarray(direction, float)
    right = np.cross(forward, np.eye(3)[np.abs(forward).argmin()])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])
