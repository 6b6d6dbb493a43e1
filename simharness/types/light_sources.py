"""Sources that light a scene in pictures: area lights (lamps, windows, spots), the sun and the sky.

Light is linear RGB. The unit of irradiance is that of a white surface which looks as bright as its albedo says: a
surface with albedo a under irradiance E is seen with radiance ``a E``. In this unit, the irradiance of a horizontal
surface under a whole hemisphere of radiance L is L, and radiances are what a picture shows of a lamp.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class AreaLight:
    """Rectangle that sends light out of its front: a lamp in the ceiling, a window, a spot.

    It lights the scene and does not show itself: what a camera sees of it is a mesh with ``Mesh.emission``. It casts no
    shadow, and light passes it from behind.

    Attributes:
        center: middle of the rectangle, metres.
        right: from the middle to the middle of one side, metres.
        up: from the middle to the middle of a neighbouring side, metres, perpendicular to ``right``. Light goes to the
            side of ``right x up``.
        radiance: radiance straight ahead.
        focus: the radiance in a direction at an angle a to straight ahead is ``cos(a) ** focus`` of it: 0 for a panel
            or a window, about 10 for a wide spot, 60 for a narrow one.
        kind: "lamp", or "window": sunlight enters through windows.

    Raises:
        ValueError: a wrong shape or value.
    """

    center: Vector
    right: Vector
    up: Vector
    radiance: Vector
    focus: float = 0.0
    kind: Literal["lamp", "window"] = "lamp"

    def __post_init__(self) -> None:
        _check_vectors(self, ("center", "right", "up", "radiance"))
        if min(self.radiance) < 0 or not 0 <= self.focus < np.inf:
            raise ValueError(
                f"an area light needs radiance and focus of at least 0, got {self.radiance} and {self.focus:g}"
            )
        right, up = np.array(self.right), np.array(self.up)
        lengths = np.linalg.norm(right), np.linalg.norm(up)
        if min(lengths) == 0 or abs(right @ up) > 1e-6 * lengths[0] * lengths[1]:
            raise ValueError(
                f"the sides of an area light must be perpendicular and longer than 0, got {self.right} and {self.up}"
            )

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector straight ahead, (3,)."""
        across = np.cross(self.right, self.up)
        return np.asarray(across / np.linalg.norm(across))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners, counter-clockwise as seen from the front, (4, 3) metres."""
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
        return np.asarray(np.array(self.center) + signs @ np.array([self.right, self.up]))


@dataclass(frozen=True)
class Sun:
    """The sun. It shines where nothing is in its way: outdoors, and through windows.

    Attributes:
        direction: vector to the sun, of any length except 0; stored as a unit vector.
        irradiance: irradiance of a surface that faces it.

    Raises:
        ValueError: a wrong shape or value, or a sun below the horizon.
    """

    direction: Vector
    irradiance: Vector

    def __post_init__(self) -> None:
        _check_vectors(self, ("direction", "irradiance"))
        length = float(np.linalg.norm(self.direction))
        if length == 0 or self.direction[2] < 0 or min(self.irradiance) < 0:
            raise ValueError(
                "a sun needs a direction above the horizon (z >= 0, length > 0) and irradiance of at least 0, got "
                f"{self.direction} and {self.irradiance}"
            )
        object.__setattr__(self, "direction", tuple(part / length for part in self.direction))


@dataclass(frozen=True)
class LightSources:
    """All sources of light of a scene, and how the cameras expose it.

    Attributes:
        areas: area lights.
        sun: the sun, if it shines.
        sky: radiance of the sky: what reaches a surface from directions in which nothing is in the way.
        brightness: mean light of the scene in pictures, after automatic exposure: 1 shows an albedo about as bright as
            it is. All sources are scaled to it together, so that only the ratios of their strengths matter.
        balance: share by which automatic white balance removes the mean colour of the light, 0 to 1.

    Raises:
        ValueError: a wrong shape or value, or no light at all.
    """

    areas: tuple[AreaLight, ...] = ()
    sun: Sun | None = None
    sky: Vector = (0.0, 0.0, 0.0)
    brightness: float = 1.0
    balance: float = 0.7

    def __post_init__(self) -> None:
        _check_vectors(self, ("sky",))
        object.__setattr__(self, "areas", tuple(self.areas))
        if min(self.sky) < 0 or not (0 < self.brightness < np.inf and 0 <= self.balance <= 1):
            raise ValueError(
                "light sources need a sky of at least 0, brightness above 0 and balance from 0 to 1, got "
                f"{self.sky}, {self.brightness:g} and {self.balance:g}"
            )
        if not self.areas and self.sun is None and not any(self.sky):
            raise ValueError("light sources without any light: give areas, a sun or a sky")


def _check_vectors(source: object, names: tuple[str, ...]) -> None:
    """Store the vectors of a source as tuples of three floats."""
    for name in [entry.name for entry in fields(source) if entry.name in names]:  # type: ignore[arg-type]
        value = np.asarray(getattr(source, name), float)
        if value.shape != (3,) or not np.isfinite(value).all():
            raise ValueError(f"{name} of a light must be three finite numbers, got {getattr(source, name)!r}")
        object.__setattr__(source, name, tuple(value.tolist()))
