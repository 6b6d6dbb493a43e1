"""Stripes, checks and blocks: a picture of the cloth, and where every face of a dressed body lies in it.

The picture has two bands, the cloth of the top and that of trousers or skirt, and below them a white strip for all
that is plain. To the right it goes once around the trunk from its front, and at its ends it repeats. On the way a
pattern repeats a multiple of six times: so it closes around the trunk, around an arm with a third of it and around a
leg with half of it. Downwards it goes from the root of the neck along trunk, skirt or limb, in metres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, Part
from simharness.world.humans.wardrobe import Color, Look

WIDTH, BAND, WHITE = 256, 160, 16  # pixels
LENGTH = 1.3  # metres down a band
_AROUND = 1.05  # metres around a trunk, for patterns as high as wide
_MARGIN = 0.03  # metres at both ends of a band that no face comes near, as pictures are smoothed
_ROOT = 0.08  # metres down a band where the root of the neck is; collars reach higher
_OVERSAMPLE = 4
_BLOCK, _YOKE = 0.24, 0.25  # metres; blocks begin below the shoulders, where sleeves are set in
_OPENING, _SHADE = 2, 0.35  # half the width of a coat's opening, pixels, and how dark it is
_ARM, _LEG = 1 / 3, 1 / 2  # of the way around the picture
_ARM_START = 0.1  # metres from the root of the neck to where a sleeve begins


def is_plain(look: Look) -> tuple[bool, bool]:
    """Whether the cloth of the top, and that of trousers or skirt, is of one colour."""
    return look.top_pattern == "plain" and look.below != "coat", look.bottom_pattern == "plain"


def picture(look: Look) -> NDArray[np.uint8] | None:
    """The cloth of a look, sRGB, (2 ``BAND`` + ``WHITE``, ``WIDTH``, 3); None where all of it is plain."""
    if all(is_plain(look)):
        return None
    top = _cloth(look.top_pattern, look.top, look.accent, look.repeats)
    if look.below == "coat":  # where it is buttoned
        top[:, :_OPENING] *= _SHADE
        top[:, -_OPENING:] *= _SHADE
    bottom = _cloth(look.bottom_pattern, look.trousers, look.accent, look.repeats)
    return np.rint(255 * np.concatenate([top, bottom, np.ones((WHITE, WIDTH, 3))])).astype(np.uint8)


def _cloth(pattern: str, color: Color, accent: Color, repeats: int) -> Floats:
    """One band, (BAND, WIDTH, 3) from 0 to 1, of smooth edges."""
    across = (np.arange(WIDTH * _OVERSAMPLE) + 0.5) / (WIDTH * _OVERSAMPLE)
    down = (np.arange(BAND * _OVERSAMPLE)[:, None] + 0.5) * LENGTH / (BAND * _OVERSAMPLE)
    rows = (down * repeats / _AROUND) % 1 < 0.5
    columns = (across * repeats) % 1 < 0.5
    if pattern == "stripes":
        share = np.broadcast_to(rows, (len(down), len(across))).astype(float)
    elif pattern == "checks":
        share = 0.5 * rows + 0.5 * columns
    elif pattern == "blocks":
        checkered = ((across * 6).astype(int) + ((down - _YOKE) / _BLOCK).astype(int)) % 2
        share = np.where(down > _YOKE, checkered, 0.0)
    else:
        share = np.zeros((len(down), len(across)))
    share = share.reshape(BAND, _OVERSAMPLE, WIDTH, _OVERSAMPLE).mean((1, 3))[..., None]
    return np.asarray((1 - share) * np.array(color) + share * np.array(accent))


def places(body: Body, *, top: NDArray[np.bool_], bottom: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Where the corners of every face lie in the picture, (k, 3, 2) from 0 to 1.

    Args:
        body: at rest, dressed or not.
        top: which faces are of the cloth of the first band, (k,).
        bottom: which are of that of the second, (k,); those of neither lie on the white strip.
    """
    corners = body.vertices.astype(float)[body.faces]
    rows = 2 * BAND + WHITE
    around, down = np.full(corners.shape[:2], 0.5), np.zeros(corners.shape[:2])
    worn = top | bottom
    trunk = worn & np.isin(body.part, [Part.TORSO, Part.SKIRT])
    neck = body.heads[body.index("Neck")]
    middle = 0.5 * (body.heads[0, 0] + neck[0])
    around[trunk] = np.arctan2(corners[trunk, :, 1], corners[trunk, :, 0] - middle) / (2 * np.pi)
    down[trunk] = neck[2] + _ROOT - corners[trunk, :, 2]
    for part, share, start, bones in (
        (Part.ARM, _ARM, _ARM_START, ("Arm", "ForeArm", "Hand")),
        (Part.LEG, _LEG, neck[2] - body.heads[body.index("LeftUpLeg"), 2], ("UpLeg", "Leg", "Foot")),
    ):
        left = corners[:, :, 1].mean(1) > 0
        for side, own in (("Left", left), ("Right", ~left)):
            mine = worn & (body.part == part) & own
            joints = np.stack([body.heads[body.index(side + bone)] for bone in bones])
            angle, along = _limb(corners[mine], joints, mirrored=side == "Right")
            around[mine], down[mine] = 0.5 + share * angle / (2 * np.pi), start + _ROOT + along
    step = around - around[:, :1]
    period = np.select([body.part == Part.ARM, body.part == Part.LEG], [_ARM, _LEG], 1.0)[:, None]
    around -= period * np.rint(step / period)  # no face goes the long way around
    down = np.clip(down, _MARGIN, LENGTH - _MARGIN) / LENGTH * BAND / rows
    down[bottom] += BAND / rows
    down[~worn] = (2 * BAND + WHITE / 2) / rows
    around[~worn] = 0.5
    return np.stack([around, down], axis=2).astype(np.float32)


def _limb(points: Floats, joints: Floats, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Bearing of points (..., 3) around a limb of three joints (3, 3), radians, and metres from the first along it."""
    upper, lower = joints[1] - joints[0], joints[2] - joints[1]
    lengths = np.linalg.norm(upper), np.linalg.norm(lower)
    upper, lower = upper / lengths[0], lower / lengths[1]
    beyond = ((points - joints[1]) @ (upper + lower) > 0)[..., None]
    along = np.where(beyond[..., 0], lengths[0] + (points - joints[1]) @ lower, (points - joints[0]) @ upper)
    axis, origin = np.where(beyond, lower, upper), np.where(beyond, joints[1], joints[0])
    off = points - origin
    off = off - (off * axis).sum(-1, keepdims=True) * axis
    forward = np.array([1.0, 0, 0]) - axis * axis[..., :1]
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    side = np.cross(axis, forward)
    angle = np.arctan2((off * side).sum(-1), (off * forward).sum(-1))
    return (-angle if mirrored else angle), along
