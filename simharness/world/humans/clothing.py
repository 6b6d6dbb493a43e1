"""Clothing and hair of a body: garment of every face, thickness and shape of the cloth, colours and texture.

The image of patterned clothes has two bands, one for the cloth of the top and one for that of trousers or skirt, and
below them a white strip for plain faces. Its horizontal axis goes once around the trunk, starting at the front, and the
image repeats there. A pattern repeats a multiple of six times over this width. So it closes around the trunk, around an
arm, which takes a third of the width, and around a leg, which takes half of it. The vertical axis is metres from the
root of the neck down along trunk, skirt or limb.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mvpose.arrays import Floats
from simharness.world.humans.accessories import accessory_colors
from simharness.world.humans.added_mesh import AddedMesh, add_mesh, unit
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.face_colors import express, groom
from simharness.world.humans.skirts_and_hair import bob, bun, curls, long_hair, ponytail, skirt
from simharness.world.humans.wardrobe import HEMS, LEGS, SLEEVES, Color, Look, mix


class Garment(IntEnum):
    """Garment or hair that covers a face."""

    NONE = 0
    HAIR = 1
    TOP = 2
    TROUSERS = 3
    SHOE = 4
    SOLE = 5


# In the shadow of lids and lashes, which the mesh does not cast: white paint here would glow in a dark face.
_SCLERA: Color = (0.66, 0.62, 0.59)
_SOLE: Color = (0.85, 0.85, 0.83)
_DRAPE, _DRAPE_ROUNDS = 0.5, (6, 14)  # step of the smoothing, and its rounds for close-fitting and for wide clothes
_WAIST = HEMS["tucked"]
_HAIRLINE = 0.002  # greatest thickness of curly hair where it meets the skin, metres
_UNDER_HAT = 0.005  # greatest thickness of hair below a hat, metres
_BREAK = 0.025  # length of wide trousers that lies on the shoe, metres


@dataclass(frozen=True)
class SurfaceColors:
    """Colours and texture of a dressed body of k faces, in the form of :class:`simharness.types.mesh.Mesh`."""

    colors: NDArray[np.float32]
    """Albedo of every face, white where the texture gives the whole colour, (k, 3) float32."""
    texture: NDArray[np.uint8] | None = None
    """Texture of the clothes, (h, w, 3) uint8, or None if all are plain."""
    uv: NDArray[np.float32] | None = None
    """Texture coordinates of the corners of every face, (k, 3, 2) float32, or None without a texture."""


def paint(body: Body, look: Look) -> SurfaceColors:
    """Return the colours and texture of a look on a body, before or after :func:`dress` and
    :func:`~simharness.world.humans.accessories.wear`.
    """
    colors, texture = face_colors(body, look), texture_image(look)
    if texture is None:
        return SurfaceColors(colors)
    worn, (plain_top, plain_bottom) = garments(body, look), is_plain(look)
    top, bottom = (worn == Garment.TOP) & (not plain_top), (worn == Garment.TROUSERS) & (not plain_bottom)
    colors[top | bottom] = 1.0
    return SurfaceColors(colors, texture, texture_coordinates(body, top=top, bottom=bottom))


def face_colors(body: Body, look: Look) -> NDArray[np.float32]:
    """Return the albedo of every face without patterns, (k, 3) float32."""
    palette = np.array([look.skin, look.hair, look.top, look.trousers, look.shoes, _SOLE], np.float32)
    colors = palette[garments(body, look)]
    groom(colors, body, skin=look.skin, hair=look.hair, beard=look.beard, bald=look.bald)
    colors[body.part == FacePart.BROW] = mix(look.hair, look.skin, 0.3)
    colors[body.part == FacePart.LIPS] = look.lips
    colors[body.part == FacePart.SCLERA] = _SCLERA
    colors[body.part == FacePart.IRIS] = look.eyes
    express(colors, expression=look.expression, brow=mix(look.hair, look.skin, 0.3))
    for part, color in accessory_colors(look).items():
        colors[body.part == part] = color
    return colors


def garments(body: Body, look: Look) -> NDArray[np.int64]:
    """Return the :class:`Garment` of every face of a body, (k,)."""
    part, level = body.part, body.level
    result = np.full(len(part), int(Garment.NONE))
    result[part == FacePart.SCALP] = Garment.HAIR
    hem = -np.inf if look.lower_garment in ("dress", "coat") else HEMS[look.hem]
    trunk = part == FacePart.TORSO
    result[(trunk & (level >= hem)) | ((part == FacePart.ARM) & (level < SLEEVES[look.sleeves]))] = Garment.TOP
    result[trunk & (level < hem)] = Garment.TROUSERS
    if look.lower_garment in ("trousers", "coat"):
        result[(part == FacePart.LEG) & (level < LEGS[look.legs])] = Garment.TROUSERS
    result[part == FacePart.SKIRT] = Garment.TROUSERS if look.lower_garment == "skirt" else Garment.TOP
    result[part == FacePart.SHOE] = Garment.SHOE
    result[part == FacePart.SOLE] = Garment.SOLE
    return result


def dress(body: Body, look: Look) -> Body:
    """Return the body with the shape of its clothes and hair; joints do not move.

    The faces of the body are kept in order, and their vertices are moved outwards. Where two garments meet, each has
    separate vertices, so hems stand out from what is below. The faces of long hair, a skirt, dress or coat are added
    after those of the body.
    """
    garment = garments(body, look)
    rest = body.vertices.astype(float)
    corners = body.faces * len(Garment) + garment[:, None]
    pairs, faces = np.unique(corners, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    source, worn = pairs // len(Garment), pairs % len(Garment)

    arm = body.part == FacePart.ARM
    adjacent = np.stack([np.bincount(faces[rows].ravel(), minlength=len(pairs)) for rows in (~arm, arm)])
    level, along_arm = (
        np.bincount(faces[rows].ravel(), np.repeat(body.level[rows], 3), len(pairs)) / np.maximum(count, 1)
        for rows, count in zip((~arm, arm), adjacent, strict=True)
    )
    a, b, c = np.moveaxis(rest[body.faces], 1, 0)
    normals = np.zeros_like(rest)
    np.add.at(normals, body.faces, np.cross(b - a, c - a)[:, None, :])
    normals = unit(normals)[source]
    normals[worn == Garment.SOLE, 2] = 0.0  # a shoe is wider than the foot, but stands on the same floor
    leg = (worn == Garment.TROUSERS) & (level > 1)
    normals[leg] = unit(normals[leg] * [1, 1, 0])  # normals over the foot point up and would lift the hem
    vertices = _draped(rest[source], faces, garment, look.fit)
    vertices[leg, 2] -= look.fit * _BREAK * np.clip((level[leg] - 1.5) / 0.4, 0, 1)
    thickness = _thickness(worn, level, along_arm, adjacent[1] / adjacent.sum(0), look)
    hair = worn == Garment.HAIR
    if look.hair_style == "curly":
        thickness[hair] = curls(rest[source[hair]], level[hair], volume=look.volume)
        hairline = np.isin(source, source[~hair])  # where hair meets skin it starts on the skin
        thickness[hair & hairline] = np.minimum(thickness[hair & hairline], _HAIRLINE)
    if look.hat != "none":
        thickness[hair] = np.minimum(thickness[hair], _UNDER_HAT)
    vertices = vertices + thickness[:, None] * normals
    dressed = replace(
        body,
        vertices=vertices.astype(np.float32),
        faces=faces,
        weight_bones=body.weight_bones[source],
        weights=body.weights[source],
    )
    if (hair := _hair(dressed, look)) is not None:
        dressed = add_mesh(dressed, hair)
    if look.lower_garment != "trousers":
        hips, neck = (body.heads[body.index(bone), 2] for bone in ("LeftUpLeg", "Neck"))
        waist = hips + 0.75 * _WAIST * (neck - hips)
        mesh, hang = skirt(dressed, top=waist, length=look.length, kind=look.lower_garment, ease=0.015 * look.fit)
        dressed = replace(add_mesh(dressed, mesh), skirt=replace(hang, first=len(dressed.vertices)))
    return dressed


def _hair(body: Body, look: Look) -> AddedMesh | None:
    """Return the mesh of hair that hangs or is tied; under a hat it is tied at the nape."""
    low = look.hat != "none"
    match look.hair_style:
        case "long":
            return long_hair(body, volume=look.volume)
        case "bob":
            return bob(body, volume=look.volume)
        case "bun":
            return bun(body, volume=look.volume, low=low)
        case "ponytail":
            return ponytail(body, volume=look.volume, low=low)
    return None


def _thickness(worn: NDArray[np.int64], level: Floats, along_arm: Floats, sleeve: Floats, look: Look) -> Floats:
    """Return the distances by which clothes and hair stand out from the skin at v vertices, (v,) metres.

    Args:
        worn: garments of the vertices, (v,).
        level: mean level of the adjacent faces that are not on an arm, (v,).
        along_arm: mean level of the adjacent faces on an arm, (v,).
        sleeve: fraction of the adjacent faces that are on an arm, (v,).
        look: width of the clothes and volume of the hair.
    """
    collar = np.clip((level - 0.8) / 0.2, 0, 1)
    height = np.clip((level - HEMS[look.hem]) / (1 - HEMS[look.hem]), 0, 1)  # a tucked shirt is held at its hem
    body = 0.03 * (1 - height) * (1.0 if look.hem == "loose" else 4 * height)
    blouse = look.fit * (sleeve * 0.016 * np.clip(along_arm, 0, 1) + (1 - sleeve) * body)
    wide = look.fit * 0.032 * np.clip(level, 0, 1.8)
    return np.select(
        [worn == Garment.HAIR, worn == Garment.TOP, worn == Garment.TROUSERS, worn >= Garment.SHOE],
        [
            0.015 * look.volume * level * (2 - level),
            0.010 - 0.006 * (1 - sleeve) * collar + blouse,
            0.008 + 0.006 * level + wide,
            0.004,
        ],
        0.0,
    )


def _draped(vertices: Floats, faces: NDArray[np.int32], garment: NDArray[np.int64], fit: float) -> Floats:
    """Smooth tops and trousers between their hems, because cloth bridges hollows of the body; wide cloth more."""
    cloth = faces[(garment == Garment.TOP) | (garment == Garment.TROUSERS)]
    edges = np.sort(cloth[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).astype(np.int64)
    keys, count = np.unique(edges @ [len(vertices), 1], return_counts=True)  # of pairs it takes four times as long
    edges = np.column_stack(np.divmod(keys, len(vertices)))
    moves = np.zeros(len(vertices))
    moves[cloth] = _DRAPE
    moves[edges[count == 1]] = 0.0
    link = sparse.coo_array((np.ones(len(edges)), edges.T), (len(vertices),) * 2).tocsr()
    link = link + link.T
    mean = sparse.diags_array(1 / np.maximum(link.sum(axis=1), 1)) @ link
    for _ in range(round(np.interp(fit, (0, 1), _DRAPE_ROUNDS))):
        vertices = vertices + moves[:, None] * (mean @ vertices - vertices)
    return vertices


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


def limb_frame(points: Floats, joints: Floats) -> tuple[Floats, Floats, Floats]:
    """Return where points (..., 3) are on a limb with three joints (3, 3).

    Returns:
        Axis of the nearer segment, (..., 3), its first joint, (..., 3), and distance along the limb, (...) metres.
    """
    upper, lower = unit(joints[1] - joints[0]), unit(joints[2] - joints[1])
    beyond = ((points - joints[1]) @ (upper + lower) > 0)[..., None]
    bend = np.linalg.norm(joints[1] - joints[0])
    along = np.where(beyond[..., 0], bend + (points - joints[1]) @ lower, (points - joints[0]) @ upper)
    return np.where(beyond, lower, upper), np.where(beyond, joints[1], joints[0]), along


def _limb_coordinates(points: Floats, joints: Floats, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Return cylinder coordinates of points (..., 3) on a limb with three joints (3, 3).

    Returns:
        Bearing around the limb, radians, and distance along it from the first joint, metres, each (...).
    """
    axis, origin, along = limb_frame(points, joints)
    off = points - origin
    off = off - (off * axis).sum(-1, keepdims=True) * axis
    forward = np.array([1.0, 0, 0]) - axis * axis[..., :1]
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    side = np.cross(axis, forward)
    angle = np.arctan2((off * side).sum(-1), (off * forward).sum(-1))
    return (-angle if mirrored else angle), along
