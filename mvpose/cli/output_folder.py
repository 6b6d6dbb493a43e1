"""The folder of a command's results: writable before anything runs, and complete when it appears."""

from __future__ import annotations

import os
import secrets
from pathlib import Path


def check_writable(folder: Path, *, option: str = "--out") -> None:
    """Check that a folder can be made or replaced, by making a file where it will be.

    Raises:
        ValueError: it cannot, is a file, or holds something other than results.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{option} {folder}: is a file; expected a folder for the results")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / RESULTS).exists():
        raise ValueError(
            f"{option} {folder}: has files, and is no earlier result (no {RESULTS}); give a new folder, or empty it"
        )
    above = folder.absolute().parent
    while not above.exists():
        above = above.parent
    probe = above / f".{secrets.token_hex(8)}.partial"
    try:
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{option} {folder}: cannot be written: {error.strerror} ({above})") from None
    if folder.is_dir() and not os.access(folder, os.W_OK):
        raise ValueError(f"{option} {folder}: cannot be written: permission denied")


RESULTS = "inputs.json"
"""A file that every folder of results holds, and by which one is recognised."""
