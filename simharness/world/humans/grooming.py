"""Beards, bald heads and locks of hair, as colours of faces: the shape of head and hair does not change.

So bodies, their capsules and what rays see of them are the same with and without a beard.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart, body_model
from simharness.world.humans.clothing_colors import Color

ADULT = 0.6  # least ``Shape.age`` of people with a beard or a bald head
_LOCKS = 0.13  # largest relative change of lightness between locks
_EDGE = 0.008  # width over which a beard fades out, metres
_MOUSTACHE, _THROAT, _JAW = 0.017, 0.062, 0.075  # reach of a beard over, below and behind the mouth, metres
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
    inside = np.minimum(_MOUSTACHE + _CHEEK * behind - places[:, 2], places[:, 2] + _THROAT)
    inside = np.minimum(inside, places[:, 0] + _JAW)
    return np.clip(inside / _EDGE, 0.0, 1.0)
