"""Digest of the code that renders crops: part of the key of the cache, so that other code does not use its files."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.metadata
from collections.abc import Iterator
from pathlib import Path

import mvpose
import simharness
from simharness.scenario.layers import SENSORS
from simharness.scoring.score_registry import MODULES
from simharness.world.scene.objects.object_files import ASSETS

START = "tools.reid.rendering"
"""Module that renders crops; its imports, direct and indirect, belong to the digest."""

_ROOTS = {
    "mvpose": Path(mvpose.__file__).parent,
    "simharness": Path(simharness.__file__).parent,
    "tools": Path(__file__).parents[1],
}
_PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "pillow")
_DATA = "data"  # folder beside a module with the data that it reads


@functools.cache
def digest() -> str:
    """Return the digest of the source files and data, as on disk at the first call, and of the package versions."""
    versions = {package: importlib.metadata.version(package) for package in _PACKAGES}
    result = hashlib.blake2b(repr(versions).encode(), digest_size=8)
    for name, file in sorted(files().items()):
        content = file.read_bytes()
        result.update(f"{name}\0{len(content)}\0".encode())
        result.update(content)
    return result.hexdigest()


def files() -> dict[str, Path]:
    """Return, by name, the files of all modules that :data:`START` imports at any level, and the data that they read.

    The data are in folders beside the modules, the objects of furnished rooms, and the sensor profiles of the shipped
    scenarios.

    This includes modules that are not needed for rendering, such as those that the ``__init__`` of a package imports.
    A change in them causes an unnecessary rendering, which takes minutes. A missing module would be worse: a card could
    have scores of crops that cannot be rendered again.
    """
    modules: dict[str, Path] = {}
    pending = [START, *(f"simharness.scoring.{name}" for name in MODULES)]  # the catalogue imports these by name
    while pending:
        name = pending.pop()
        file = _file(name)
        if file is None or name in modules:
            continue
        modules[name] = file
        pending += _imported(file)
    data = {_name(each): each for file in modules.values() for each in _data_beside(file)}
    data |= {_name(each): each for each in sorted(ASSETS.rglob("*")) if each.is_file()}
    profiles = {f"{SENSORS.folder}/{file.name}": file for file in SENSORS.shipped.glob("*.toml")}
    return {_name(file): file for file in modules.values()} | data | profiles


def _imported(file: Path) -> Iterator[str]:
    """List the imported names that may be modules, and the packages that contain them."""
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            parts = name.split(".")
            yield from (".".join(parts[:k]) for k in range(1, len(parts) + 1))


def _file(module: str) -> Path | None:
    """Return the file of a module of this project, or None for other modules and for names of no module."""
    top, *rest = module.split(".")
    if top not in _ROOTS:
        return None
    path = _ROOTS[top].joinpath(*rest)
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if file.is_file():
            return file
    return None


def _data_beside(file: Path) -> Iterator[Path]:
    """List the data files beside a module."""
    folder = file.parent / _DATA
    # Crops do not depend on networks, and an updated card must not invalidate the crops that it describes.
    if folder.is_dir() and file.parent != _ROOTS["mvpose"] / "networks":
        yield from (each for each in folder.iterdir() if each.is_file() and not each.name.startswith("."))


def _name(file: Path) -> str:
    """Return the path of a file from the parent of its package, with slashes."""
    root = next(root for root in _ROOTS.values() if file.is_relative_to(root))
    return file.relative_to(root.parent).as_posix()
