"""Values of OpenCV's FileStorage: its rules for scalars and matrices, and a builder of nested values from events."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from mvpose.files.message_text import shown

_DEEPEST = 32  # structures in each other; a calibration has three
_INTEGER = re.compile(r"[-+]?(?:0[xX][0-9a-fA-F]{1,15}|[0-9]{1,18})")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_SPECIAL = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan, "-.nan": math.nan}
_MATRIX = {"dt", "data"}  # beside rows and cols, or sizes where the dimensions are not two
_TYPE = re.compile(r"([0-9]{0,3})([ucwsifdhHIUnNb])")  # channels and type of a matrix's elements


def scalar(text: str) -> int | float | str:
    """Return a scalar without quotes: a number, or else text. Nothing else is special: ``yes`` is text."""
    if _INTEGER.fullmatch(text):
        digits = text.lstrip("+-")
        base = 16 if digits[:2] in ("0x", "0X") else 8 if digits[0] == "0" and digits.isdigit() else 10
        try:
            return int(text, base)
        except ValueError:  # 08
            return float(text)
    if _REAL.fullmatch(text):
        return float(text)
    return _SPECIAL.get(text.lower(), text)


class Builder:
    """Builder of nested maps and lists, given their beginnings, ends and scalars in the order of a file.

    A map with the keys of a matrix becomes an array of floats when it ends.
    """

    def __init__(self) -> None:
        self._open: list[tuple[str, dict[str, Any] | list[Any]]] = []
        self.root: Any = None

    @property
    def depth(self) -> int:
        """Number of structures that have begun and not ended."""
        return len(self._open)

    def begin(self, structure: dict[str, Any] | list[Any], key: str = "") -> None:
        """Begin a map or a list, under a key where it is in a map.

        Raises:
            ValueError: nested too deeply.
        """
        if self.depth >= _DEEPEST:
            raise ValueError(f"nested more than {_DEEPEST} deep")
        self._open.append((key, structure))

    def end(self) -> None:
        """End the last structure that has begun.

        Raises:
            ValueError: a matrix whose size does not fit its data, or a repeated key.
        """
        key, structure = self._open.pop()
        matrix = isinstance(structure, dict) and structure.keys() >= _MATRIX
        self.add(matrix_of(structure) if matrix and isinstance(structure, dict) else structure, key)

    def add(self, value: Any, key: str = "") -> None:
        """Add a complete value to the last structure that has begun, under a key where that is a map.

        Raises:
            ValueError: a repeated key.
        """
        if not self._open:
            self.root = value
            return
        _, structure = self._open[-1]
        if isinstance(structure, list):
            structure.append(value)
        elif key in structure:
            raise ValueError(f"the name {shown(key)} stands twice; remove one of them")
        else:
            structure[key] = value


def with_matrices(value: Any) -> Any:
    """Return a JSON value with FileStorage's matrices, maps of ``rows cols dt data``, as arrays of floats.

    Raises:
        ValueError: a matrix whose size does not fit its data.
    """
    if isinstance(value, dict):
        if value.keys() >= _MATRIX:
            return matrix_of(value)
        return {key: with_matrices(each) for key, each in value.items()}
    return [with_matrices(each) for each in value] if isinstance(value, list) else value


def matrix_of(given: dict[str, Any]) -> np.ndarray:
    """Return a matrix of FileStorage: (rows, columns), (rows, columns, channels) or of its sizes.

    Raises:
        ValueError: an unknown type, or a size that does not fit the data.
    """
    data, kind = given["data"], _TYPE.fullmatch(str(given["dt"]))
    sides = given["sizes"] if "sizes" in given else [given.get("rows"), given.get("cols")]
    if kind is None:
        raise ValueError(f"a matrix has the type of elements {shown(given['dt'])}; expected d, f, i, u or another one")
    if not isinstance(sides, list) or not all(isinstance(side, int) and side >= 0 for side in sides):
        raise ValueError(f"a matrix has rows and cols {shown(sides)}; expected whole numbers")
    data = data if isinstance(data, list) else [data]
    if not all(isinstance(value, int | float) for value in data):
        raise ValueError("a matrix has data other than numbers")
    shape = [*sides, int(kind[1])] if kind[1] and int(kind[1]) > 1 else sides
    if math.prod(shape) != len(data):
        raise ValueError(f"a matrix of {' x '.join(map(str, shape))} has {len(data)} numbers")
    return np.array(data, float).reshape(shape)
