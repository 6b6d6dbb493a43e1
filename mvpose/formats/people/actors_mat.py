"""Truth of Shelf and Campus: ``actorsGT.mat``, a MATLAB 5 file (Belagiannis et al., CVPR 2014).

``actor3D`` holds a cell for each actor, in it one for each frame, from 0: an array of joints, metres, or an empty or
1 x 1 array where the actor is not annotated.

Numbers and cells of MATLAB 5 files ("MAT-File Format", MathWorks, chapter 1), which may be damaged.

SciPy's reader is not used: on some damaged files it crashes the process. Only what the truth of Shelf and Campus needs
is read: arrays of real numbers, and cells of them.
"""

import math
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.files.archives import MOST
from mvpose.files.input_files import megabytes, read_bytes
from mvpose.files.message_text import one_line, prefixed, shown
from mvpose.formats.joint_names import KNOWN, skeleton_of
from mvpose.formats.people.people_files import PeopleFiles
from mvpose.recording import People

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


_WHAT = "the truth of Shelf or Campus: a MATLAB 5 file with actor3D, for each actor a cell of frames of joints x 3"


def read(files: PeopleFiles) -> People:
    """Read the joints of all actors in all frames; those of SHELF14 unless another skeleton is declared.

    Raises:
        ValueError: the file is missing, truncated, no MATLAB 5 file, or of another layout.
    """
    path = files.single()
    actors = _read_actors(path)
    names = files.skeleton or KNOWN["shelf14"]
    count = len(names)
    frames = max(map(len, actors))
    if frames * len(actors) * count * 24 > MOST:
        raise ValueError(f"{path}: {frames} frames of {len(actors)} actors are too many; expected {_WHAT}")
    joints = np.full((frames, len(actors), count, 3), np.nan)
    for actor, track in enumerate(actors):
        for frame, cell in enumerate(track):
            pose = _unwrap(cell)
            if pose.shape == (count, 3) and pose.dtype.kind in "fiu":
                joints[frame, actor] = pose
            elif pose.size > 1:
                raise ValueError(
                    f"{path}: actor {actor + 1}, frame {frame}: expected {count} x 3 joints or nothing, got "
                    f"{pose.shape}"
                )
    numbers = np.arange(frames)
    with prefixed(path):
        return People(files.times(numbers), np.arange(len(actors)), joints, skeleton=skeleton_of(names))


def _read_actors(path: Path) -> list[np.ndarray]:
    """Return an array of cells of frames for each actor."""
    content = read_bytes(path, what=_WHAT)
    try:
        cells = read_variable(content, "actor3D")
    except ValueError as error:
        raise ValueError(
            f"{path}: cannot be read as a MATLAB file ({one_line(str(error), 160)}; it has {len(content)} bytes); "
            f"expected {_WHAT}. It was probably cut off: copy or download it again"
        ) from None
    if cells is None:
        raise ValueError(f"{path}: has no variable actor3D; expected {_WHAT}")
    actors = _unwrap(cells).ravel()
    if actors.dtype != object or not len(actors):
        raise ValueError(f"{path}: actor3D must be cells of actors, got {cells.dtype} {cells.shape}")
    if all(_unwrap(each).dtype != object for each in actors):
        actors = _one_actor(actors)
    return [track.ravel() for track in map(_unwrap, actors)]


def _one_actor(frames: np.ndarray) -> np.ndarray:
    """Return the cell of the only actor, given its frames, to which :func:`_unwrap` has gone down."""
    actor = np.empty(1, object)
    actor[0] = frames
    return actor


def _unwrap(cell: Any) -> np.ndarray:
    """Unwrap MATLAB cells that contain only one other array."""
    cell = np.asarray(cell)
    while cell.dtype == object and cell.size == 1:
        cell = np.asarray(cell.item())
    return cell
