"""The code that crops come from: what is rendered with one version of it is not taken for that of another."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.metadata
from collections.abc import Iterator
from pathlib import Path

import mvpose
import simharness

START = "tools.reid.rendering"
"""The module whose imports, and theirs, make crops."""

_ROOTS = {
    "mvpose": Path(mvpose.__file__).parent,
    "simharness": Path(simharness.__file__).parent,
    "tools": Path(__file__).parents[1],
}
_PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "pillow")
_DATA = "data"  # the folder beside a module that has what it reads


@functools.cache
def digest() -> str:
    """Of the sources and their data, as they lie on disk when first asked for, and of the packages' versions."""
    versions = {package: importlib.metadata.version(package) for package in _PACKAGES}
    whole = hashlib.blake2b(repr(versions).encode(), digest_size=8)
    for name, file in sorted(files().items()):
        content = file.read_bytes()
        whole.update(f"{name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest()


def files() -> dict[str, Path]:
    """By name, the modules of both packages that :data:`START` imports, wherever in them, and the data beside them.

    More than is run to render: a package's ``__init__`` imports modules that no crop needs. Changing those renders
    anew, too, which costs minutes; the other way round a card would state figures of crops that nobody can make.
    """
    modules: dict[str, Path] = {}
    left = [START]
    while left:
        name = left.pop()
        file = _file(name)
        if file is None or name in modules:
            continue
        modules[name] = file
        left += _imported(file)
    data = {_name(each): each for file in modules.values() for each in _beside(file)}
    return {_name(file): file for file in modules.values()} | data


def _imported(file: Path) -> Iterator[str]:
    """Names that may be modules, and the packages they are in."""
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
    """Where a module of ours lies; None of others and of what is no module."""
    top, *rest = module.split(".")
    if top not in _ROOTS:
        return None
    place = _ROOTS[top].joinpath(*rest)
    for file in (place / "__init__.py", place.with_suffix(".py")):
        if file.is_file():
            return file
    return None


def _beside(file: Path) -> Iterator[Path]:
    folder = file.parent / _DATA
    # Networks are no part of a crop, and a card that is written anew must not make its own crops stale.
    if folder.is_dir() and file.parent != _ROOTS["mvpose"] / "networks":
        yield from (each for each in folder.iterdir() if each.is_file() and not each.name.startswith("."))


def _name(file: Path) -> str:
    root = next(root for root in _ROOTS.values() if file.is_relative_to(root))
    return file.relative_to(root.parent).as_posix()
