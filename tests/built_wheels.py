"""Both wheels, built as a release builds them."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]


def packaged_files(package: str) -> Iterator[Path]:
    """Yield all files of a folder of code, by their path in it, without what Python and builds leave."""
    folder = ROOT / package
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        left = {"__pycache__", "build"} & set(inside.parts) or any(part.endswith(".egg-info") for part in inside.parts)
        if file.is_file() and not left and not file.name.startswith("."):
            yield inside


def build_wheels(folder: Path) -> dict[str, Path]:
    """Build both wheels in a copy of the checkout by the command of `make wheels`; return them by name."""
    for package in ("mvpose", "simharness", "scenarios"):
        for inside in packaged_files(package):
            (folder / package / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / package / inside, folder / package / inside)
    (folder / "tools").mkdir()
    for file in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "tools/build_backend.py"):
        shutil.copy2(ROOT / file, folder / file)
    (recipe,) = re.findall(r"-m (pip wheel .*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    subprocess.run([sys.executable, "-m", *recipe.split()], cwd=folder, check=True)
    return {file.name.split("-")[0]: file for file in (folder / "dist").iterdir()}
