"""Looks of people: colours, cuts, patterns and hair, drawn so that the people of a scene look distinct or alike.

Shares of accessories and their sources:

- Glasses: 52 % of women and 42 % of men wear glasses (Vision Council of America; 64 % of adults by VisionWatch 2008,
  which counts reading glasses). Seven of ten are assumed to wear them while they move around.
- Sunglasses and hats: 3 % and 10 %, as pedestrians in pictures of surveillance cameras (PETA, Deng et al., ACM
  Multimedia 2014, rounded). PETA has 20 % backpacks and 30 % shoulder bags; half of them here, because people in rooms
  put bags down.
- Which kind of hat, masks (3 %), hair styles and all colours are assumptions.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mvpose.files.input_files import parse_toml
from simharness.types.random_streams import stream
from simharness.world.humans.face_colors import EXPRESSIONS, PALETTES, Color, draw_color
from simharness.world.humans.population import draw_sex

GLASSES = ("none", "rectangular", "round", "sunglasses")
HATS = ("none", "cap", "beanie", "brimmed")
MASKS = ("none", "medical")
BAGS = ("none", "backpack", "shoulder")

LOOKS: Mapping[str, Any] = MappingProxyType(
    parse_toml((Path(__file__).parent / "data" / "looks.toml").read_text(encoding="utf-8"))
)
"""Tables of ``looks.toml``."""

_WORN, _SUNGLASSES, _RECTANGULAR = 0.7, 0.03, 0.65  # shares
_ACCESSORY_DRAWS = 24


def draw_accessories(rng: np.random.Generator, *, female: bool) -> dict[str, Any]:
    """Draw the accessories of one person from a random stream: the fields of :class:`Look` about them."""
    drawn = rng.random(_ACCESSORY_DRAWS).tolist()
    wearers = LOOKS["wearers"]["female" if female else "male"]
    shape = "rectangular" if drawn[1] < _RECTANGULAR else "round"
    glasses = {shape: _WORN * wearers["glasses"], "sunglasses": _SUNGLASSES}
    return {
        "glasses": _choice(glasses, drawn[0]),
        **{kind: _choice(wearers[kind], drawn[k]) for k, kind in enumerate(("hat", "mask", "bag"), 2)},
        **{
            f"{kind}_color": draw_color(PALETTES[f"{kind}s"], *drawn[k : k + 3])
            for k, kind in zip((5, 8, 11, 14), ("frame", "hat", "bag", "mask"), strict=True)
        },
    }


def _choice(shares: Mapping[str, float], drawn: float) -> str:
    """Return the choice at a place from 0 to 1 in cumulated shares; "none" behind the last."""
    for choice, share in shares.items():
        drawn -= share
        if drawn < 0:
            return choice
    return "none"


# Levels of a body's faces at which sleeves, trouser legs and shirts may end; the mesh has edges along each of them.
SLEEVES = {"short": 0.55, "half": 0.9, "long": 1.95}
LEGS = {"shorts": 0.7, "cropped": 1.55, "long": 1.93}
HEMS = {"tucked": 0.32, "loose": 0.13}
PATTERNS = ("plain", "stripes", "checks", "blocks")
LOWER_GARMENTS = ("trousers", "skirt", "dress", "coat")
HAIR_STYLES = ("short", "long", "bun", "bob", "ponytail", "curly")
REPEATS = (6, 24)
"""Least and greatest number of repeats of a pattern around the body; a multiple of six closes around limbs too."""

_CHOICES: dict[str, Collection[str]] = {"sleeves": SLEEVES, "legs": LEGS, "hem": HEMS, "lower_garment": LOWER_GARMENTS}
_CHOICES |= {"top_pattern": PATTERNS, "bottom_pattern": PATTERNS, "hair_style": HAIR_STYLES, "expression": EXPRESSIONS}
_CHOICES |= {"glasses": GLASSES, "hat": HATS, "mask": MASKS, "bag": BAGS}
_NUMBERS = {"volume": (0.0, 2.0), "fit": (0.0, 1.0), "length": (0.3, 1.0), "beard": (0.0, 1.0), "bald": (0.0, 1.0)}


@dataclass(frozen=True)
class Look:
    """Look of one person: colours (sRGB albedo, 0 to 1), cuts, patterns and hair.

    Attributes:
        skin, hair, lips, eyes, top, trousers, shoes: red, green, blue; ``trousers`` is also the colour of a skirt.
        accent: second colour of patterns.
        sleeves: length of the sleeves, one of ``SLEEVES``.
        legs: length of the trouser legs, one of ``LEGS``.
        hem: hem of the shirt, one of ``HEMS``.
        top_pattern, bottom_pattern: one of ``PATTERNS``.
        repeats: number of repeats of the patterns around the body, a multiple of six in ``REPEATS``.
        lower_garment: one of ``LOWER_GARMENTS``: trousers only, a skirt, a dress (a skirt of the same cloth as the
            top) or a coat (a dress over trousers).
        length: level of the hem of a skirt, dress or coat, 0.3 to 1, where 0 is the hip and 1 the knee.
        fit: width of the clothes, 0 close to 1 wide.
        hair_style: one of ``HAIR_STYLES``.
        volume: volume of the hair, 0 cropped to 2 full.
        beard: density of the beard, 0 none to 1 full; adults only.
        bald: extent of the bald skin, 0 none to 1 all but a rim; adults only.
        expression: expression of the face, one of ``EXPRESSIONS`` of :mod:`simharness.world.humans.face_colors`.
        glasses, hat, mask, bag: accessories, each "none" or one of ``GLASSES``, ``HATS``, ``MASKS``, ``BAGS`` of
            :mod:`simharness.world.humans.wardrobe`.
        frame_color, hat_color, mask_color, bag_color: their colours; ``frame_color`` is that of the glasses.

    Raises:
        ValueError: an unknown choice, or a number out of its range.
    """

    skin: Color
    hair: Color
    lips: Color
    eyes: Color
    top: Color
    trousers: Color
    shoes: Color
    accent: Color = (0.9, 0.9, 0.88)
    sleeves: str = "short"
    legs: str = "long"
    hem: str = "tucked"
    top_pattern: str = "plain"
    bottom_pattern: str = "plain"
    repeats: int = 12
    lower_garment: str = "trousers"
    length: float = 0.85
    fit: float = 0.3
    hair_style: str = "short"
    volume: float = 1.0
    beard: float = 0.0
    bald: float = 0.0
    expression: str = "neutral"
    glasses: str = "none"
    hat: str = "none"
    mask: str = "none"
    bag: str = "none"
    frame_color: Color = (0.1, 0.1, 0.1)
    hat_color: Color = (0.15, 0.15, 0.16)
    mask_color: Color = (0.66, 0.78, 0.85)
    bag_color: Color = (0.13, 0.13, 0.14)

    def __post_init__(self) -> None:
        for key, choices in _CHOICES.items():
            if getattr(self, key) not in choices:
                raise ValueError(f"look: {key} must be one of {', '.join(choices)}, got {getattr(self, key)!r}")
        for key, (low, high) in _NUMBERS.items():
            if not low <= getattr(self, key) <= high:
                raise ValueError(f"look: {key} must be from {low:g} to {high:g}, got {getattr(self, key)}")
        if self.repeats % 6 or not REPEATS[0] <= self.repeats <= REPEATS[1]:
            raise ValueError(f"look: repeats must be 6, 12, 18 or 24, got {self.repeats}")
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, tuple) and not (len(value) == 3 and all(0 <= v <= 1 for v in value)):
                raise ValueError(f"look: {entry.name} must be three numbers from 0 to 1, got {value!r}")


UNIFORM_COLORS = ("top", "trousers", "shoes", "accent", "hat_color", "bag_color")
UNIFORM_NUMBERS = ("fit", "length")
UNIFORM_CHOICES = ("sleeves", "legs", "hem", "top_pattern", "bottom_pattern", "repeats", "lower_garment", "hat", "bag")

_GOLDEN = (5**0.5 - 1) / 2
_DRAWS = 32
_CURLY, _CURLY_OF_DARK, _DARK = 0.08, 0.5, 0.42  # shares of short hair; skin darker than _DARK on average is dark
_BEARDS, _BALD, _CROPPED = 0.4, 0.25, 0.9  # shares of men, and of those with short hair below a volume of 0.9


def draw_look(rng: np.random.Generator, *, female: bool = False, place: float | None = None) -> Look:
    """Draw one look, with colours as clothes have them (:mod:`simharness.world.humans.face_colors`).

    Args:
        rng: random stream.
        female: whether women's clothes and hair styles may be drawn.
        place: place of the top's colour in the cumulated shares of the colours of tops, modulo 1; drawn if None.
    """
    drawn = rng.random(_DRAWS).tolist()
    place = drawn[0] if place is None else place
    sex = "female" if female else "male"
    skin = _between(LOOKS["skins"], drawn[1])
    lower_garment = _pick(LOOKS["lower_garments"][sex], drawn[12])
    top = draw_color(PALETTES["tops"], place % 1, drawn[4], drawn[5])
    return Look(
        skin=skin,
        hair=_color(_pick(LOOKS["hair"], drawn[1] + (1 - drawn[1]) * drawn[2])),
        lips=mix(skin, (0.62, 0.22, 0.22), 0.45),
        eyes=_color(_pick(LOOKS["eyes"], drawn[3])),
        top=top,
        trousers=draw_color(PALETTES["trousers"], drawn[6], drawn[20], drawn[21]),
        shoes=draw_color(PALETTES["shoes"], drawn[7], drawn[22], drawn[23]),
        accent=_contrasting(top, drawn[13]),
        sleeves="long" if lower_garment == "coat" else _pick(("short", "short", "half", "long", "long"), drawn[8]),
        legs="long" if lower_garment == "coat" else _pick(("shorts", "cropped", *("long",) * 4), drawn[9]),
        hem="tucked" if lower_garment != "trousers" else _pick(("tucked", "loose"), drawn[10]),
        top_pattern="plain" if lower_garment == "coat" else _pick(LOOKS["top_patterns"], drawn[14]),
        bottom_pattern=_pick(("plain", "checks", "stripes"), drawn[15]) if lower_garment == "skirt" else "plain",
        repeats=6 * (2 + int(3 * drawn[16])),
        lower_garment=lower_garment,
        length=0.6 + 0.38 * drawn[17],
        fit=drawn[18] ** 1.5,
        hair_style=_pick(LOOKS["hair_styles"][sex], drawn[19]),
        volume=0.2 + 1.5 * drawn[11],
    )


def draw_looks(seed: int, count: int, *, look_alike: float = 0.0, alike: int = 0) -> tuple[Look, ...]:
    """Draw the looks of ``count`` people of one scene.

    At ``look_alike`` 0 people are as easy to distinguish as people in a street are. The colours of their tops step
    through the cumulated shares of clothing colours by the golden ratio, which spreads any number of places well: every
    colour is as frequent as in the shares, few people of a scene have the same one, and an additional person does not
    change the looks of the others. At 1 all wear the same uniform; skin, hair and body remain individual. In between,
    colours and widths are mixed in proportion, and every cut or pattern switches to the uniform at a separate value,
    drawn once for the scene. Hats and bags, and their colours, belong to the uniform; glasses and masks are individual,
    as hair is. So the looks of any two people come closer as ``look_alike`` grows.

    Args:
        seed: seed of the scene.
        count: number of people.
        look_alike: similarity of the clothes, 0 to 1.
        alike: number of people, from the first, that ``look_alike`` applies to; 0 for all.

    Raises:
        ValueError: ``look_alike`` is not in 0 to 1.
    """
    if not 0 <= look_alike <= 1:
        raise ValueError(f"look_alike must be from 0 to 1, got {look_alike}")
    start = stream(seed, "people", "hue").random()
    worn = draw_accessories(stream(seed, "people", "uniform", "accessories"), female=False)
    uniform = replace(draw_look(stream(seed, "people", "uniform")), **worn)
    changes = stream(seed, "people", "uniform", "changes").random(len(UNIFORM_CHOICES)) < look_alike
    looks = []
    for i in range(count):
        female = draw_sex(stream(seed, "people", i, "shape")) == "female"
        look = draw_look(stream(seed, "people", i, "look"), female=female, place=float(start + i * _GOLDEN))
        if not female:
            look = _groomed(look, stream(seed, "people", i, "grooming"))
        look = _styled(look, stream(seed, "people", i, "hair style"), female=female)
        worn = draw_accessories(stream(seed, "people", i, "accessories"), female=female)
        expression = _pick(LOOKS["expressions"], float(stream(seed, "people", i, "expression").random()))
        look = replace(look, expression=expression, **worn)
        looks.append(_toward(look, uniform, look_alike, changes.tolist()) if i < (alike or count) else look)
    return tuple(looks)


def _groomed(look: Look, rng: np.random.Generator) -> Look:
    """Return the look of a man with a beard or a bald head drawn; the rates are assumptions."""
    with_beard, density, with_bald, extent = rng.random(4).tolist()
    cropped = look.hair_style == "short" and look.volume < _CROPPED
    return replace(
        look,
        beard=0.25 + 0.75 * density if with_beard < _BEARDS else 0.0,
        bald=0.3 + 0.7 * extent if cropped and with_bald < _BALD else 0.0,
    )


def _styled(look: Look, rng: np.random.Generator, *, female: bool) -> Look:
    """Return the look with a bob, a ponytail or curly hair in place of short or long hair; rates are assumptions."""
    of_women, curls = rng.random(2).tolist()
    if look.hair_style == "short" and not look.bald:
        dark = sum(look.skin) / 3 < _DARK
        if curls < (_CURLY_OF_DARK if dark else _CURLY):
            return replace(look, hair_style="curly")
    if female:
        for style, share in LOOKS["instead"].get(look.hair_style, {}).items():
            if of_women < share:
                return replace(look, hair_style=style)
    return look


def _toward(look: Look, uniform: Look, share: float, changes: list[bool]) -> Look:
    """Return a look with clothes mixed with a ``share`` of a uniform, and with the uniform's changed choices (c,)."""
    clothes: dict[str, Any] = {key: mix(getattr(look, key), getattr(uniform, key), share) for key in UNIFORM_COLORS}
    clothes |= {key: (1 - share) * getattr(look, key) + share * getattr(uniform, key) for key in UNIFORM_NUMBERS}
    clothes |= {key: getattr(uniform, key) for key, changed in zip(UNIFORM_CHOICES, changes, strict=True) if changed}
    return replace(look, **clothes)


