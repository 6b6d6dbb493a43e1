"""Expressions of faces, as colours of faces of the mesh: the shape of the head does not change.

So bodies, their landmarks and what rays see of them are the same with every expression. A smile shows teeth between the
lips and draws the corners of the mouth outwards and up; a speaking mouth is open; a frown lowers the brows and draws
the corners down. Every mouth has a dark line between the lips, and lids shade the upper part of the eyes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.clothing_colors import Color
from simharness.world.humans.grooming import places_of_head

_TEETH, _THROAT = (0.80, 0.77, 0.71), (0.17, 0.06, 0.06)
_LINE, _LINE_SHADE = 0.0013, 0.45  # half the height of the line between the lips, metres, and the factor of its colour
_INNER, _DEEP = 0.0035, 0.005  # half the height of the inner side of the lips, and how far its middle comes forward
_WIDE = 0.022  # half the width of a mouth, metres
_CREASE, _CREASE_SHADE = (
    0.0035,
    0.80,
)  # half the width of creases in skin, metres, and the factor of their middle
_LID, _LID_SHADE = 0.005, 0.72  # height of the shadow of the upper lid on the eye, metres


@dataclass(frozen=True)
class Expression:
    """Expression of a face.

    Attributes:
        open: half the height of the opening between the lips, metres.
        shown: colour of the opening.
        reach: half its width, metres.
        corner: how far the corners of the mouth are drawn out and up, metres, (2,); zeros for none.
        frown: metres by which the inner ends of the brows reach lower.
    """

    open: float = 0.0
    shown: Color = _THROAT
    reach: float = 0.0
    corner: tuple[float, float] = (0.0, 0.0)
    frown: float = 0.0


EXPRESSIONS: Mapping[str, Expression] = MappingProxyType(
    {
        "neutral": Expression(),
        "smile": Expression(open=0.0032, shown=_TEETH, reach=0.018, corner=(0.009, 0.006)),
        "speaking": Expression(open=0.0048, shown=_THROAT, reach=0.013),
        "frown": Expression(corner=(0.006, -0.006), frown=0.007),
    }
)
"""Expressions by name."""


def express(colors: NDArray[np.float32], body: Body, *, expression: str, brow: Color) -> None:
    """Colour mouth, brows and eyes in place.

    Args:
        colors: albedo of every face, (k, 3), with skin, lips, brows and eyes.
        body: rest body, dressed or bare.
        expression: one of ``EXPRESSIONS``.
        brow: colour of the brows.
    """
    shape, centers = EXPRESSIONS[expression], places_of_head(body)
    lips, skin = body.part == FacePart.LIPS, body.part == FacePart.SKIN
    mouth = centers[lips].mean(axis=0)
    across, up = np.abs(centers[:, 1]), centers[:, 2] - mouth[2]
    ahead = centers[:, 0] - mouth[0]
    inner = (np.abs(up) < _INNER) & (ahead < _DEEP * (1 - (across / _WIDE) ** 2) - 0.0005)
    line = lips & ((np.abs(up) < _LINE) | inner)
    colors[line] *= _LINE_SHADE
    if shape.open > 0:
        shut = np.clip(1 - (across / shape.reach) ** 2, 0, 1)
        colors[lips & (np.abs(up) < shape.open * shut)] = shape.shown
    front = skin & (centers[:, 0] > mouth[0] - 0.06)
    out, rise = shape.corner
    if out > 0:
        share = np.clip((across - _WIDE) / out, 0, 1)
        away = np.hypot(across - _WIDE - share * out, up - share * rise)
        _darken(colors, front, away)
    if shape.frown > 0:
        brows = body.part == FacePart.BROW
        lowest = centers[brows, 2].min() - shape.frown * np.clip(1.6 - across / 0.02, 0, 1)
        inner = (
            front
            & (across > 0.008)
            & (across < 0.03)
            & (centers[:, 2] > lowest)
            & (centers[:, 2] < centers[brows, 2].max())
        )
        colors[inner] = 0.5 * colors[inner] + 0.5 * np.array(brow, np.float32)
    eyes = np.isin(body.part, [FacePart.SCLERA, FacePart.IRIS])
    if eyes.any():
        top = centers[eyes, 2].max()
        shade = _LID_SHADE + (1 - _LID_SHADE) * np.clip((top - centers[eyes, 2]) / _LID - 0.6, 0, 1)
        colors[eyes] *= shade[:, None].astype(np.float32)


def _darken(colors: NDArray[np.float32], where: NDArray[np.bool_], away: Floats) -> None:
    """Darken faces (k,) at a distance ``away`` (k,) from a crease, in place."""
    depth = np.clip(1 - away / _CREASE, 0, 1)[where]
    colors[where] *= (1 - (1 - _CREASE_SHADE) * depth)[:, None].astype(np.float32)
