"""Texture of patterned clothes: the image and the texture coordinates of a dressed body.

The image has two bands, one for the cloth of the top and one for that of trousers or skirt, and below them a white
strip for plain faces. Its horizontal axis goes once around the trunk, starting at the front, and the image repeats
there. A pattern repeats a multiple of six times over this width. So it closes around the trunk, around an arm, which
takes a third of the width, and around a leg, which takes half of it. The vertical axis is metres from the root of the
neck down along trunk, skirt or limb.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.wardrobe import Color, Look

# Pixels. Twice as many along a limb as around it: seen from the side, the texture is short in the latter direction, and
# renderers that choose one level for both would blur horizontal stripes there.
WIDTH, BAND, WHITE = 128, 320, 16
LENGTH = 1.3  # height of a band, metres
_AROUND = 1.05  # circumference of a trunk, metres: makes patterns as high as wide
_MARGIN = 0.03  # unused margin at both ends of a band, metres, because renderers smooth textures
_ROOT = 0.08  # position of the root of the neck in a band, metres; collars reach higher
_OVERSAMPLE = 4
_BLOCK, _YOKE = 0.17, 0.25  # height and start of the panel of another colour across the chest and the sleeves, metres
_OPENING, _SHADE = 1, 0.35  # half the width of a coat's opening in pixels, and the factor that darkens it
_ARM, _LEG = 1 / 3, 1 / 2  # fraction of the texture's width around a limb
_ARM_START = 0.1  # distance from the root of the neck to the start of a sleeve, metres


def is_plain(look: Look) -> tuple[bool, bool]:
    """Return whether the top, and whether the trousers or skirt, have a single colour."""
    return look.top_pattern == "plain" and look.lower_garment != "coat", look.bottom_pattern == "plain"


def texture_image(look: Look) -> NDArray[np.uint8] | None:
    """Return the texture of a look, sRGB, (2 ``BAND`` + ``WHITE``, ``WIDTH``, 3), or None if all clothes are plain."""
    if all(is_plain(look)):
        return None
    top = _cloth(look.top_pattern, look.top, look.accent, look.repeats)
    if look.lower_garment == "coat":  # the line where it is buttoned
        top[:, :_OPENING] *= _SHADE
        top[:, -_OPENING:] *= _SHADE
    bottom = _cloth(look.bottom_pattern, look.trousers, look.accent, look.repeats)
    return np.rint(255 * np.concatenate([top, bottom, np.ones((WHITE, WIDTH, 3))])).astype(np.uint8)


def _cloth(pattern: str, color: Color, accent: Color, repeats: int) -> Floats:
    """Return one band of the texture with antialiased edges, (BAND, WIDTH, 3), 0 to 1."""
    across = (np.arange(WIDTH * _OVERSAMPLE) + 0.5) / (WIDTH * _OVERSAMPLE)
    down = (np.arange(BAND * _OVERSAMPLE)[:, None] + 0.5) * LENGTH / (BAND * _OVERSAMPLE)
    rows = (down * repeats / _AROUND) % 1 < 0.5
    columns = (across * repeats) % 1 < 0.5
    if pattern == "stripes":
        share = np.broadcast_to(rows, (len(down), len(across))).astype(float)
    elif pattern == "checks":
        share = 0.5 * rows + 0.5 * columns
    elif pattern == "blocks":
        panel = (down > _YOKE) & (down < _YOKE + _BLOCK)
        share = np.broadcast_to(panel, (len(down), len(across))).astype(float)
    else:
        share = np.zeros((len(down), len(across)))
    share = share.reshape(BAND, _OVERSAMPLE, WIDTH, _OVERSAMPLE).mean((1, 3))[..., None]
    return np.asarray((1 - share) * np.array(color) + share * np.array(accent))


def texture_coordinates(body: Body, *, top: NDArray[np.bool_], bottom: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the texture coordinates of the corners of every face, (k, 3, 2), 0 to 1.

    Args:
        body: rest body, dressed or bare.
        top: mask of the faces with the cloth of the first band, (k,).
        bottom: mask of the faces with the cloth of the second band, (k,). All other faces lie on the white strip.
    """
    corners = body.vertices.astype(float)[body.faces]
    rows = 2 * BAND + WHITE
    around, down = np.full(corners.shape[:2], 0.5), np.zeros(corners.shape[:2])
    worn = top | bottom
    trunk = worn & np.isin(body.part, [FacePart.TORSO, FacePart.SKIRT])
    neck = body.heads[body.index("Neck")]
    middle = 0.5 * (body.heads[0, 0] + neck[0])
    around[trunk] = np.arctan2(corners[trunk, :, 1], corners[trunk, :, 0] - middle) / (2 * np.pi)
    down[trunk] = neck[2] + _ROOT - corners[trunk, :, 2]
    for part, share, start, bones in (
        (FacePart.ARM, _ARM, _ARM_START, ("Arm", "ForeArm", "Hand")),
        (FacePart.LEG, _LEG, neck[2] - body.heads[body.index("LeftUpLeg"), 2], ("UpLeg", "Leg", "Foot")),
    ):
        left = corners[:, :, 1].mean(1) > 0
        for side, on_side in (("Left", left), ("Right", ~left)):
            limb = worn & (body.part == part) & on_side
            joints = np.stack([body.heads[body.index(side + bone)] for bone in bones])
            angle, along = _limb_coordinates(corners[limb], joints, mirrored=side == "Right")
            around[limb], down[limb] = 0.5 + share * angle / (2 * np.pi), start + _ROOT + along
    step = around - around[:, :1]
    period = np.select([body.part == FacePart.ARM, body.part == FacePart.LEG], [_ARM, _LEG], 1.0)[:, None]
    around -= period * np.rint(step / period)  # the corners of a face are never a whole turn apart
    down = np.clip(down, _MARGIN, LENGTH - _MARGIN) / LENGTH * BAND / rows
    down[bottom] += BAND / rows
    down[~worn] = (2 * BAND + WHITE / 2) / rows
    around[~worn] = 0.5
    return np.stack([around, down], axis=2).astype(np.float32)


def _limb_coordinates(points: Floats, joints: Floats, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Return cylinder coordinates of points (..., 3) on a limb with three joints (3, 3).

    Returns:
        Bearing around the limb, radians, and distance along it from the first joint, metres, each (...).
    """
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
