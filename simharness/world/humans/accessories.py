"""Glasses, hats, face masks and bags: how often people have them, and their colours.

Shares and their sources:

- Glasses: 52 % of women and 42 % of men wear glasses (Vision Council of America; 64 % of adults by VisionWatch 2008,
  which counts reading glasses). Seven of ten are assumed to wear them while they move around.
- Sunglasses and hats: 3 % and 10 %, as pedestrians in pictures of surveillance cameras (PETA, Deng et al., ACM
  Multimedia 2014, rounded). PETA has 20 % backpacks and 30 % shoulder bags; half of them here, because people in rooms
  put bags down.
- Which kind of hat, masks (3 %), hair styles and all colours are assumptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from simharness.world.humans.clothing_colors import Color, Palette, draw_color

GLASSES = ("none", "rectangular", "round", "sunglasses")
HATS = ("none", "cap", "beanie", "brimmed")
MASKS = ("none", "medical")
BAGS = ("none", "backpack", "shoulder")

_WEARERS = {"female": 0.52, "male": 0.42}
_WORN = 0.7
_SUNGLASSES = 0.03
_HATS: Mapping[str, float] = MappingProxyType({"cap": 0.05, "beanie": 0.03, "brimmed": 0.02})
_MASK = 0.03
_BAGS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {"female": {"backpack": 0.08, "shoulder": 0.20}, "male": {"backpack": 0.12, "shoulder": 0.10}}
)
_DRAWS = 24

# Name: hexadecimal sRGB albedo, share in per cent.
_FRAMES: Palette = MappingProxyType(
    {
        "black": ("18181a", 50),
        "brown": ("4a2f20", 25),
        "metal": ("8d8e92", 15),
        "red": ("6e2a2c", 5),
        "blue": ("2b3c5e", 5),
    }
)
_HAT_COLORS: Palette = MappingProxyType(
    {
        "black": ("232326", 35),
        "navy": ("28304a", 18),
        "grey": ("77787c", 13),
        "beige": ("b8a684", 10),
        "white": ("dedcd6", 8),
        "red": ("96302f", 6),
        "olive": ("565a40", 5),
        "blue": ("4a6791", 5),
    }
)
_BAG_COLORS: Palette = MappingProxyType(
    {
        "black": ("202023", 48),
        "charcoal": ("414248", 10),
        "navy": ("29324c", 12),
        "brown": ("5d4130", 11),
        "tan": ("9a7049", 6),
        "olive": ("585b42", 5),
        "red": ("8d3232", 4),
        "teal": ("34656b", 4),
    }
)
_MASK_COLORS: Palette = MappingProxyType({"blue": ("a9c6d8", 50), "white": ("e4e5e4", 30), "black": ("242427", 20)})


@dataclass(frozen=True)
class Accessories:
    """Accessories of one person; for the fields see :class:`simharness.world.humans.wardrobe.Look`."""

    glasses: str
    hat: str
    mask: str
    bag: str
    frame_color: Color
    hat_color: Color
    bag_color: Color
    mask_color: Color


def draw_accessories(rng: np.random.Generator, *, female: bool) -> Accessories:
    """Draw the accessories of one person from a random stream."""
    drawn = rng.random(_DRAWS).tolist()
    sex = "female" if female else "male"
    shape = "rectangular" if drawn[1] < 0.65 else "round"
    glasses = {shape: _WORN * _WEARERS[sex], "sunglasses": _SUNGLASSES}
    return Accessories(
        glasses=_choice(glasses, drawn[0]),
        hat=_choice(_HATS, drawn[2]),
        mask=_choice({"medical": _MASK}, drawn[3]),
        bag=_choice(_BAGS[sex], drawn[4]),
        frame_color=draw_color(_FRAMES, drawn[5], drawn[6], drawn[7]),
        hat_color=draw_color(_HAT_COLORS, drawn[8], drawn[9], drawn[10]),
        bag_color=draw_color(_BAG_COLORS, drawn[11], drawn[12], drawn[13]),
        mask_color=draw_color(_MASK_COLORS, drawn[14], drawn[15], drawn[16]),
    )


def _choice(shares: Mapping[str, float], drawn: float) -> str:
    """Return the choice at a place from 0 to 1 in cumulated shares; "none" behind the last."""
    for choice, share in shares.items():
        drawn -= share
        if drawn < 0:
            return choice
    return "none"
