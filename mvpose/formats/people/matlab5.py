"""Numbers and cells of MATLAB 5 files ("MAT-File Format", MathWorks, chapter 1), which may be damaged.

SciPy's reader is not used: on some damaged files it crashes the process. Only what the truth of Shelf and Campus needs
is read: arrays of real numbers, and cells of them.
"""

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.files.archives import MOST
from mvpose.files.input_files import megabytes
from mvpose.files.message_text import shown

_HEADER, _TAG = 128, 8  # bytes
_ARRAY, _COMPRESSED = 14, 15  # types of elements: an array, and another element deflated
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CELL, _REAL = 1, range(6, 16)  # classes of arrays: cells, and the types of numbers
_COMPLEX = 0x800
_DEEPEST = 8  # cells in each other; Shelf's and Campus's truth have three


def read_variable(content: bytes, name: str) -> NDArray[Any] | None:
    """Return a variable of a file: an array of numbers, or an array of objects where it has cells.

    Args:
        content: bytes of the file.
        name: name of the variable.

    Returns:
        The variable; None where the file has none of this name.

    Raises:
        ValueError: no MATLAB 5 file, or a truncated or damaged one; or the variable has text, structures or complex
            numbers, or is larger than :data:`mvpose.files.archives.MOST` bytes.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[_HEADER - 2 : _HEADER])
    if not content.startswith(b"MATLAB 5.0") or order is None:
        raise ValueError("it does not begin as a MATLAB 5 file")
    found = None
    for given in _elements(content[_HEADER:], order, padded=False):
        deflated = given.kind == _COMPRESSED
        for element in _elements(_inflated(given.data), order, padded=False) if deflated else [given]:
            if element.kind != _ARRAY:
                raise ValueError(f"an element of type {element.kind} where an array was expected")
            if _name(element.data, order) == name:
                found = _array(element.data, order)
    return found


@dataclass(frozen=True)
class _Element:
    """An element of a file: its type and its bytes."""

    kind: int
    data: bytes


def _elements(content: bytes, order: str, *, padded: bool = True) -> list[_Element]:
    """Return the elements that stand beside each other.

    Args:
        content: their bytes.
        order: byte order, "<" or ">".
        padded: whether each begins at a multiple of eight bytes, as within arrays.
    """
    elements, start = [], 0
    while start < len(content):
        if start + _TAG > len(content):
            raise ValueError("its last element is cut off")
        kind, size = struct.unpack_from(f"{order}II", content, start)
        small = kind >> 16  # size of an element whose values are in the tag
        first, size = (start + 4, small) if small else (start + _TAG, size)
        end = first + size
        if small > 4 or end > len(content):
            raise ValueError("its last element is cut off")
        elements.append(_Element(kind & 0xFFFF, content[first:end]))
        start = start + _TAG if small else end + (-size % 8 if padded else 0)
    return elements


def _inflated(data: bytes) -> bytes:
    inflater = zlib.decompressobj()
    try:
        content = inflater.decompress(data, MOST + 1)
    except zlib.error as error:
        raise ValueError(f"an element is damaged: {error}") from None
    if len(content) > MOST:
        raise ValueError(f"it unpacks to more than {megabytes(MOST)}")
    if not inflater.eof:
        raise ValueError("an element is cut off")
    return content


def _name(data: bytes, order: str) -> str:
    """Return the name of an array; "" where it has none."""
    parts = _elements(data, order)
    return parts[2].data.decode("latin-1") if len(parts) > 2 else ""


def _array(data: bytes, order: str, depth: int = 1) -> NDArray[Any]:
    """Return an array of numbers, or of cells."""
    if not data:
        return np.zeros((1, 0))
    if depth > _DEEPEST:
        raise ValueError(f"cells nested more than {_DEEPEST} deep")
    parts = _elements(data, order)
    if len(parts) < 3 or len(parts[0].data) < 4 or len(parts[1].data) % 4:
        raise ValueError("an array without class, extents and name")
    flags, extents, _, *values = parts
    bits = struct.unpack_from(f"{order}I", flags.data)[0]
    shape = struct.unpack(f"{order}{len(extents.data) // 4}i", extents.data)
    count = math.prod(shape)
    if min(shape, default=-1) < 0 or count > len(data):
        raise ValueError(f"an array of {shown(shape)} has {len(data)} bytes")
    if bits & 0xFF == _CELL:
        if count != len(values) or any(each.kind != _ARRAY for each in values):
            raise ValueError(f"cells of {shown(shape)} hold {len(values)} values")
        cells = np.empty(count, object)
        for place, each in enumerate(values):
            cells[place] = _array(each.data, order, depth + 1)
        return cells.reshape(shape, order="F")
    if bits & 0xFF not in _REAL or bits & _COMPLEX:
        raise ValueError("text, structures or complex numbers; expected cells and real numbers")
    numbers = values[0] if values else _Element(9, b"")
    if numbers.kind not in _NUMBERS:
        raise ValueError(f"numbers of the unknown type {numbers.kind}")
    kind = np.dtype(order + _NUMBERS[numbers.kind])
    if len(numbers.data) != count * kind.itemsize:
        raise ValueError(f"an array of {shown(shape)} has {len(numbers.data)} bytes of numbers")
    return np.frombuffer(numbers.data, kind).astype(float).reshape(shape, order="F")
