"""Colours of faces of the mesh: expressions, beards, bald heads and locks of hair.

The shape of the head does not change. So bodies, their landmarks, their capsules and what rays see of them are the same
with every expression and beard. A smile shows teeth between the lips and draws the corners of the mouth outwards and
up; a speaking mouth is open; a frown lowers the brows and draws the corners down. Every mouth has a dark line between
the lips, and lids shade the upper part of the eyes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart, body_model
from simharness.world.humans.clothing_colors import Color

_TEETH, _THROAT = (0.80, 0.77, 0.71), (0.17, 0.06, 0.06)
_LINE, _LINE_SHADE = 0.0013, 0.45  # half the height of the line between the lips, metres, and the factor of its colour
_INNER, _DEEP = 0.0035, 0.005  # half the height of the inner side of the lips, and how far its middle comes forward
_WIDE = 0.022  # half the width of a mouth, metres
_CREASE, _CREASE_SHADE = (0.0035, 0.80)  # half the width of creases in skin, metres, and the factor of their middle
_LID, _LID_SHADE = 0.005, 0.72  # height of the shadow of the upper lid on the eye, metres


@dataclass(frozen=True)
class Expression:
    """Expression of a face."""

    open: float = 0.0
    """Half the height of the opening between the lips, metres."""
    shown: Color = _THROAT
    """Colour of the opening."""
    reach: float = 0.0
    """Half its width, metres."""
    corner: tuple[float, float] = (0.0, 0.0)
    """How far the corners of the mouth are drawn out and up, metres, (2,); zeros for none."""
    frown: float = 0.0
    """Metres by which the inner ends of the brows reach lower."""


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


ADULT = 0.6  # least ``Shape.age`` of people with a beard or a bald head
_LOCKS = 0.13  # largest relative change of lightness between locks
_EDGE = 0.008  # width over which a beard fades out, metres
_MOUSTACHE, _NECK, _JAW = 0.017, 0.062, 0.075  # reach of a beard over, below and behind the mouth, metres
_CHEEK = 0.55  # slope of its upper edge towards the ears
_DENSEST = 0.85  # share of the colour of hair in a full beard
_RIM = 0.62  # share of the height of the scalp that a bald head shows


def groom(colors: NDArray[np.float32], body: Body, *, skin: Color, hair: Color, beard: float, bald: float) -> None:
    """Colour locks of hair, a beard and bald skin in place.

    Args:
        colors: albedo of every face, (k, 3).
        body: rest body, dressed or bare.
        skin: colour of the skin.
        hair: colour of the hair.
        beard: density of the beard, 0 none to 1 full; children have none.
        bald: extent of the bald skin, 0 none to 1 all but a rim; children have none.
    """
    centers = places_of_head(body)
    scalp = body.part == FacePart.SCALP
    locks = colors[scalp] * (1 + _LOCKS * _waves(centers[scalp])[:, None])
    colors[scalp] = np.rint(255 * locks) / 255
    if body.shape.age < ADULT:
        return
    if beard > 0:
        mouth = centers[body.part == FacePart.LIPS].mean(axis=0)
        face = np.flatnonzero((body.part == FacePart.SKIN) & (centers[:, 2] > mouth[2] - 0.2))
        share = _DENSEST * beard * _beard(centers[face] - mouth)[:, None]
        colors[face] = (1 - share) * colors[face] + share * np.array(hair)
    if bald > 0:
        grown = scalp & (np.arange(len(scalp)) < len(body_model().faces))  # not the mesh of long hair
        height = centers[:, 2] - centers[grown, 2].min()
        colors[grown & (height > (1 - _RIM * bald) * height[grown].max())] = skin


def places_of_head(body: Body) -> Floats:
    """Return the centres of all faces relative to the head joint, (k, 3) metres.

    Those of the body are at the mean body, so that the colours of two people do not depend on their shape or clothes.
    """
    model = body_model()
    of_body = model.mean[model.faces].mean(axis=1) - model.mean_heads[model.bones.index("Head")]
    corners = body.vertices.astype(float)[body.faces[len(of_body) :]]
    added = 0.5 * (corners.min(axis=1) + corners.max(axis=1))  # nearly the same for both triangles of a quadrangle
    return np.concatenate([of_body, added - body.heads[body.index("Head")]])


def _waves(places: Floats) -> Floats:
    """Return a smooth irregular function of the bearing of places (n, 3) around the head, -1 to 1, (n,)."""
    bearing = np.arctan2(places[:, 1], places[:, 0])
    return (np.sin(11 * bearing + 1.3) + np.sin(23 * bearing + 4.1) + np.sin(37 * bearing)) / 3


def _beard(places: Floats) -> Floats:
    """Return the density of a beard at places relative to the middle of the mouth, (n, 3) metres, 0 to 1, (n,)."""
    behind = np.maximum(-places[:, 0] - 0.03, 0.0)
    inside = np.minimum(_MOUSTACHE + _CHEEK * behind - places[:, 2], places[:, 2] + _NECK)
    inside = np.minimum(inside, places[:, 0] + _JAW)
    return np.clip(inside / _EDGE, 0.0, 1.0)
