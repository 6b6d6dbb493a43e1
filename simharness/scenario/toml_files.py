"""TOML files: reader with precise messages, and writers of scenarios and of plain keys."""

import difflib
import json
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from mvpose.files.input_files import SETTINGS, parse_toml, read_bytes
from mvpose.files.message_text import listed, one_line
from simharness.scenario.layers import is_range
from simharness.scenario.sections.scenario import Scenario

_LISTED = 10  # files that a message lists where one is missing
_WIDTH = 80  # columns of a line
_COMMENT = 32  # column where comments begin
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


class ScenarioError(ValueError):
    """Scenario that cannot be read.

    Every message is one line of bounded length that names the file or option, the key, and how to mend it.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        ScenarioError: the file does not exist or is not TOML; the message lists the files beside it, or names the line.
    """
    try:
        if path.is_dir():
            raise ScenarioError(f"{path}: is a folder, not a scenario file; {_list_files(path, title='it')}")
        if not path.exists():
            raise ScenarioError(f"{path}: no such file; {_similar_files(path)}")
        content = read_bytes(path, what="settings (TOML)", most=SETTINGS)
        text = content.decode("utf-8-sig")  # some Windows editors begin a file with a byte order mark
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 ({error.reason} at byte {error.start})") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ScenarioError(str(error)) from None
    try:
        return parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        what, line, column = toml_place(str(error), text)
        raise ScenarioError(f"{path}, line {line}, column {column}: not valid TOML: {one_line(what, 160)}") from None
    except ValueError as error:
        raise ScenarioError(f"{path}: {error}") from None


def toml_place(message: str, text: str) -> tuple[str, int, int]:
    """Split tomllib's "what (at line 3, column 5)"; Python 3.11 has the numbers in the message alone."""
    match = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if match:
        return match[1], int(match[2]), int(match[3])
    lines = text.splitlines() or [""]
    return message.removesuffix(" (at end of document)"), len(lines), len(lines[-1]) + 1


def dumps(scenario: Scenario) -> str:
    """Return a whole scenario as TOML, defaults included, with the description of each key as a comment.

    :func:`simharness.scenario.load.load` reads it back.
    """
    return "\n".join(_model_lines(scenario)) + "\n"


def dumps_keys(keys: Mapping[str, Any]) -> str:
    """Return keys and sections of a scenario file as TOML: sections as tables, ranges of values on one line."""
    return "\n".join(_key_lines(keys)) + "\n"


def toml(value: Any) -> str:
    """Return a TOML value on one line: a boolean, number or text, or a list or table of such values."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON and TOML share their escapes, except for one control character that JSON leaves as it is.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(each)}" for key, each in _dotted(value)) + " }" if value else "{}"
    return repr(value)


def _model_lines(section: BaseModel, name: str = "", description: str | None = None) -> list[str]:
    lines = _commented(f"[{name}]", description) if name else []
    nested: list[str] = []
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, BaseModel):
            nested += ["", *_model_lines(value, f"{name}.{key}" if name else key, field.description)]
        elif value is not None:
            lines += _commented(f"{key} = {toml(value)}", field.description)
    lines += [f"{key} = {toml(value)}" for key, value in (section.model_extra or {}).items()]
    return lines + nested


def _commented(line: str, comment: str | None) -> list[str]:
    """Return a line with a comment beside it, in as many lines as fit a terminal of 80 columns."""
    first, *others = textwrap.wrap(comment or "", _WIDTH - _COMMENT - 2) or [""]
    if not first:
        return [line]
    if len(line) < _COMMENT:
        line = f"{line:<{_COMMENT}}# {first}"
    else:
        others = [first, *others]
    return [line, *(f"{'':<{_COMMENT}}# {other}" for other in others)]


def _key_lines(table: Mapping[str, Any], name: str = "") -> Iterator[str]:
    sections = {key: value for key, value in table.items() if _is_section(value)}
    if name and (len(sections) < len(table) or not table):
        yield f"\n[{name}]"
    for key, value in table.items():
        if key not in sections:
            yield f"{_key(key)} = {toml(value)}"
    for key, section in sections.items():
        yield from _key_lines(section, f"{name}.{_key(key)}" if name else _key(key))


def _dotted(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and their values, for a table within braces."""
    for key, value in table.items():
        if value and _is_section(value):
            yield from _dotted(value, f"{prefix}{_key(key)}.")
        else:
            yield f"{prefix}{_key(key)}", value


def _is_section(value: Any) -> bool:
    """Return whether a value is a table, except for a range, which is easier to read on one line."""
    return isinstance(value, Mapping) and not is_range(value)


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else toml(key)


def _similar_files(path: Path) -> str:
    """Return a hint at the file that was probably meant, and the scenarios in its folder."""
    folder = path.parent
    near = difflib.get_close_matches(path.name, _file_names(folder), n=1)
    hint = f"did you mean {folder / near[0]}? " if near else ""
    return hint + _list_files(folder, title="this folder" if folder == Path() else str(folder), like=path.name)


def _list_files(folder: Path, *, title: str, like: str = "") -> str:
    """List the scenarios in a folder; of many, those with the most similar names, and the number of others."""
    names = _file_names(folder)
    if not names:
        return f"there is no scenario (*.toml) in {title}"
    shown = names
    if len(names) > _LISTED:
        shown = difflib.get_close_matches(like, names, n=_LISTED, cutoff=0.0) if like else names[:_LISTED]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return f"{title} has {listed(shown)}{more}"


def _file_names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.glob("*.toml")) if folder.is_dir() else []
