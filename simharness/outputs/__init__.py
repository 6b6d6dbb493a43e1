"""What people look at: pages of runs, studies, rehearsals and validations, with pictures and films; data on disk."""

from functools import cache
from pathlib import Path
from typing import Any

from mvpose.files.input_files import parse_toml

TEMPLATES = Path(__file__).parent / "templates"
"""Templates of the pages; they extend those of :mod:`mvpose.report.documents`."""


@cache
def texts_of(name: str) -> dict[str, Any]:
    """Return the texts of a file of the folder ``data``, by key."""
    return parse_toml((TEMPLATES.with_name("data") / f"{name}.toml").read_text(encoding="utf-8"))
