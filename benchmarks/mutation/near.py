"""Tests near a module: those that import it, and those of its folder."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from benchmarks.planted_bugs.checkout import ROOT

_WHOLE = ("tests/mvpose/test_pipeline.py", "tests/mvpose/test_symmetries.py")
"""Tests of what all modules of a method give together."""


def near_tests(file: str, root: Path = ROOT) -> tuple[str, ...]:
    """Return the test files of a module, those most likely to notice a change of it first.

    They are the files that import it, those that import a neighbour of it, both the shortest first, and for modules of
    the method those of whole estimates.
    """
    module = file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    package = module.rpartition(".")[0]
    own, beside = [], []
    for path, names in _imports(root).items():
        if module in names:
            own.append(path)
        elif any(name == package or name.startswith(f"{package}.") for name in names) and _mirrors(path, file):
            beside.append(path)
    ordered = [*_shortest_first(own, root), *_shortest_first(beside, root)]
    ordered += [path for path in _WHOLE if file.startswith("mvpose/")]
    return tuple(dict.fromkeys(ordered))


def _mirrors(test: str, file: str) -> bool:
    """Return whether a test lies in the folder of tests of a module's package."""
    return test.startswith(f"tests/{file.rpartition('/')[0]}")


def _shortest_first(paths: Iterable[str], root: Path) -> list[str]:
    return sorted(paths, key=lambda path: ((root / path).stat().st_size, path))


@cache
def _imports(root: Path) -> dict[str, set[str]]:
    """Return the modules that each test file imports, with the names that it takes from them."""
    found = {}
    for path in sorted((root / "tests").rglob("test_*.py")):
        names: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
            elif isinstance(node, ast.Import):
                names |= {each.name for each in node.names}
        found[path.relative_to(root).as_posix()] = names
    return found
