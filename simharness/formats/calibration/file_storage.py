"""Reader and writer of OpenCV's FileStorage (YAML or XML), in plain Python values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.formats.read_errors import read_bytes

_MATRIX = {"dt", "data"}  # beside rows and cols, or sizes where the dimensions are not two


def read_storage(path: Path, *, what: str) -> dict[str, Any]:
    """Read a whole file: maps as dicts, sequences as lists, matrices as arrays of floats, text and numbers.

    Args:
        path: the file.
        what: the expected content, for the message.

    Raises:
        ValueError: the file does not exist, is truncated, cannot be read by FileStorage, or has no names.
    """
    content = read_bytes(path, what=what)
    try:
        storage = cv2.FileStorage(content.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        value = _value(storage.root())
    except (cv2.error, SystemError, UnicodeDecodeError) as error:  # the constructor fails with a SystemError
        reason = str(error.__cause__ or error).strip().split(" error: ")[-1]
        raise ValueError(
            f"{path}: OpenCV's FileStorage cannot read it ({reason}; the file has {len(content)} bytes); expected "
            f"{what}. It may be cut off, or lack %YAML:1.0 in its first line"
        ) from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected {what}, got a file without named values")
    return value


def read_beside(path: Path, *, what: str) -> dict[str, Any]:
    """Read a file and, where its name contains ``intri`` or ``extri``, the counterpart in the same folder, too.

    Raises:
        ValueError: as :func:`read_storage`, for either file.
    """
    values = read_storage(path, what=what)
    other = _other(path)
    if other is not None and other.is_file():
        values = {**read_storage(other, what=what), **values}
    return values


def _other(path: Path) -> Path | None:
    for part, counterpart in (("intri", "extri"), ("extri", "intri")):
        if part in path.name:
            return path.with_name(path.name.replace(part, counterpart))
    return None


def missing_half(path: Path) -> str:
    """Return the name of the counterpart file for messages, or the names that both files should have."""
    other = _other(path)
    return f"{other.name} beside it" if other else "a file beside it (the two must be called intri.yml and extri.yml)"


def matrix(value: ArrayLike) -> NDArray[np.float64]:
    """Return a value as a matrix (rows, columns), as FileStorage writes it."""
    return np.atleast_2d(np.asarray(value, float))


def write_storage(path: Path, values: dict[str, Any]) -> None:
    """Write named values: text, numbers, arrays, and lists and dicts of these.

    Raises:
        ValueError: a name that FileStorage refuses: it does not begin with a letter, or has characters other than
            letters, digits, spaces, - and _.
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
            f"OpenCV's FileStorage refuses the name {key!r}: expected a letter, then letters, digits, spaces, - and _"
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
