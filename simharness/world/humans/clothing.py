"""Dressing a body: clothes and hair get their thickness, their shape and their colours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mvpose.arrays import Floats
from simharness.world.humans import cloth_texture
from simharness.world.humans.body import Body, Part
from simharness.world.humans.skirts_and_hair import Shell, bun, long_hair, skirt
from simharness.world.humans.wardrobe import HEMS, LEGS, SLEEVES, Color, Look, mix


class Garment(IntEnum):
    """What covers a face."""

    NONE = 0
    HAIR = 1
    TOP = 2
    TROUSERS = 3
    SHOE = 4
    SOLE = 5


_SCLERA: Color = (0.9, 0.9, 0.88)
_SOLE: Color = (0.85, 0.85, 0.83)
_DRAPE, _DRAPE_ROUNDS = 0.5, (6, 14)  # close, wide
_WAIST = HEMS["tucked"]
_BREAK = 0.025  # metres by which wide trousers lie on the shoe


@dataclass(frozen=True)
class Coat:
    """The surface of a dressed body of k faces, as :class:`simharness.types.mesh.Mesh` takes it.

    Attributes:
        colors: albedo of every face, white where the texture has it all, (k, 3) float32.
        texture: of the cloth, (h, w, 3) uint8; None where all of it is plain.
        uv: where the corners of every face lie in the texture, (k, 3, 2) float32; None without one.
    """

    colors: NDArray[np.float32]
    texture: NDArray[np.uint8] | None = None
    uv: NDArray[np.float32] | None = None


def paint(body: Body, look: Look) -> Coat:
    """The colours and patterns of a body that has been dressed in the look, or of one that shall be."""
    colors, texture = face_colors(body, look), cloth_texture.picture(look)
    if texture is None:
        return Coat(colors)
    worn, (plain_top, plain_bottom) = garments(body, look), cloth_texture.is_plain(look)
    top, bottom = (worn == Garment.TOP) & (not plain_top), (worn == Garment.TROUSERS) & (not plain_bottom)
    colors[top | bottom] = 1.0
    return Coat(colors, texture, cloth_texture.places(body, top=top, bottom=bottom))


def face_colors(body: Body, look: Look) -> NDArray[np.float32]:
    """Albedo of every face without patterns, (k, 3) float32."""
    palette = np.array([look.skin, look.hair, look.top, look.trousers, look.shoes, _SOLE], np.float32)
    colors = palette[garments(body, look)]
    colors[body.part == Part.BROW] = mix(look.hair, look.skin, 0.3)
    colors[body.part == Part.LIPS] = look.lips
    colors[body.part == Part.SCLERA] = _SCLERA
    colors[body.part == Part.IRIS] = look.eyes
    return colors


def garments(body: Body, look: Look) -> NDArray[np.int64]:
    """What covers every face of a body, (k,) :class:`Garment`."""
    part, level = body.part, body.level
    result = np.full(len(part), int(Garment.NONE))
    result[part == Part.SCALP] = Garment.HAIR
    hem = -np.inf if look.below in ("dress", "coat") else HEMS[look.hem]
    trunk = part == Part.TORSO
    result[(trunk & (level >= hem)) | ((part == Part.ARM) & (level < SLEEVES[look.sleeves]))] = Garment.TOP
    result[trunk & (level < hem)] = Garment.TROUSERS
    if look.below in ("trousers", "coat"):
        result[(part == Part.LEG) & (level < LEGS[look.legs])] = Garment.TROUSERS
    result[part == Part.SKIRT] = Garment.TROUSERS if look.below == "skirt" else Garment.TOP
    result[part == Part.SHOE] = Garment.SHOE
    result[part == Part.SOLE] = Garment.SOLE
    return result


def dress(body: Body, look: Look) -> Body:
    """Give clothes and hair their thickness and shape; joints do not move.

    The faces of the body stay, in the same order, on vertices moved outwards: where two garments meet each has its
    own, so hems stand out from what is below. A skirt or coat and long hair come after them, with faces of their own.
    """
    garment = garments(body, look)
    rest = body.vertices.astype(float)
    corners = body.faces * len(Garment) + garment[:, None]
    pairs, faces = np.unique(corners, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    source, worn = pairs // len(Garment), pairs % len(Garment)

    arm = body.part == Part.ARM
    about = np.stack([np.bincount(faces[own].ravel(), minlength=len(pairs)) for own in (~arm, arm)])
    level, along_arm = (
        np.bincount(faces[own].ravel(), np.repeat(body.level[own], 3), len(pairs)) / np.maximum(count, 1)
        for own, count in zip((~arm, arm), about, strict=True)
    )
    normals = _vertex_normals(rest, body.faces)[source]
    normals[worn == Garment.SOLE, 2] = 0.0  # a shoe is wider than the foot, but stands on the same floor
    leg = (worn == Garment.TROUSERS) & (level > 1)
    normals[leg] = _flat(normals[leg])  # over the foot they look up, and would lift the hem
    vertices = _draped(rest[source], faces, garment, look.fit)
    vertices[leg, 2] -= look.fit * _BREAK * np.clip((level[leg] - 1.5) / 0.4, 0, 1)
    vertices = vertices + _thickness(worn, level, along_arm, about[1] / about.sum(0), look)[:, None] * normals
    dressed = replace(
        body,
        vertices=vertices.astype(np.float32),
        faces=faces,
        weight_bones=body.weight_bones[source],
        weights=body.weights[source],
        snug=len(vertices),
    )
    if look.hair_style != "short":
        dressed = _with(dressed, (long_hair if look.hair_style == "long" else bun)(dressed, volume=look.volume))
    if look.below != "trousers":
        hips, neck = (body.heads[body.index(bone), 2] for bone in ("LeftUpLeg", "Neck"))
        waist = hips + 0.75 * _WAIST * (neck - hips)
        shell, hang = skirt(dressed, top=waist, length=look.length, kind=look.below, ease=0.015 * look.fit)
        dressed = replace(_with(dressed, shell), skirt=replace(hang, first=len(dressed.vertices)))
    return dressed


def _with(body: Body, shell: Shell) -> Body:
    """A body and a shell in one."""
    return replace(
        body,
        vertices=np.concatenate([body.vertices, shell.vertices.astype(np.float32)]),
        faces=np.concatenate([body.faces, shell.faces + np.int32(len(body.vertices))]),
        part=np.append(body.part, np.full(len(shell.faces), shell.part, np.int8)),
        level=np.append(body.level, shell.level),
        weight_bones=np.concatenate([body.weight_bones, shell.weight_bones]),
        weights=np.concatenate([body.weights, shell.weights]),
    )


def _thickness(worn: NDArray[np.int64], level: Floats, along_arm: Floats, sleeve: Floats, look: Look) -> Floats:
    """Metres by which vertices (v,) stand out.

    Args:
        worn: their garments.
        level: mean level of the faces about them that are not on an arm.
        along_arm: of those that are.
        sleeve: share of those that are.
        look: how wide the clothes are.
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
    """Smooth tops and trousers within their hems, as cloth bridges what is hollow below it, the more the wider."""
    cloth = faces[(garment == Garment.TOP) | (garment == Garment.TROUSERS)]
    edges = np.sort(cloth[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    moves = np.zeros(len(vertices))
    moves[cloth] = _DRAPE
    moves[edges[count == 1]] = 0.0
    link = sparse.coo_array((np.ones(len(edges)), edges.T), (len(vertices),) * 2).tocsr()
    link = link + link.T
    mean = sparse.diags_array(1 / np.maximum(link.sum(axis=1), 1)) @ link
    for _ in range(round(np.interp(fit, (0, 1), _DRAPE_ROUNDS))):
        vertices = vertices + moves[:, None] * (mean @ vertices - vertices)
    return vertices


def _flat(normals: Floats) -> Floats:
    """Normals (v, 3) made level."""
    level = normals * [1, 1, 0]
    return level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-12)


def _vertex_normals(vertices: Floats, faces: NDArray[np.int32]) -> Floats:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None, :])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
