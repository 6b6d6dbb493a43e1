"""Colours that clothes have, and how often: black, white, grey, navy and denim dominate, saturated colours are rare.

Of 14,221 tops of a fashion shop, 25 % are black, 23 % white and 13 % red (statistics of the data set of Ping et al.,
"Fashion-AttGAN: attribute-aware fashion editing", arXiv 1904.07460). Black (with charcoal), white (with cream) and the
reds (red, burgundy, pink) of tops have these shares. The shares of the other colours, of trousers and of shoes
are an assumption: no published counts were found for them. The albedos are chosen by eye.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from pydantic import TypeAdapter

from mvpose.files.input_files import parse_toml

Color = tuple[float, float, float]
Palette = Mapping[str, tuple[str, float]]
"""Hexadecimal sRGB albedo and share in per cent of each colour."""

_FILE = Path(__file__).parent / "data" / "palettes.toml"

_LIGHTNESS, _WARMTH = 0.07, 0.012  # largest variation of a colour: relative, and between red and blue


@lru_cache(maxsize=1)
def _palettes() -> Mapping[str, Palette]:
    return TypeAdapter(dict[str, Palette]).validate_python(parse_toml(_FILE.read_text(encoding="utf-8")))


def palette(name: str) -> Palette:
    """Return the colours of "tops", "trousers", "shoes", "frames" (of glasses), "hats", "bags" or "masks"."""
    return _palettes()[name]


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
