"""The light in a room: a key light that throws shadows, a sky from above, a little from the camera."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Lighting:
    """The light of a whole scene; both renderers shade by the same rule.

    A surface whose unit normal is n, turned to the camera, gets the light ``key max(n . direction, 0)``, but none of it
    in shadow, ``+ sky (0.65 + 0.35 n_z) + fill max(n . to the camera, 0)``, and that times ``tint`` is what it
    reflects times its albedo; sRGB is taken as the root of linear light. Light of 1 shows the albedo as it is, and
    what is more is clipped.

    Attributes:
        direction: to the key light, any length but 0; kept as a unit vector.
        key: strength of the key light, which comes from afar.
        sky: strength of the light from all around, most of it from above.
        fill: strength of the light from the camera, so that nothing is flat in the shade.
        tint: colour of all this light, linear, 0 to 1.
        background: sRGB of what is not hit, 0 to 1; light does not change it.

    Raises:
        ValueError: a wrong shape, a direction without length or from below the horizon, a negative strength, a colour
            outside 0..1.
    """

    direction: Vector = (0.38, 0.24, 0.89)  # high: short shadows at the feet
    key: float = 0.62
    sky: float = 0.40
    fill: float = 0.12
    tint: Vector = (1.0, 1.0, 1.0)
    background: Vector = (0.82, 0.85, 0.88)

    def __post_init__(self) -> None:
        for entry in fields(self):
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
                f"lighting direction points to the light, which must not be under the floor: got {self.direction}"
            )
        object.__setattr__(self, "direction", tuple(part / length for part in self.direction))


def facing(direction: ArrayLike) -> NDArray[np.float64]:
    """Axes of a view that looks against ``direction`` (3,), as rows: x right, y down, z forward; (3, 3)."""
    forward = -np.asarray(direction, float)
    right = np.cross(forward, np.eye(3)[np.abs(forward).argmin()])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])
