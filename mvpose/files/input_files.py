"""Reading of input files: regular files of bounded size; whatever is wrong ends in one ValueError that names the file.

Every reader of the package takes the bytes of a file from :func:`read_bytes`, and JSON and TOML from the functions of
this module, so that a pipe, a device, an enormous or a deeply nested file is refused in the same way everywhere.
"""

import codecs
import contextlib
import json
import os
import re
import stat
import tomllib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from mvpose.files.message_text import one_line, shown

MIB = 2**20
SETTINGS = MIB
"""Largest file of settings, bytes: scenarios, recordings, profiles, rigs. Shipped ones have a few kilobytes."""
CALIBRATION = 4 * MIB
"""Largest calibration, bytes: the 511 cameras of the Panoptic Studio have half a megabyte."""
TABLE = 512 * MIB
"""Largest file of detections, joints, scores or motion that is read whole, bytes; in parts 32 times as many are."""

_BITS_OF_FLOATS = 1000  # whole numbers that fit a float
_DEEPEST = 64  # lists and tables in each other; the formats of the field need six
_SPACE, _ENTRY = re.compile(r"[ \t\r\n]*"), re.compile(r"[ \t\r\n]*(?=[^\]\s])")
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){64}""")


def read_bytes(path: Path, *, what: str, most: int = TABLE) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file.
        what: the expected content and its origin, for the message.
        most: largest size that is read, bytes.

    Raises:
        ValueError: the file does not exist, cannot be read, is larger than ``most``, or is no regular file: reading a
            pipe or a device could wait for ever.
    """
    with _opened(path, what=what, most=most) as (file, size):
        content = file.read(size + 1)
    if len(content) > size:
        raise ValueError(
            f"{one_line(str(path), 200)}: is being written, or is no file of a disk; expected {what}. Copy it first"
        )
    return content


@contextlib.contextmanager
def _opened(path: Path, *, what: str, most: int) -> Iterator[tuple[IO[bytes], int]]:
    """Give a regular file that is open, and its size.

    Raises:
        ValueError: as :func:`read_bytes`.
    """
    name = one_line(str(path), 200)
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))  # a pipe would block the opening
    except FileNotFoundError:
        raise ValueError(f"{name}: no such file; expected {what}. Copy it there or correct the path") from None
    except OSError as error:
        raise ValueError(f"{name}: cannot be read ({error.strerror}); expected {what}") from None
    except ValueError as error:  # a zero byte in the path
        raise ValueError(f"{name}: cannot be a path ({error}); expected {what}") from None
    try:
        about = os.fstat(handle)
        kind = stat.S_IFMT(about.st_mode)
        if kind != stat.S_IFREG:
            raise ValueError(f"{name}: is {_KINDS.get(kind, 'no file')}, not a regular file; expected {what}")
        if about.st_size > most:
            raise ValueError(f"{name}: is larger than {megabytes(most)}, the most that is read of {what}")
        with os.fdopen(handle, "rb", closefd=False) as opened:
            yield opened, about.st_size
    except OSError as error:
        raise ValueError(f"{name}: cannot be read ({error.strerror}); expected {what}") from None
    finally:
        os.close(handle)


def json_list_parts(path: Path, *, what: str, size: int) -> Iterator[list[Any]]:
    """Yield the entries of a JSON file that is a list, in parts; none of another file.

    Args:
        path: the file.
        what: the expected content, for the message.
        size: bytes that are read for a part; no entry may have more than 16 times as many.

    Raises:
        ValueError: see :func:`read_bytes`, and :func:`parse_json`.
    """
    decoder, text, begun = json.JSONDecoder(), "", False
    with _opened(path, what=what, most=32 * TABLE) as (file, whole):
        decode = codecs.getincrementaldecoder("utf-8-sig")().decode
        try:
            while content := file.read(size):
                text += decode(content)
                if not begun and not text.lstrip().startswith("["):
                    return
                at = _SPACE.match(text).end() + 1 if not begun else 0  # type: ignore[union-attr]
                begun, entries = True, []
                while (entry := _ENTRY.match(text, at)) is not None:
                    try:
                        value, end = decoder.raw_decode(text, entry.end())
                    except json.JSONDecodeError:
                        if len(text) - entry.end() > 16 * size:
                            raise
                        break  # the rest of the entry is in the next part
                    following = _SPACE.match(text, end).end()  # type: ignore[union-attr]
                    if text[following : following + 1] not in (",", "]"):
                        break
                    entries.append(value)
                    at = following + (text[following] == ",")
                    if text[following] == "]":
                        break
                text = text[at:]
                check_values(entries)
                if entries:
                    yield entries
            if text.strip() != "]":
                raise ValueError("the list does not end")
        except (ValueError, RecursionError) as error:
            raise ValueError(
                f"{one_line(str(path), 200)}: broken or truncated JSON ({error}; the file has {whole} bytes); expected "
                f"{what}. It was probably cut off: copy or download it again"
            ) from None


