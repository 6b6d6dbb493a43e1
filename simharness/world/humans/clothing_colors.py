"""Colours that clothes have, and how often: black, white, grey, navy and denim dominate, saturated colours are rare.

Of 14,221 tops of a fashion shop, 25 % are black, 23 % white and 13 % red (statistics of the data set of Ping et al.,
"Fashion-AttGAN: attribute-aware fashion editing", arXiv 1904.07460). Black (with charcoal), white (with cream) and the
reds (red, burgundy, pink) of ``TOPS`` have these shares. The shares of the other colours, of trousers and of shoes
are an assumption: no published counts were found for them. The albedos are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

Color = tuple[float, float, float]
Palette = Mapping[str, tuple[str, float]]

# Name: hexadecimal sRGB albedo, share in per cent. Similar colours are neighbours, so that people whose places in the
# order are far apart look different.
TOPS: Palette = MappingProxyType(
    {
        "black": ("222225", 20.0),
        "charcoal": ("3d3e43", 5.2),
        "navy": ("28304a", 9.0),
        "blue": ("4a6791", 5.5),
        "teal": ("33656a", 0.7),
        "green": ("456550", 1.8),
        "olive": ("5b5d42", 2.0),
        "brown": ("6d503c", 2.3),
        "burgundy": ("642836", 4.3),
        "red": ("a23336", 4.8),
        "orange": ("bd6b42", 0.5),
        "purple": ("62507a", 0.9),
        "pink": ("d2a3a8", 4.0),
        "yellow": ("cfae58", 0.6),
        "beige": ("c8b799", 2.6),
        "grey": ("818287", 5.8),
        "pale blue": ("a3b8cf", 3.5),
        "pale grey": ("b7b7b5", 3.5),
        "cream": ("ddd6c6", 4.0),
        "white": ("e6e5e1", 19.0),
    }
)
TROUSERS: Palette = MappingProxyType(
    {
        "black": ("222326", 24.0),
        "charcoal": ("3b3c41", 7.0),
        "navy": ("293149", 8.0),
        "dark denim": ("2f3d5c", 16.0),
        "denim": ("4c658c", 16.0),
        "pale denim": ("8699b2", 6.0),
        "grey": ("74767b", 6.0),
        "olive": ("595b42", 3.0),
        "brown": ("5e4a3b", 3.0),
        "khaki": ("ab9a7c", 9.0),
        "white": ("dbd9d3", 2.0),
    }
)
SHOES: Palette = MappingProxyType(
    {
        "black": ("1e1e21", 40.0),
        "brown": ("6b4a33", 15.0),
        "red": ("8a3131", 3.0),
        "navy": ("303a50", 5.0),
        "grey": ("77797d", 12.0),
        "white": ("dcdad5", 25.0),
    }
)
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
