"""Colours of faces of the mesh: expressions, beards, bald heads and locks of hair.

The shape of the head does not change. So bodies, their landmarks, their capsules and what rays see of them are the same
with every expression and beard. Which faces each colours was found on the mean body (``tools/body/faces.py``).

Colours that clothes have, and how often: black, white, grey, navy and denim dominate, saturated colours are rare.

Of 14,221 tops of a fashion shop, 25 % are black, 23 % white and 13 % red (statistics of the data set of Ping et al.,
"Fashion-AttGAN: attribute-aware fashion editing", arXiv 1904.07460). Black (with charcoal), white (with cream) and the
reds (red, burgundy, pink) of tops have these shares. The shares of the other colours, of trousers and of shoes
are an assumption: no published counts were found for them. The albedos are chosen by eye.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from mvpose.arrays import Floats
from mvpose.files.input_files import parse_toml
from simharness.world.humans.body import Body, FacePart, body_model

Color = tuple[float, float, float]
Palette = Mapping[str, tuple[str, float]]
"""Hexadecimal sRGB albedo and share in per cent of each colour."""

PALETTES: Mapping[str, Palette] = TypeAdapter(dict[str, Palette]).validate_python(
    parse_toml((Path(__file__).parent / "data" / "palettes.toml").read_text(encoding="utf-8"))
)
"""Colours of "tops", "trousers", "shoes", "frames" (of glasses), "hats", "bags" and "masks"."""

_LIGHTNESS, _WARMTH = 0.07, 0.012  # largest variation of a colour: relative, and between red and blue


def draw_color(palette: Palette, place: float, lightness: float, warmth: float) -> Color:
    """Return a colour of a palette with a small variation, because no two blacks are alike.

    Args:
        palette: colours with their shares in per cent.
        place: place in the cumulated shares, 0 to 1: evenly drawn places give the colours by their shares.
        lightness: variation of lightness, 0 darkest to 1 lightest.
        warmth: variation towards red, 0 coldest to 1 warmest.
    """
    code = palette[name_at(palette, place)][0]
    factor, shift = 1 + _LIGHTNESS * (2 * lightness - 1), _WARMTH * (2 * warmth - 1)
    red, green, blue = (int(code[i : i + 2], 16) / 255 * factor for i in (0, 2, 4))
    return min(red + shift, 1.0), min(green, 1.0), min(max(blue - shift, 0.0), 1.0)


def name_at(palette: Palette, place: float) -> str:
    """Return the name of the colour at a place in the cumulated shares of a palette, 0 to 1."""
    rest = place * sum(share for _, share in palette.values())
    for name, (_, share) in palette.items():
        rest -= share
        if rest < 0:
            return name
    return name


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
