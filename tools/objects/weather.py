"""Weather and time of day outdoors: the sun and the radiance of the sky.

The clear sky is that of Preetham, Shirley and Smits, "A practical analytic model for daylight" (SIGGRAPH 1999), the
overcast one is the standard sky of the CIE (ISO 15469), three times as bright at the zenith as at the horizon.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.lighting import Sun, Vector
from simharness.types.srgb import LUMINANCE

_LUMINANCE = np.array(LUMINANCE)
_ROWS, _COLUMNS = 60, 120  # directions over which the light of the sky is summed
_HIDDEN = 60.0  # degrees: elevation of a sun behind clouds, from which nothing but the closed form takes light
# Perez coefficients A to E of luminance Y and chromaticity x, y: slope with the turbidity, and value at 0.
_PEREZ = np.array(
    [
        [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
        [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
        [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
    ]
)
# Chromaticity at the zenith: by powers 2, 1, 0 of the turbidity, and 3, 2, 1, 0 of the zenith angle of the sun.
_ZENITH_X = np.array(
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]]
)
_ZENITH_Y = np.array(
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]]
)
_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])  # of XYZ
_LEAST = 0.02  # least sine of the elevation: the models hold above the horizon
# Under a high sun the model is pink at the horizon, which real haze is not: there it fades to the colour of haze.
_HAZE, _HAZY = 0.20, np.array([0.78, 1.0, 1.30])  # sine of the elevation; linear RGB


@dataclass(frozen=True)
class Weather:
    """Weather and time of day. Sun and sky together give a horizontal surface an irradiance of luminance 1.

    Attributes:
        bearing: bearing of the sun from +x, radians.
        elevation: elevation of the sun, degrees; None behind an overcast sky.
        turbidity: haze of a clear sky: see :func:`~tools.objects.weather.clear_sky`.
        beam: colour of the sunlight.
        diffuse: share of the sky in the irradiance of a horizontal surface.
        cover: share of the sky under clouds, least and most.
        brightness, balance: see :class:`~simharness.types.lighting.LightSources`.
    """

    bearing: float
    elevation: float | None
    turbidity: float
    beam: Vector
    diffuse: float
    cover: tuple[float, float]
    brightness: float
    balance: float = 0.6

    @property
    def towards(self) -> Vector:
        """Unit vector to the sun."""
        height = np.radians(_HIDDEN if self.elevation is None else self.elevation)
        across = float(np.cos(height))
        return across * float(np.cos(self.bearing)), across * float(np.sin(self.bearing)), float(np.sin(height))

    @property
    def sun(self) -> Sun | None:
        """The sun, if it shines."""
        if self.elevation is None:
            return None
        beam = np.array(self.beam)
        r, g, b = ((1.0 - self.diffuse) / self.towards[2] / (beam @ _LUMINANCE) * beam).tolist()
        return Sun(self.towards, (r, g, b))

    @cached_property
    def sky(self) -> Vector:
        """Irradiance of a horizontal surface by the sky, linear RGB."""
        r, g, b = (self._total / (self._total @ _LUMINANCE) * self.diffuse).tolist()
        return r, g, b

    @cached_property
    def level(self) -> Floats:
        """Irradiance of a horizontal surface by sun and sky, linear RGB, (3,)."""
        sun = self.sun
        return np.array(self.sky) + (0.0 if sun is None else sun.direction[2] * np.array(sun.irradiance))

    def radiance(self, directions: Floats) -> Floats:
        """Return the radiance of the sky without clouds in directions (..., 3), linear RGB."""
        return self._relative(directions) * (self.diffuse / float(self._total @ _LUMINANCE))

    def _relative(self, directions: Floats) -> Floats:
        if self.elevation is None:
            return overcast_sky(directions)
        return clear_sky(directions, self.towards, self.turbidity)

    @cached_property
    def _total(self) -> Floats:
        """Irradiance of a horizontal surface by the sky in the unit of the model, (3,)."""
        up = (np.arange(_ROWS) + 0.5) / _ROWS  # sines of elevations: equal parts of the hemisphere
        turn = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * 2 * np.pi
        across = np.sqrt(1 - up * up)[:, None]
        ways = np.stack(np.broadcast_arrays(across * np.cos(turn), across * np.sin(turn), up[:, None]), axis=-1)
        return np.asarray(2 * (self._relative(ways) * up[:, None, None]).mean(axis=(0, 1)))


# Shares of the sky on clear days: 0.15 to 0.25 with a high sun, above 0.4 with a low one (Erbs, Klein and Duffie,
# "Estimation of the diffuse radiation fraction", Solar Energy 1982). Sunlight is that of black bodies of 5300 K, 3300 K
# and 4600 K, half as saturated.
WEATHERS: Mapping[str, Weather] = MappingProxyType(
    {
        "day": Weather(0.0, 48.0, 2.6, (1.0, 0.94, 0.86), 0.26, (0.15, 0.45), 0.70),
        "warm": Weather(0.0, 18.0, 4.0, (1.0, 0.78, 0.54), 0.42, (0.05, 0.35), 0.62, 0.3),
        "side": Weather(0.0, 30.0, 3.0, (1.0, 0.89, 0.77), 0.34, (0.10, 0.40), 0.66),
        "dim": Weather(0.0, None, 0.0, (0.0, 0.0, 0.0), 1.0, (0.0, 0.0), 0.45),
    }
)
"""Weathers of the lightings of :data:`~simharness.world.scene.rooms.room_lighting.LIGHTS`, by their names."""


def clear_sky(directions: ArrayLike, sun: ArrayLike, turbidity: float = 3.0) -> Floats:
    """Return the radiance of a clear sky, linear RGB, relative to the luminance at the zenith.

    Args:
        directions: unit vectors, (..., 3); below the horizon the sky goes on as at the horizon.
        sun: unit vector to the sun, (3,).
        turbidity: haze; 2 for a very clear day, 6 for a hazy one.
    """
    directions, sun = np.asarray(directions, float), np.asarray(sun, float)
    a, b, c, d, e = (_PEREZ @ [turbidity, 1.0]).T[:, :, None]
    theta_sun = np.arccos(np.clip(sun[2], 0.0, 1.0))
    shape = directions.shape[:-1]
    up = np.maximum(directions[..., 2], _LEAST).ravel()
    cosine = np.clip(directions @ sun, -1.0, 1.0).ravel()

    def perez(up: Floats, cosine: Floats) -> Floats:
        angle = np.arccos(cosine)
        return (1 + a * np.exp(b / up)) * (1 + c * np.exp(d * angle) + e * cosine**2)

    relative = perez(up, cosine) / perez(np.ones(1), np.array([sun[2]]))
    powers, angles = np.array([turbidity**2, turbidity, 1.0]), theta_sun ** np.array([3, 2, 1, 0])
    luminance = relative[0]
    x, y = (powers @ table @ angles * part for table, part in ((_ZENITH_X, relative[1]), (_ZENITH_Y, relative[2])))
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y]) * luminance
    rgb = np.maximum((_TO_RGB @ xyz).T, 0.0)
    haze = (np.exp(-up / _HAZE) * np.clip((sun[2] - 0.25) / 0.25, 0.0, 1.0))[:, None]
    return ((1 - haze) * rgb + haze * luminance[:, None] * _HAZY).reshape(*shape, 3)


def overcast_sky(directions: ArrayLike) -> Floats:
    """Return the radiance of an overcast sky, a bluish grey, relative to that at the zenith."""
    up = np.maximum(np.asarray(directions, float)[..., 2], 0.0)
    return ((1 + 2 * up) / 3)[..., None] * np.array([0.94, 1.0, 1.07])
