"""What people wear: colours by body part, drawn so that the people of one scene are easy to tell apart."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, fields, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from simharness.humans.body import Body, Part
from simharness.random import stream

Color = tuple[float, float, float]


class Garment(IntEnum):
    """What covers a face."""

    NONE = 0
    HAIR = 1
    TOP = 2
    TROUSERS = 3
    SHOE = 4
    SOLE = 5


# Where sleeves, trouser legs and shirts may end, as levels of a body's faces: the mesh has an edge along each.
SLEEVES = {"short": 0.55, "half": 0.9, "long": 1.95}
LEGS = {"shorts": 0.7, "cropped": 1.55, "long": 1.93}
HEMS = {"tucked": 0.32, "loose": 0.13}


@dataclass(frozen=True)
class Look:
    """Colours (albedo, 0 to 1, linear in what the renderer multiplies light with) and the cut of the clothes.

    Attributes:
        skin, hair, lips, eyes, top, trousers, shoes: red, green, blue.
        sleeves: one of ``SLEEVES``. legs: one of ``LEGS``. hem: of the shirt, one of ``HEMS``.
        volume: of the hair, 0 cropped to 2 full.
    """

    skin: Color
    hair: Color
    lips: Color
    eyes: Color
    top: Color
    trousers: Color
    shoes: Color
    sleeves: str = "short"
    legs: str = "long"
    hem: str = "tucked"
    volume: float = 1.0

    def __post_init__(self) -> None:
        for key, choices in (("sleeves", SLEEVES), ("legs", LEGS), ("hem", HEMS)):
            if getattr(self, key) not in choices:
                raise ValueError(f"look: {key} must be one of {', '.join(choices)}, got {getattr(self, key)!r}")
        if not 0 <= self.volume <= 2:
            raise ValueError(f"look: volume must be from 0 to 2, got {self.volume}")
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, tuple) and not (len(value) == 3 and all(0 <= v <= 1 for v in value)):
                raise ValueError(f"look: {entry.name} must be three numbers from 0 to 1, got {value!r}")


# Albedos, by eye. Hair runs from fair to dark as skins do, so that a share of the one goes with a share of the other.
_SKINS = ("efcdb8", "e2b798", "cf9d7b", "b67f5e", "925f46", "6b4331", "4a2e23")
_HAIR = ("c8a468", "8d6a3f", "8c8a88", "6b3a22", "5a3f2a", "3b281d", "2a1d17", "1b1512", "151112")
_TROUSERS = ("2b3550", "3d5a80", "26282d", "5a5650", "8c7b60", "4a3f38", "6c7480")
_SHOES = ("1c1c20", "dcdad5", "6b4630", "3a3f4a", "8a2f2b")
_EYES = ("2a1b12", "3d5468", "3f4f36", "22160f")
_SCLERA: Color = (0.9, 0.9, 0.88)
_SOLE: Color = (0.85, 0.85, 0.83)
_GOLDEN = (5**0.5 - 1) / 2
_DRAPE, _DRAPE_ROUNDS = 0.5, 6


def draw_look(rng: np.random.Generator, *, hue: float | None = None) -> Look:
    """Draw one look; ``hue`` (0 to 1, around the colour circle) of the top where it shall not be drawn."""
    drawn = rng.random(16).tolist()
    hue = drawn[0] if hue is None else hue
    skin = _between(_SKINS, drawn[1])
    return Look(
        skin=skin,
        hair=_color(_pick(_HAIR, drawn[1] + (1 - drawn[1]) * drawn[2])),
        lips=_mix(skin, (0.62, 0.22, 0.22), 0.45),
        eyes=_color(_pick(_EYES, drawn[3])),
        top=colorsys.hsv_to_rgb(hue % 1, 0.55 + 0.35 * drawn[4], 0.55 + 0.4 * drawn[5]),
        trousers=_color(_pick(_TROUSERS, drawn[6])),
        shoes=_color(_pick(_SHOES, drawn[7])),
        sleeves=_pick(("short", "short", "half", "long", "long"), drawn[8]),
        legs=_pick(("shorts", "cropped", "long", "long", "long", "long"), drawn[9]),
        hem=_pick(("tucked", "loose"), drawn[10]),
        volume=0.2 + 1.5 * drawn[11],
    )


def draw_looks(seed: int, count: int) -> tuple[Look, ...]:
    """Draw the looks of ``count`` people of one scene, easy to tell apart by the hues of their tops.

    The hues step around the circle by the golden section, which spreads any number of them well; so one more
    person changes nobody else's look.
    """
    start = stream(seed, "people", "hue").random()
    return tuple(draw_look(stream(seed, "people", i, "look"), hue=float(start + i * _GOLDEN)) for i in range(count))


def face_colors(body: Body, look: Look) -> NDArray[np.float32]:
    """Albedo of every face of a body, dressed or not, (k, 3) float32."""
    palette = np.array([look.skin, look.hair, look.top, look.trousers, look.shoes, _SOLE], np.float32)
    colors = palette[garments(body, look)]
    colors[body.part == Part.BROW] = _mix(look.hair, look.skin, 0.3)
    colors[body.part == Part.LIPS] = look.lips
    colors[body.part == Part.SCLERA] = _SCLERA
    colors[body.part == Part.IRIS] = look.eyes
    return colors


def garments(body: Body, look: Look) -> NDArray[np.int64]:
    """What covers every face of a body, (k,) :class:`Garment`."""
    part, level = body.part, body.level
    result = np.full(len(part), int(Garment.NONE))
    result[part == Part.SCALP] = Garment.HAIR
    trunk = part == Part.TORSO
    result[(trunk & (level >= HEMS[look.hem])) | ((part == Part.ARM) & (level < SLEEVES[look.sleeves]))] = Garment.TOP
    result[(trunk & (level < HEMS[look.hem])) | ((part == Part.LEG) & (level < LEGS[look.legs]))] = Garment.TROUSERS
    result[part == Part.SHOE] = Garment.SHOE
    result[part == Part.SOLE] = Garment.SOLE
    return result


def dress(body: Body, look: Look) -> Body:
    """Give clothes and hair their thickness: the same faces, in the same order, on vertices moved outwards.

    Where two garments meet each has its own vertices, so hems stand out from what is below. Joints do not move.
    """
    garment = garments(body, look)
    rest = body.vertices.astype(float)
    corners = body.faces * len(Garment) + garment[:, None]
    pairs, faces = np.unique(corners, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    source, worn = pairs // len(Garment), pairs % len(Garment)

    level = np.zeros(len(pairs))
    np.add.at(level, faces, body.level[:, None].astype(float))
    level /= np.bincount(faces.ravel(), minlength=len(pairs))
    normals = _vertex_normals(rest, body.faces)[source]
    normals[worn == Garment.SOLE, 2] = 0.0  # a shoe is wider than the foot, but stands on the same floor
    vertices = _draped(rest[source], faces, garment) + _thickness(worn, level, look.volume)[:, None] * normals
    return replace(
        body,
        vertices=vertices.astype(np.float32),
        faces=faces,
        weight_bones=body.weight_bones[source],
        weights=body.weights[source],
    )


def _thickness(worn: NDArray[np.int64], level: NDArray[np.float64], volume: float) -> NDArray[np.float64]:
    """Metres by which vertices (v,) stand out, by garment and by the mean level of the faces about them."""
    collar = np.clip((level - 0.8) / 0.2, 0, 1)
    return np.select(
        [worn == Garment.HAIR, worn == Garment.TOP, worn == Garment.TROUSERS, worn >= Garment.SHOE],
        [0.015 * volume * level * (2 - level), 0.010 - 0.006 * collar, 0.008 + 0.006 * level, 0.004],
        0.0,
    )


def _draped(vertices: NDArray[np.float64], faces: NDArray[np.int32], garment: NDArray[np.int64]) -> NDArray[np.float64]:
    """Smooth tops and trousers within their hems, as cloth bridges what is hollow below it."""
    cloth = faces[(garment == Garment.TOP) | (garment == Garment.TROUSERS)]
    edges = np.sort(cloth[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    moves = np.zeros(len(vertices))
    moves[cloth] = _DRAPE
    moves[edges[count == 1]] = 0.0
    link = sparse.coo_array((np.ones(len(edges)), edges.T), (len(vertices),) * 2).tocsr()
    link = link + link.T
    mean = sparse.diags_array(1 / np.maximum(link.sum(axis=1), 1)) @ link
    for _ in range(_DRAPE_ROUNDS):
        vertices = vertices + moves[:, None] * (mean @ vertices - vertices)
    return vertices


def _vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None, :])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _pick(choices: tuple[str, ...], share: float) -> str:
    return choices[min(int(share * len(choices)), len(choices) - 1)]


def _color(code: str) -> Color:
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


def _between(codes: tuple[str, ...], share: float) -> Color:
    place = share * (len(codes) - 1)
    low = min(int(place), len(codes) - 2)
    return _mix(_color(codes[low]), _color(codes[low + 1]), place - low)


def _mix(first: Color, second: Color, share: float) -> Color:
    red, green, blue = ((1 - share) * a + share * b for a, b in zip(first, second, strict=True))
    return red, green, blue
