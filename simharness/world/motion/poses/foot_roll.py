"""Foot roll: motion of the ankle while the sole rolls from heel to toes on the floor without slipping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from mvpose.arrays import Floats

_STEP, _ROUNDING = 0.25, 5.0  # degrees


@dataclass(frozen=True)
class FootRoll:
    """Position of the ankle as a function of the pitch of the foot.

    Attributes:
        pitch: pitch, toes up positive, (n,) radians, ascending.
        ahead: forward offset of the ankle from its position over the flat foot, (n,) metres.
        height: height of the ankle while the lowest point of the sole touches the floor, (n,) metres.
        passing: as ``height``, but smooth where the lowest point changes from toe to heel, and nowhere lower, (n,)
            metres; for a foot in the air.
    """

    pitch: Floats
    ahead: Floats
    height: Floats
    passing: Floats

    def at(self, pitch: Floats) -> tuple[Floats, Floats]:
        """Return forward offset and height of the ankle at pitches (...), metres."""
        return np.interp(pitch, self.pitch, self.ahead), np.interp(pitch, self.pitch, self.height)

    def spare(self, pitch: Floats) -> Floats:
        """Return the floor clearance of a swinging foot at pitches (...), metres."""
        return np.interp(pitch, self.pitch, self.passing - self.height)


def roll_sole(sole: Floats) -> FootRoll:
    """Roll a rigid sole over its edges: at each pitch the lowest point touches the floor and does not slip.

    Args:
        sole: points of the flat sole relative to the ankle, x forward, z up, (n, 3) metres.
    """
    pitch = np.radians(np.arange(-95.0, 95.0, _STEP))
    forward, up = sole[:, 0], sole[:, 2]
    x = forward * np.cos(pitch)[:, None] - up * np.sin(pitch)[:, None]
    z = forward * np.sin(pitch)[:, None] + up * np.cos(pitch)[:, None]
    touching = z.argmin(axis=1)
    rows = np.arange(len(pitch) - 1)
    ahead = np.concatenate([[0.0], np.cumsum(x[rows, touching[:-1]] - x[rows + 1, touching[:-1]])])
    ahead -= np.interp(0.0, pitch, ahead)
    height = -z.min(axis=1)
    passing = np.maximum(height, gaussian_filter1d(height, _ROUNDING / _STEP))
    return FootRoll(pitch=pitch, ahead=ahead, height=height, passing=passing)
