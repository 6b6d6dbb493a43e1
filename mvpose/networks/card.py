"""Model card: input normalisation and output conventions of a network, which its ONNX file does not state.

An ONNX file holds its card, or a JSON file of its name beside it, with the digest of the network and what was measured
of it.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, Self

Colour = tuple[float, float, float]

PREFIX = "mvpose."
"""Prefix of the card's keys in the ``metadata_props`` of an ONNX file, which other programs also use."""

_CHOICES = {"color_order": ("rgb", "bgr"), "cells": ("stride", "span", "area")}

_LARGEST = 2**24  # bytes; a card has some kilobytes


@dataclass(frozen=True, kw_only=True)
class Card:
    """Model card of a network. The defaults are the common convention: RGB with ImageNet normalisation.

    A card is stored in the ONNX file: each field is an entry ``mvpose.<field>`` of ``metadata_props``, as JSON
    (``mvpose.mean`` = ``[0.485, 0.456, 0.406]``); fields at their defaults are left out. For a file without a card,
    pass one to :class:`mvpose.networks.Session`.

    Raises:
        ValueError: an invalid value; the message names the field.
    """

    name: str = ""
    """Name of the network in messages and reports."""
    size: tuple[int, int] | None = None
    """Width and height of the input in pixels; needed only if the file leaves them open."""
    mean: Colour = (0.485, 0.456, 0.406)
    """Value subtracted from red, green and blue in 0..1. A network that takes unnormalised 0..255 has mean 0 and std
    1/255."""
    std: Colour = (0.229, 0.224, 0.225)
    """Divisor of the difference."""
    color_order: Literal["rgb", "bgr"] = "rgb"
    """Order of the input channels."""
    outputs: tuple[str, ...] = ()
    """Names of the outputs to read, in order; empty for all."""
    midpoint: float | None = None
    """Re-ID: distance of two unit descriptors at affinity 1/2."""
    slope: float | None = None
    """Re-ID: distance over which the affinity falls from 1/2 to 1/(1 + e)."""
    padding: float = 1.25
    """Pose: size of the crop over the size of the box."""
    peak: float = 1.0
    """Pose: height of a confident peak of a heat map, or of a SimCC vector."""
    cells: Literal["stride", "span", "area"] = "stride"
    """Pose: pixel of the input, W wide, that corresponds to cell k of w. ``stride``: k W/w, for heads trained with the
    code of HRNet or SimpleBaseline and for SimCC heads; ``span``: k (W - 1)/(w - 1), unbiased data processing (UDP;
    ViTPose); ``area``: the centre of the W/w pixels that the cell covers (CPN)."""

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
            optional = value is None and key in ("midpoint", "slope")
            if not optional and not (_is_number(value) and value > 0):
                raise ValueError(f"card: {key} must be a positive number, got {value!r}")
        for key, choices in _CHOICES.items():
            if getattr(self, key) not in choices:
                raise ValueError(f"card: {key} must be one of {', '.join(choices)}, got {getattr(self, key)!r}")
        if (self.midpoint is None) != (self.slope is None):
            raise ValueError(
                f"card: midpoint and slope define one sigmoid, got {self.midpoint} and {self.slope}: "
                "give both or neither"
            )

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> Self:
        """Read the card from the ``metadata_props`` of a file; entries without the prefix are ignored.

        Raises:
            ValueError: an entry with the prefix that is not a field, is not JSON, or has an invalid value.
        """
        known = [field.name for field in fields(cls)]
        values: dict[str, Any] = {}
        for entry, text in metadata.items():
            if not entry.startswith(PREFIX):
                continue
            key = entry.removeprefix(PREFIX)
            if key not in known:
                raise ValueError(
                    f"card: unknown field {key[:60]!r} (metadata entry {entry[:60]!r}); expected one of "
                    f"{', '.join(known)}"
                )
            try:
                value = json.loads(text)
            except (ValueError, RecursionError) as error:
                raise ValueError(f"card: metadata entry {entry!r} must be JSON, got {text[:60]!r}: {error}") from None
            values[key] = tuple(value) if isinstance(value, list) else value
        return cls(**values)

    def to_metadata(self) -> dict[str, str]:
        """Return the card as entries of ``metadata_props``, to be written by ``onnx.helper.set_model_props``."""
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
    except OverflowError:  # an integer beyond the range of floats
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
    names = tuple(values) if isinstance(values, Iterable) and not isinstance(values, (str, bytes, Mapping)) else None
    if names is None or not all(isinstance(name, str) for name in names):
        raise ValueError(f"card: {key} must be a tuple of names, got {values!r}")
    return names


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


def read_card_file(network: Path) -> dict[str, Any] | None:
    """Return the content of the card beside a network; None where there is no card.

    Args:
        network: ONNX file; its card is the ``.json`` file of the same name.

    Raises:
        ValueError: there is a card and it cannot be read: no regular file, too large, not JSON, or no object.
    """
    card = network.with_suffix(".json")
    if not card.exists():
        return None
    try:
        if not card.is_file():  # a pipe or a device could be read for ever
            raise ValueError("it is no regular file")
        if (size := card.stat().st_size) > _LARGEST:
            raise ValueError(f"it has {size} bytes, expected at most {_LARGEST}")
        content = json.loads(card.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        why = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ValueError(
            f"{card}: cannot be read as the card of {network.name}: {why}. Copy both again from their source, or "
            "remove the card if this network is intended without one"
        ) from None
    if not isinstance(content, dict):
        raise ValueError(
            f"{card}: expected the card of {network.name}, a JSON object, got a {type(content).__name__}; copy both "
            "again from their source"
        )
    return content
