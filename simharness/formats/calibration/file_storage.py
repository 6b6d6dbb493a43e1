"""OpenCV's FileStorage, the YAML (or XML) that ``cv2.FileStorage`` writes, as plain Python values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.formats.read_errors import read_bytes

_MATRIX = {"dt", "data"}  # besides rows and cols, or sizes where the dimensions are not two


def read_storage(path: Path, *, what: str) -> dict[str, Any]:
    """Read a whole file: maps as dicts, sequences as lists, matrices as arrays of floats, text and numbers.

    Args:
        path: the file.
        what: what it should hold, for the message.

    Raises:
        ValueError: no such file, one that is cut off or that FileStorage cannot read, or no map of names.
    """
    content = read_bytes(path, what=what)
    try:
        storage = cv2.FileStorage(content.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        value = _value(storage.root())
    except (cv2.error, SystemError, UnicodeDecodeError) as error:  # the constructor fails with a SystemError
        reason = str(error.__cause__ or error).strip().split(" error: ")[-1]
        raise ValueError(
            f"{path}: OpenCV's FileStorage cannot read it ({reason}; the file has {len(content)} bytes); expected "
            f"{what}. It may be cut off, or not begin with %YAML:1.0"
        ) from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected {what}, got a file without names and values")
    return value


def read_beside(path: Path, *, what: str) -> dict[str, Any]:
    """Read a file and, where its name says ``intri`` or ``extri``, the one of the other name in the same folder.

    Raises:
        ValueError: as :func:`read_storage`, for either.
    """
    values = read_storage(path, what=what)
    other = _other(path)
    if other is not None and other.is_file():
        values = {**read_storage(other, what=what), **values}
    return values


def _other(path: Path) -> Path | None:
    for here, there in (("intri", "extri"), ("extri", "intri")):
        if here in path.name:
            return path.with_name(path.name.replace(here, there))
    return None


def missing_half(path: Path) -> str:
    """What to say where values may be in the file beside: its name, or how the two should be called."""
    other = _other(path)
    return f"{other.name} beside it" if other else "a file beside it (intri.yml and extri.yml, by these names)"


def matrix(value: ArrayLike) -> NDArray[np.float64]:
    """A matrix as FileStorage writes it, (rows, columns)."""
    return np.atleast_2d(np.asarray(value, float))


def write_storage(path: Path, values: dict[str, Any]) -> None:
    """Write names and their values: text, numbers, arrays, lists and dicts of these.

    Raises:
        ValueError: a name that FileStorage does not take: it begins with no letter, or has other characters than
            letters, digits, blanks, - and _.
    """
    storage = cv2.FileStorage(str(path.suffix or ".yml"), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in values.items():
        _write(storage, key, value)
    path.write_text(storage.releaseAndGetString(), encoding="utf-8")


def _write(storage: cv2.FileStorage, key: str, value: Any) -> None:
    try:
        if isinstance(value, dict):
            storage.startWriteStruct(key, cv2.FILE_NODE_MAP)
            for name, each in value.items():
                _write(storage, name, each)
            storage.endWriteStruct()
        elif isinstance(value, list):
            storage.startWriteStruct(key, cv2.FILE_NODE_SEQ)
            for each in value:
                _write(storage, "", each)
            storage.endWriteStruct()
        else:
            storage.write(key, value)
    except cv2.error:
        raise ValueError(
            f"{key!r} is no name for OpenCV's FileStorage: expected a letter, then letters, digits, blanks, - and _"
        ) from None


def _value(node: cv2.FileNode) -> Any:
    if node.isMap():
        keys = node.keys()
        return node.mat().astype(float) if set(keys) >= _MATRIX else {key: _value(node.getNode(key)) for key in keys}
    if node.isSeq():
        return [_value(node.at(index)) for index in range(node.size())]
    if node.isString():
        return node.string()
    return int(node.real()) if node.isInt() else node.real()
