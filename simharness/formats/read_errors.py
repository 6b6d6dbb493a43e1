"""Reading of foreign files: every fault of a file ends in one ValueError that names the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def read_bytes(path: Path, *, what: str) -> bytes:
    """Return the content of a file.

    Args:
        path: the file.
        what: the expected content and its origin, for the message.

    Raises:
        ValueError: the file does not exist or cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; expected {what}. Copy it there or correct the path") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); expected {what}") from None


def read_json(path: Path, *, what: str) -> dict[str, Any]:
    """Return the JSON object in a file.

    Args:
        path: the file.
        what: the expected content, for the message.

    Raises:
        ValueError: the file does not exist, its JSON is truncated or broken, or it is not an object.
    """
    content = read_bytes(path, what=what)
    try:
        value = json.loads(content)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: broken or truncated JSON ({error}; the file has {len(content)} bytes); expected {what}. "
            "It was probably cut off: copy or download it again"
        ) from None
    if not isinstance(value, dict):
        raise ValueError(f"{path}: expected {what}, which is a JSON object, got a {type(value).__name__}")
    return value
