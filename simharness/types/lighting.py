"""Lighting of a scene: a key light that casts shadows, a sky light from above and a fill light at the camera.

With sources (area lights for lamps, windows and spots, the sun and the sky) pictures show the light of these sources. A
panorama is what pictures show in directions in which there is no surface.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array
from simharness.types.mirror import Mirror


@dataclass(frozen=True, eq=False)
class Panorama:
    """Surroundings that are infinitely far away: the sky, and land on the horizon.

    It lights nothing (that is the sky of :class:`~simharness.types.lighting.LightSources`), and pixels that show
    it have neither depth nor id.

    Raises:
        ValueError: a lower edge that is not below the zenith, or a picture of another shape or type.
    """

    draw: Callable[[], NDArray[np.uint8]]
    """Function that returns the picture, sRGB, (h, w, 3) uint8: the azimuth grows with the column, from that of -x
    counter-clockwise as seen from above once around, the elevation falls with the row from the zenith to ``lowest``. It
    is called when a picture first shows the panorama."""
    emission: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Radiance that white in this picture stands for, linear RGB."""
    lowest: float = -np.pi / 2
    """Elevation of the lower edge, radians; below it, directions show the lowest row."""

    def __post_init__(self) -> None:
        if not -np.pi / 2 <= self.lowest < np.pi / 2:
            raise ValueError(
                f"the lower edge of a panorama must be from -pi / 2 to below pi / 2, got lowest = {self.lowest:g}"
            )

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """The picture, (h, w, 3) uint8."""
        return as_array(self.draw(), ("h", "w", 3), "panorama picture", np.uint8)

    def places(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return column and row of directions (..., 3) in the picture, (..., 2); integers are centres of pixels."""
        height, width = self.picture.shape[:2]
        x, y, z = np.moveaxis(np.asarray(directions, float), -1, 0)
        column = (np.arctan2(y, x) / (2 * np.pi) + 0.5) * width - 0.5
        row = (np.pi / 2 - np.arctan2(z, np.hypot(x, y))) / (np.pi / 2 - self.lowest) * height - 0.5
        return np.stack([column, row], axis=-1)


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class AreaLight:
    """Rectangle that sends light out of its front: a lamp in the ceiling, a window, a spot.

    It lights the scene and does not show itself: what a camera sees of it is a mesh with ``Mesh.emission``. It casts no
    shadow, and light passes it from behind.

    Raises:
        ValueError: a wrong shape or value.
    """

    center: Vector
    """Middle of the rectangle, metres."""
    right: Vector
    """From the middle to the middle of one side, metres."""
    up: Vector
    """From the middle to the middle of a neighbouring side, metres, perpendicular to ``right``. Light goes to the side
    of ``right x up``."""
    radiance: Vector
    """Radiance straight ahead."""
    focus: float = 0.0
    """The radiance in a direction at an angle a to straight ahead is ``cos(a) ** focus`` of it: 0 for a panel or a
    window, about 10 for a wide spot, 60 for a narrow one."""
    kind: Literal["lamp", "window"] = "lamp"
    """"lamp", or "window": sunlight enters through windows."""

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

    Raises:
        ValueError: a wrong shape or value, or a sun below the horizon.
    """

    direction: Vector
    """Vector to the sun, of any length except 0; stored as a unit vector."""
    irradiance: Vector
    """Irradiance of a surface that faces it."""

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

    Raises:
        ValueError: a wrong shape or value, or no light at all.
    """

    areas: tuple[AreaLight, ...] = ()
    """Area lights."""
    sun: Sun | None = None
    """The sun, if it shines."""
    sky: Vector = (0.0, 0.0, 0.0)
    """Radiance of the sky: what reaches a surface from directions in which nothing is in the way."""
    brightness: float = 1.0
    """Mean light of the scene in pictures, after automatic exposure: 1 shows an albedo about as bright as it is. All
    sources are scaled to it together, so that only the ratios of their strengths matter."""
    balance: float = 0.7
    """Share by which automatic white balance removes the mean colour of the light, 0 to 1."""

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

    Raises:
        ValueError: a wrong shape, a direction of length 0 or below the horizon, a negative strength, or a colour
            outside 0..1.
    """

    direction: Vector = (0.38, 0.24, 0.89)  # high above, so that shadows are short
    """Vector to the key light, of any length except 0; stored as a unit vector."""
    key: float = 0.62
    """Strength of the key light, which is far away (parallel rays)."""
    sky: float = 0.40
    """Strength of the ambient light, most of it from above."""
    fill: float = 0.12
    """Strength of the light at the camera, which keeps surfaces in shadow from looking flat."""
    tint: Vector = (1.0, 1.0, 1.0)
    """Colour of all light, linear, 0 to 1."""
    background: Vector = (0.82, 0.85, 0.88)
    """SRGB of pixels that show no surface, 0 to 1; light does not change it."""
    sources: LightSources | None = None
    """Lamps, windows, sun and sky; None for the lighting in closed form."""
    mirror: Mirror | None = None
    """Mirror in which the meshes of the picture are reflected; ``sources`` are those before it."""
    panorama: Panorama | None = None
    """What these pixels show instead, as bright as light of 1 makes it without ``sources``; None for ``background``."""

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
