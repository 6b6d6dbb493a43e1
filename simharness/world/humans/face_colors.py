"""Colours of faces of the mesh: expressions, beards, bald heads and locks of hair.

The shape of the head does not change. So bodies, their landmarks, their capsules and what rays see of them are the same
with every expression and beard. Which faces each colours was found on the mean body (``tools/body/faces.py``).
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart, body_model
from simharness.world.humans.clothing_colors import Color

EXPRESSIONS = ("neutral", "smile", "speaking", "frown")
"""Expressions."""

_LINE_SHADE = 0.45  # factor of the colour of the line between the lips
_SHOWN = {"smile": (0.80, 0.77, 0.71), "speaking": (0.17, 0.06, 0.06)}  # teeth; throat


@cache
def _marks() -> Mapping[str, NDArray[Any]]:
    """Return indices of the faces of the body that are coloured, and factors or shares of each."""
    with np.load(Path(__file__).parent / "data" / "faces.npz") as file:
        return dict(file)


def express(colors: NDArray[np.float32], *, expression: str, brow: Color) -> None:
    """Colour mouth, brows and eyes in place.

    Args:
        colors: albedo of every face, (k, 3), with skin, lips, brows and eyes.
        expression: one of ``EXPRESSIONS``.
        brow: colour of the brows.
    """
    marks = _marks()
    colors[marks["line"]] *= _LINE_SHADE
    if expression in _SHOWN:
        colors[marks[f"{expression} open"]] = _SHOWN[expression]
    if f"{expression} crease" in marks:
        colors[marks[f"{expression} crease"]] *= marks[f"{expression} shade"][:, None]
    if f"{expression} brow" in marks:
        between = marks[f"{expression} brow"]
        colors[between] = 0.5 * colors[between] + 0.5 * np.array(brow, np.float32)
    colors[marks["eyes"]] *= marks["lid shade"][:, None]


ADULT = 0.6  # least ``Shape.age`` of people with a beard or a bald head
_LOCKS = 0.13  # largest relative change of lightness between locks
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
    scalp, marks = body.part == FacePart.SCALP, _marks()
    locks = colors[scalp] * (1 + _LOCKS * _waves(places_of_head(body)[scalp])[:, None])
    colors[scalp] = np.rint(255 * locks) / 255
    if body.shape.age < ADULT:
        return
    if beard > 0:
        face, share = marks["beard"], _DENSEST * beard * marks["density"][:, None]
        colors[face] = (1 - share) * colors[face] + share * np.array(hair)
    if bald > 0:
        colors[marks["scalp"][marks["height"] > 1 - _RIM * bald]] = skin  # not the mesh of long hair


def places_of_head(body: Body) -> Floats:
    """Return the centres of all faces relative to the head joint, (k, 3) metres.

    Those of the body are at the mean body, so that the colours of two people do not depend on their shape or clothes.
    """
    of_body = mean_centers()
    corners = body.vertices.astype(float)[body.faces[len(of_body) :]]
    added = 0.5 * (corners.min(axis=1) + corners.max(axis=1))  # nearly the same for both triangles of a quadrangle
    return np.concatenate([of_body, added - body.heads[body.index("Head")]])


@cache
def mean_centers() -> Floats:
    """Return the centres of the faces of the mean body relative to its head joint, (k, 3) metres."""
    model = body_model()
    return np.asarray(model.mean[model.faces].mean(axis=1) - model.mean_heads[model.bones.index("Head")])


def _waves(places: Floats) -> Floats:
    """Return a smooth irregular function of the bearing of places (n, 3) around the head, -1 to 1, (n,)."""
    bearing = np.arctan2(places[:, 1], places[:, 0])
    return (np.sin(11 * bearing + 1.3) + np.sin(23 * bearing + 4.1) + np.sin(37 * bearing)) / 3
