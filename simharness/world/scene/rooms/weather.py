"""Weather and time of day outdoors: the sun and the radiance of the sky."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from mvpose.arrays import Floats
from simharness.types.light_sources import Sun, Vector
from simharness.types.srgb import LUMINANCE
from simharness.world.scene.rooms.sky import clear_sky, overcast_sky

_LUMINANCE = np.array(LUMINANCE)
_ROWS, _COLUMNS = 60, 120  # directions over which the light of the sky is summed
_HIDDEN = 60.0  # degrees: elevation of a sun behind clouds, from which nothing but the closed form takes light


@dataclass(frozen=True)
class Weather:
    """Weather and time of day. Sun and sky together give a horizontal surface an irradiance of luminance 1.

    Attributes:
        bearing: bearing of the sun from +x, radians.
        elevation: elevation of the sun, degrees; None behind an overcast sky.
        turbidity: haze of a clear sky: see :func:`~simharness.world.scene.rooms.sky.clear_sky`.
        beam: colour of the sunlight.
        diffuse: share of the sky in the irradiance of a horizontal surface.
        cover: share of the sky under clouds, least and most.
        brightness, balance: see :class:`~simharness.types.light_sources.LightSources`.
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
"""Weathers of the lightings of :data:`~simharness.world.scene.rooms.lighting.LIGHTS`, by their names."""