def camouflaged(look: Look, color: Color, share: float) -> Look:
    """Return a look whose clothes, hat and bag have a ``share`` of a color, such as that of the walls, mixed in."""
    clothes: dict[str, Any] = {key: mix(getattr(look, key), color, share) for key in UNIFORM_COLORS}
    return replace(look, **clothes)


def _contrasting(color: Color, share: float) -> Color:
    """Pick an accent colour whose lightness differs clearly from that of a colour; ``share`` 0 to 1 selects it."""
    accents = [_color(code) for code in LOOKS["accents"]]
    contrast = [abs(sum(accent) - sum(color)) / 3 for accent in accents]
    candidates = [accent for accent, value in zip(accents, contrast, strict=True) if value >= sorted(contrast)[-3]]
    return candidates[min(int(share * len(candidates)), len(candidates) - 1)]


def _pick(choices: Sequence[str], share: float) -> str:
    return choices[min(int(share * len(choices)), len(choices) - 1)]


def _color(code: str) -> Color:
    """Return the colour of a hexadecimal code."""
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


def _between(codes: Sequence[str], share: float) -> Color:
    """Interpolate in a scale of hexadecimal colours, ``share`` 0 at the first to 1 at the last."""
    place = share * (len(codes) - 1)
    low = min(int(place), len(codes) - 2)
    return mix(_color(codes[low]), _color(codes[low + 1]), place - low)


def mix(first: Color, second: Color, share: float) -> Color:
    """Interpolate between two colours: ``share`` 0 gives the first, 1 the second."""
    red, green, blue = ((1 - share) * a + share * b for a, b in zip(first, second, strict=True))
    return red, green, blue
