"""What a network's file does not say by itself: how its input is made, and what its output means."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, Self

Colour = tuple[float, float, float]

PREFIX = "mvpose."
"""Before every key of a card in an ONNX file's ``metadata_props``: other programs keep theirs there too."""

_CHOICES = {"color_order": ("rgb", "bgr"), "cells": ("stride", "span", "area")}


@dataclass(frozen=True, kw_only=True)
class Card:
    """How to feed a network and how to read it. The defaults are those of the field: RGB, ImageNet normalisation.

    A card travels in the ONNX file: each field is an entry ``mvpose.<field>`` of ``metadata_props``, as JSON
    (``mvpose.mean`` = ``[0.485, 0.456, 0.406]``); fields at their defaults are left out. For a file of someone else's
    that carries none and needs one, state it beside the file.

    Attributes:
        name: how messages and reports call the network.
        size: width and height of the input in pixels; only needed where the file leaves them open.
        mean: subtracted from red, green and blue in 0..1. A network that takes 0..255 as they come has mean 0 and
            std 1/255.
        std: what the difference is divided by.
        color_order: in which the channels are fed.
        outputs: names of the outputs to read, in order; all where empty.
        midpoint: re-ID: distance of two unit descriptors at which they are as likely as not of one person.
        slope: re-ID: distance over which that likelihood falls from 1/2 to 1/(1 + e).
        padding: pose: the crop's size over that of the box.
        peak: pose: height of a heat map, or of a SimCC vector, where the network is sure.
        cells: pose: which pixel of the input, W wide, cell k of w stands for. ``stride``: k W/w, as heads trained by
            HRNet's or SimpleBaseline's code and SimCC heads have it; ``span``: k (W - 1)/(w - 1), unbiased data
            processing (UDP; ViTPose); ``area``: the middle of the W/w pixels that the cell covers (CPN).

    Raises:
        ValueError: a value that cannot be, with the field's name.
    """

    name: str = ""
    size: tuple[int, int] | None = None
    mean: Colour = (0.485, 0.456, 0.406)
    std: Colour = (0.229, 0.224, 0.225)
    color_order: Literal["rgb", "bgr"] = "rgb"
    outputs: tuple[str, ...] = ()
    midpoint: float | None = None
    slope: float | None = None
    padding: float = 1.25
    peak: float = 1.0
    cells: Literal["stride", "span", "area"] = "stride"

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", _numbers("mean", self.mean))
        object.__setattr__(self, "std", _numbers("std", self.std))
        if min(self.std) <= 0:
            raise ValueError(f"card: std must be three positive numbers, got {self.std}")
        if self.size is not None:
            object.__setattr__(self, "size", _size(self.size))
        if not isinstance(self.name, str):
            raise ValueError(f"card: name must be text, got {self.name!r}")
        object.__setattr__(self, "outputs", _names("outputs", self.outputs))
        for key in ("midpoint", "slope", "padding", "peak"):
            value = getattr(self, key)
            unstated = value is None and key in ("midpoint", "slope")
            if not unstated and not (_is_number(value) and value > 0):
                raise ValueError(f"card: {key} must be a positive number, got {value!r}")
        for key, choices in _CHOICES.items():
            if getattr(self, key) not in choices:
                raise ValueError(f"card: {key} must be one of {', '.join(choices)}, got {getattr(self, key)!r}")
        if (self.midpoint is None) != (self.slope is None):
            raise ValueError("card: midpoint and slope make one sigmoid: state both or neither")

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> Self:
        """The card among a file's ``metadata_props``; other entries are passed over.

        Raises:
            ValueError: an entry that begins like ours and is none of the fields, is not JSON, or cannot be.
        """
        known = [field.name for field in fields(cls)]
        stated: dict[str, Any] = {}
        for entry, text in metadata.items():
            if not entry.startswith(PREFIX):
                continue
            key = entry.removeprefix(PREFIX)
            if key not in known:
                raise ValueError(f"card: no field {key!r} (metadata entry {entry!r}); there are {', '.join(known)}")
            try:
                value = json.loads(text)
            except json.JSONDecodeError as error:
                raise ValueError(f"card: metadata entry {entry!r} must be JSON, got {text!r}: {error}") from None
            stated[key] = tuple(value) if isinstance(value, list) else value
        return cls(**stated)

    def to_metadata(self) -> dict[str, str]:
        """The card as entries of ``metadata_props``, for whoever writes the file (``onnx.helper.set_model_props``)."""
        return {
            PREFIX + field.name: json.dumps(getattr(self, field.name))
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }


def _is_number(value: object) -> bool:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond every float
        return False


def _numbers(key: str, values: Any) -> Colour:
    try:
        red, green, blue = values
    except (TypeError, ValueError):
        red = green = blue = None
    if not (_is_number(red) and _is_number(green) and _is_number(blue)):
        raise ValueError(f"card: {key} must be three numbers, red green blue, got {values!r}")
    return float(red), float(green), float(blue)


def _names(key: str, values: Any) -> tuple[str, ...]:
    listed = tuple(values) if isinstance(values, Iterable) and not isinstance(values, (str, bytes, Mapping)) else None
    if listed is None or not all(isinstance(name, str) for name in listed):
        raise ValueError(f"card: {key} must be names in a tuple, got {values!r}")
    return listed


def _size(value: Any) -> tuple[int, int]:
    try:
        width, height = value
        whole = width == int(width) and height == int(height) and width > 0 and height > 0
        whole = whole and not isinstance(width, bool) and not isinstance(height, bool)
    except (TypeError, ValueError, OverflowError):
        whole = False
    if not whole:
        raise ValueError(f"card: size must be width and height, two positive whole numbers of pixels, got {value!r}")
    return int(width), int(height)
