"""PEP 517 build backend of the distribution ``simharness``: setuptools, with the packages chosen by the kind of build.

A wheel holds the package ``simharness`` with the folder ``scenarios/`` in it, and requires ``mvpose`` of the same
version. An editable install (``pip install -e .``) provides both packages from the checkout, so that it needs no index
that has ``mvpose``, and requires what ``mvpose`` requires. Requirements are written in two places only: table
``[tool.simharness]`` of ``pyproject.toml``, and ``[project]`` of ``mvpose/pyproject.toml``.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import setuptools
from setuptools import build_meta

_PACKAGES = ("simharness", "simharness.*")
_EXTRAS = ("films", "networks", "recordings")  # of mvpose: the simulator runs networks, and reads what mvpose reads


class _Backend(build_meta._BuildMetaBackend):  # type: ignore[misc, name-defined, unused-ignore]
    """Hooks of setuptools with requirements and packages in place of a ``setup.py``."""

    def __init__(self, *, editable: bool) -> None:
        super().__init__()
        self._editable = editable

    def run_setup(self, setup_script: str = "setup.py") -> None:
        setuptools.setup(**(_editable() if self._editable else _wheel()))


def _editable() -> dict[str, Any]:
    """Return setup arguments for both packages, taken from the checkout."""
    mvpose = _read("mvpose/pyproject.toml")["project"]
    extras = [each for extra in _EXTRAS for each in mvpose["optional-dependencies"][extra]]
    return {
        "packages": setuptools.find_packages(include=(*_PACKAGES, "mvpose", "mvpose.*")),
        "install_requires": _requirements() + mvpose["dependencies"] + extras,
        "entry_points": _entry_points(_scripts() | mvpose["scripts"]),
    }


def _wheel() -> dict[str, Any]:
    """Return setup arguments for the package ``simharness`` and the shipped scenarios."""
    command = [sys.executable, "-m", "setuptools_scm"]
    version = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {
        "packages": [*setuptools.find_packages(include=_PACKAGES), "simharness.scenarios"],
        "package_dir": {"simharness.scenarios": "scenarios"},
        "entry_points": _entry_points(_scripts()),
        "install_requires": [*_requirements(), f"mvpose[{','.join(_EXTRAS)}]=={version.strip()}"],
    }


def _requirements() -> list[str]:
    return list(_read("pyproject.toml")["tool"]["simharness"]["dependencies"])


def _scripts() -> dict[str, str]:
    return dict(_read("pyproject.toml")["tool"]["simharness"]["scripts"])


def _entry_points(scripts: dict[str, str]) -> dict[str, list[str]]:
    return {"console_scripts": [f"{name} = {place}" for name, place in scripts.items()]}


def _read(file: str) -> dict[str, Any]:
    return tomllib.loads(Path(file).read_text(encoding="utf-8"))


_for_wheel = _Backend(editable=False)
get_requires_for_build_sdist = _for_wheel.get_requires_for_build_sdist
build_sdist = _for_wheel.build_sdist
get_requires_for_build_wheel = _for_wheel.get_requires_for_build_wheel
prepare_metadata_for_build_wheel = _for_wheel.prepare_metadata_for_build_wheel
build_wheel = _for_wheel.build_wheel

_for_editable = _Backend(editable=True)
get_requires_for_build_editable = _for_editable.get_requires_for_build_editable
prepare_metadata_for_build_editable = _for_editable.prepare_metadata_for_build_editable
build_editable = _for_editable.build_editable
