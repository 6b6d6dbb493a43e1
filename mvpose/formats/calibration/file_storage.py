"""OpenCV's FileStorage (YAML or XML) in plain Python values: reader and writer.

OpenCV's own reader crashes the process on some damaged files, so files are parsed by LibYAML and Expat, as events, and
scalars are interpreted by OpenCV's rules (:mod:`.storage_values`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.files.input_files import CALIBRATION, read_bytes
from mvpose.files.message_text import one_line
from mvpose.formats.calibration.storage_xml import parse_xml
from mvpose.formats.calibration.storage_yaml import parse_yaml


def read_storage(path: Path, *, what: str) -> dict[str, Any]:
    """Read a whole file: maps as dicts, sequences as lists, matrices as arrays of floats, text and numbers.

    Args:
        path: the file.
        what: the expected content, for the message.

    Raises:
        ValueError: the file does not exist, is truncated, is no valid YAML or XML of FileStorage, or has no names.
    """
    content = read_bytes(path, what=what, most=CALIBRATION)
    try:
        text = content.decode("utf-8-sig")
        value = parse_xml(text) if text.lstrip().startswith("<") else parse_yaml(text)
    except ValueError as error:
        raise ValueError(
            f"{path}: cannot be read as OpenCV's FileStorage ({one_line(str(error), 160)}; the file has {len(content)} "
            f"bytes); expected {what}. It may be cut off, or lack %YAML:1.0 in its first line"
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
    if other is not None and other.exists():
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
