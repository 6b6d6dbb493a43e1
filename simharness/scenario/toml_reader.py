"""TOML files in, with a clear message where they cannot be read."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any

_LISTED = 10  # files that a message names where one is missing


class ScenarioError(ValueError):
    """A scenario that cannot be read: every message names the place, the key and how to mend it."""


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        ScenarioError: it is missing or not TOML; the message names what lies beside it, or the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors of Windows begin a file with a mark
    except FileNotFoundError:
        raise ScenarioError(f"{path}: no such file; {_beside(path)}") from None
    except IsADirectoryError:
        raise ScenarioError(f"{path}: is a folder, not a scenario file; {_scenarios(path, of='it')}") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 ({error.reason} at byte {error.start})") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, line, column = toml_place(str(error), text)
        raise ScenarioError(f"{path}, line {line}, column {column}: not valid TOML: {what}") from None


def toml_place(message: str, text: str) -> tuple[str, int, int]:
    """Split tomllib's "what (at line 3, column 5)"; Python 3.11 carries the numbers in the message alone."""
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found:
        return found[1], int(found[2]), int(found[3])
    lines = text.splitlines() or [""]
    return message.removesuffix(" (at end of document)"), len(lines), len(lines[-1]) + 1


def _beside(path: Path) -> str:
    """What scenarios there are in the folder of a path to none."""
    folder = path.parent
    near = difflib.get_close_matches(path.name, _names(folder), n=1)
    hint = f"did you mean {folder / near[0]}? " if near else ""
    return hint + _scenarios(folder, of="this folder" if folder == Path() else str(folder), like=path.name)


def _scenarios(folder: Path, *, of: str, like: str = "") -> str:
    """The scenarios in a folder, which is called ``of``; of many those with names the most alike, and how many more."""
    names = _names(folder)
    if not names:
        return f"there is no scenario (*.toml) in {of}"
    shown = names
    if len(names) > _LISTED:
        shown = difflib.get_close_matches(like, names, n=_LISTED, cutoff=0.0) if like else names[:_LISTED]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return f"{of} has {', '.join(shown)}{more}"


def _names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.glob("*.toml")) if folder.is_dir() else []
