"""Size of recorded people: limb lengths of their COCO-17 joints, and body shapes that have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17
from simharness.world.humans.body import body_model
from simharness.world.humans.limb_lengths import LIMBS
from simharness.world.humans.shape import LIMITS, Shape

_ENDS = {
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
}
_RAISED = 1.037  # trunk length at rest, with the arms of an A pose, over that with hanging arms: shoulders rise
_ROUNDS = 3  # of limb factors: lengths between COCO-17 joints are almost proportional to them


def body_lengths(joints: ArrayLike) -> dict[str, float]:
    """Return the median lengths of trunk, upper arm, forearm, thigh and shank, metres.

    The trunk reaches from mid-hips to mid-shoulders; the length of a limb is that of both sides.

    Args:
        joints: COCO-17 joints over time, (T, 17, 3) metres.
    """
    joints = np.asarray(joints, float)

    def place(name: str) -> Floats:
        return np.stack([joints[:, COCO17.index(f"{side}_{name}")] for side in ("left", "right")])

    trunk = place("shoulder").mean(axis=0) - place("hip").mean(axis=0)
    lengths = {"trunk": float(np.median(np.linalg.norm(trunk, axis=-1)))}
    for limb, (start, end) in _ENDS.items():
        lengths[limb] = float(np.median(np.linalg.norm(place(end) - place(start), axis=-1)))
    return lengths


def resize(shape: Shape, lengths: Mapping[str, float]) -> Shape:
    """Return the shape with stature and limb lengths changed so that its body has the lengths, as far as any body has.

    Args:
        shape: initial shape; its other parameters are kept.
        lengths: trunk and limb lengths with hanging arms, see :func:`body_lengths`.
    """

    def trunk(height: float) -> float:
        return _at_rest(replace(shape, height=height))["trunk"] - _RAISED * lengths["trunk"]

    low, high = LIMITS["height"]
    if trunk(low) >= 0:
        height = low
    elif trunk(high) <= 0:
        height = high
    else:
        height = float(brentq(trunk, low, high, xtol=1e-4))
    shape = replace(shape, height=height)
    for _ in range(_ROUNDS):
        present = _at_rest(shape)
        factors = {limb: getattr(shape, limb) * lengths[limb] / present[limb] for limb in LIMBS}
        shape = replace(shape, **{limb: float(np.clip(value, *LIMITS[limb])) for limb, value in factors.items()})
    return shape


def _at_rest(shape: Shape) -> dict[str, float]:
    model = body_model()
    vertices, _ = model.rest_of_shape(shape)
    return body_lengths(model.joints(vertices)[None])