def read_json(path: Path, *, what: str, most: int = TABLE) -> Any:
    """Return the JSON value in a file: an object, a list, text, a number.

    Args:
        path: the file.
        what: the expected content, for the message.
        most: largest size that is read, bytes.

    Raises:
        ValueError: see :func:`read_bytes`, and :func:`parse_json`.
    """
    content = read_bytes(path, what=what, most=most)
    try:
        return parse_json(content)
    except ValueError as error:
        raise ValueError(
            f"{one_line(str(path), 200)}: broken or truncated JSON ({error}; the file has {len(content)} bytes); "
            f"expected {what}. It was probably cut off: copy or download it again"
        ) from None


def read_json_object(path: Path, *, what: str, most: int = TABLE) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        ValueError: see :func:`read_json`; or another JSON value.
    """
    value = read_json(path, what=what, most=most)
    if not isinstance(value, dict):
        raise ValueError(
            f"{one_line(str(path), 200)}: expected {what}, which is a JSON object, got a {type(value).__name__}"
        )
    return value


def parse_json(content: bytes | str) -> Any:
    """Return the value of a JSON text, with or without a byte order mark.

    Raises:
        ValueError: not JSON, nested deeply, or with a number or text that nothing else could take; see
            :func:`check_values`.
    """
    try:
        value = json.loads(content.removeprefix(b"\xef\xbb\xbf") if isinstance(content, bytes) else content)
    except RecursionError:
        raise ValueError(_too_deep()) from None
    check_values(value)
    return value


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises:
        tomllib.TOMLDecodeError: not TOML; the message ends in the place.
        ValueError: as :func:`parse_json`.
    """
    if _LONG_KEY.search(text):  # the parser's time grows with the square of the parts of a key
        raise ValueError(_too_deep())
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_too_deep()) from None
    check_values(tables, bits=_BITS_OF_FLOATS)
    return tables


def check_values(value: Any, *, bits: int = 64) -> None:
    """Check that a parsed value can be processed: its nesting, its text, and that whole numbers fit ``bits`` bits.

    Raises:
        ValueError: nested more than 64 deep, a whole number of more bits, or text with half a surrogate pair.
    """
    level, largest = [value], 2 ** (bits - 1)
    for _ in range(_DEEPEST):
        if not level:
            return
        deeper: list[Any] = []
        for each in level:
            if isinstance(each, dict):
                _check_texts(each)
            for inner in each.values() if isinstance(each, dict) else each if isinstance(each, list) else (each,):
                kind = type(inner)
                if kind is float:
                    continue
                if kind is dict or kind is list:
                    deeper.append(inner)
                elif kind is int and not -largest <= inner < largest:
                    raise ValueError(f"a whole number of more than {bits} bits")
                elif kind is str and not inner.isascii():
                    _check_texts((inner,))
        level = deeper
    if level:
        raise ValueError(_too_deep())


def _check_texts(texts: Any) -> None:
    for text in texts:
        try:
            text.encode()
        except UnicodeEncodeError:
            raise ValueError(f"{shown(text)} is not valid Unicode") from None


def _too_deep() -> str:
    return f"nested more than {_DEEPEST} deep"


def file_numbers(files: Sequence[Path]) -> list[int]:
    """Return the number of each picture: the last one in the names that differs for all files, or else the row."""
    found = [[int(digits) for digits in re.findall(r"\d+", file.stem)] for file in files]
    if len({len(each) for each in found}) == 1:
        for column in range(len(found[0]) - 1, -1, -1):
            values = [each[column] for each in found]
            if len(set(values)) == len(values):
                return values
    return list(range(len(files)))


def files_ending(folder: Path, endings: Collection[str]) -> list[Path]:
    """Return the files of a folder with some endings, in lower or upper case, in natural order."""
    return sorted((each for each in folder.iterdir() if each.suffix.lower() in endings), key=natural_order)


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Return a key that sorts paths by name, with numbers by value: frame_2 before frame_10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def megabytes(size: int) -> str:
    """Return a size in bytes as text, for messages."""
    return f"{size / MIB:.3g} MiB"
