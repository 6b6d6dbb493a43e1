"""Files and folders of a command's results: writable before anything runs, and complete when they appear."""

from __future__ import annotations

import json
import os
import secrets
import tempfile
from pathlib import Path
from typing import Any

from mvpose.files.atomic_files import write_atomic

RESULTS = "inputs.json"
"""A file that every folder of results holds, and by which one is recognised."""


def check_writable(folder: Path, *, option: str = "--out", holds: str = RESULTS) -> None:
    """Check that a folder can be made or replaced, by making a file where it will be.

    Args:
        folder: the folder.
        option: its option, for messages.
        holds: a file by which earlier results of the command are recognised.

    Raises:
        ValueError: it cannot, is a file, or holds something other than results.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{option} {folder}: is a file; expected a folder for the results")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / holds).exists():
        raise ValueError(
            f"{option} {folder}: has files, and is no earlier result (no {holds}); give a new folder, or empty it"
        )
    _check_above(folder, option)
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise ValueError(f"{option} {folder}: cannot be written: permission denied")


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


def check_place(path: Path, *, option: str) -> None:
    """Check before a run that :func:`write_text` can write a file; create its folder.

    Raises:
        ValueError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
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
