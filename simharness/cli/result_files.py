"""Folder and pages of results: one line where they cannot be written."""

from __future__ import annotations

from pathlib import Path


def make_folder(folder: Path) -> None:
    """Create the folder of the results, before minutes or hours of work.

    Raises:
        ValueError: it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {folder}: cannot be created: {error.strerror}") from None


def write_page(page: str, path: Path) -> None:
    """Write an HTML page; the file appears only when it is complete.

    Raises:
        ValueError: the file cannot be written.
    """
    from mvpose.files.atomic_files import write_atomic

    try:
        write_atomic(path, page.encode())
    except OSError as error:
        raise ValueError(f"--out {path.parent}: {path.name} cannot be written: {error.strerror}") from None
