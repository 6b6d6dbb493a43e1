"""Reading other people's files: whatever is wrong with one ends in one ValueError that names it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def read_bytes(path: Path, *, what: str) -> bytes:
    """The content of a file.

    Args:
        path: the file.
        what: what it should hold and where it comes from, for the message.

    Raises:
        ValueError: no such file, or one that cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; expected {what}. Copy it there or correct the path") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); expected {what}") from None


def read_json(path: Path, *, what: str) -> dict[str, Any]:
    """The JSON object in a file.

    Args:
        path: the file.
        what: what it should hold, for the message.

    Raises:
        ValueError: no such file, JSON that is cut off or broken, or JSON that is not an object.
    """
    content = read_bytes(path, what=what)
    try:
        value = json.loads(content)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: not whole JSON ({error}; the file has {len(content)} bytes); expected {what}. "
            "It was probably cut off: copy or download it again"
        ) from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected {what}, which is a JSON object, got a {type(value).__name__}")
    return value
