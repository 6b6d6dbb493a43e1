"""File of a blame in the result folder of a run or a study."""

from __future__ import annotations

import json
from pathlib import Path

from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_json_object
from simharness.study.causes.cause_shares import Blame

FILE = "blame.json"
"""Name of the file in a result folder."""


def write_blame(found: Blame, folder: Path) -> None:
    """Write the file into a result folder."""
    write_atomic(folder / FILE, (json.dumps(found.json(), indent=1, allow_nan=False) + "\n").encode())


def read_blame(folder: Path) -> Blame | None:
    """Read the file of a result folder; None where it has none.

    Raises:
        ValueError: a damaged file.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    try:
        return Blame.of_json(read_json_object(path, what="what cost the score"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}; remove it, or write it again with --blame") from None
