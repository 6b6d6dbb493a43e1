"""Files and folders of a command's results: writable before anything runs, and complete when they appear."""

import json
import os
import secrets
import tempfile
from pathlib import Path
from typing import Any

from mvpose.files.atomic_files import check_replaceable, files_of_user, write_atomic
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import listed

HTML = b'<meta name="generator" content="'
"""Text by which :func:`check_place` recognises a page of these programs."""

PROVENANCE = b'"digests"'
"""Text by which it recognises JSON with the provenance of a result."""


def check_writable(folder: Path, what: str, *, option: str = "--out") -> None:
    """Check before a run that a folder can be made or replaced, and print which files of the user in it stay.

    Args:
        folder: the folder.
        what: the command, as for :func:`mvpose.files.atomic_files.atomic_folder`.
        option: its option, for messages.

    Raises:
        ValueError: it cannot, is a file, or holds something other than results of this command.
    """
    try:
        check_replaceable(folder, what)
    except ValueError as error:
        raise ValueError(f"{option} {error}".strip()) from None
    _check_above(folder, option)
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise ValueError(f"{option} {folder}: cannot be written: permission denied")
    from mvpose.commands.programs import note

    if own := [name for name in files_of_user(folder) if not name.startswith(".")]:
        note(f"{folder}: {listed(own)} not of the earlier result, or changed since: kept")


def check_new(path: Path, *, option: str = "--out") -> None:
    """Check that a file or folder does not exist and can be made.

    Raises:
        ValueError: it exists, or cannot be written.
    """
    if path.exists():
        raise ValueError(f"{option} {path}: exists, and is not replaced; give another name")
    _check_above(path, option)


def make_folder(folder: Path, *, option: str = "--out") -> None:
    """Create a folder for results, before minutes or hours of work.

    Raises:
        ValueError: it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{option} {folder}: cannot be created: {error.strerror}") from None


def check_place(path: Path | None, *, option: str, mark: bytes) -> None:
    """Check before a run that :func:`write_text` can write a file. Nothing stays behind.

    Args:
        path: the file; None: nothing is written.
        option: its option, for messages.
        mark: what every file of this kind holds. An existing file without it is not replaced: another program
            wrote it.

    Raises:
        ValueError: the file cannot be written, or was not written by this program.
    """
    if path is None:
        return
    try:
        if path.is_file() and path.stat().st_size and mark not in read_bytes(path, what="an earlier result"):
            raise ValueError(f"{option} {path}: exists, and this command did not write it; give another name")
        place = next(each for each in path.absolute().parents if each.exists())
        with tempfile.TemporaryDirectory(dir=place) as trial:
            (Path(trial) / path.absolute().relative_to(place)).parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{option} {path}: cannot be written: {error.strerror}") from None


def write_text(text: str, path: Path, *, option: str = "--out") -> None:
    """Write a text file, and its folder where it is missing. The file appears only when it is complete.

    Args:
        text: the text.
        path: the file.
        option: option that names the file, for the message.

    Raises:
        ValueError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, text.encode())
    except OSError as error:
        raise ValueError(f"{option} {path}: cannot be written: {error.strerror}") from None


def write_json(values: dict[str, Any], path: Path) -> None:
    """Write the results of a command to the file of its option ``--json``.

    Raises:
        ValueError: the file cannot be written.
    """
    write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", path, option="--json")


def _check_above(path: Path, option: str) -> None:
    """Check that the nearest folder above a path that exists can be written to."""
    above = path.absolute().parent
    while not above.exists():
        above = above.parent
    probe = above / f".{secrets.token_hex(8)}.partial"
    try:
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{option} {path}: cannot be written: {error.strerror} ({above})") from None
