"""Shipped scenarios: the folder ``scenarios``, part of the wheel, and names for its files."""

from pathlib import Path

import simharness


def shipped_folder() -> Path:
    """Return the folder of the shipped scenarios, with ``rigs``, ``sensors`` and ``detectors`` in it.

    An installed wheel has it inside the package, a checkout beside the package.
    """
    package = Path(simharness.__file__).parent
    installed = package / "scenarios"
    return installed if installed.is_dir() else package.parent / "scenarios"


def shipped_names() -> list[str]:
    """Return the names of the shipped scenarios, sorted: "quickstart" for ``quickstart.toml``."""
    return sorted(file.stem for file in shipped_folder().glob("*.toml"))
