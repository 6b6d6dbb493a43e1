"""Imports go down only, by the table of docs/architecture.md."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TABLE = re.search(r"## Floors\n(.*?)\n## ", (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"), re.S)[1]
FLOORS = re.findall(r"^\| `(\w+)` \|", TABLE, re.M)
OURS = {"simharness", "mvpose", "tools", "benchmarks", "tests"}


def modules(package):
    return sorted(
        file for file in (ROOT / package).rglob("*.py") if "build" not in file.relative_to(ROOT / package).parts
    )


def imports(file):
    """Every imported module of this repository, with the line."""
    folder = file.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(folder[: len(folder) - node.level + 1]) + "." if node.level else ""
            module = f"{base}{node.module or ''}".rstrip(".")
            names = [f"{module}.{alias.name}" for alias in node.names] if module == "simharness" else [module]
        else:
            continue
        yield from ((name, node.lineno) for name in names if name.partition(".")[0] in OURS)


def test_the_table_names_every_package():
    inside = {
        path.stem
        for path in (ROOT / "simharness").iterdir()
        if path.suffix == ".py" or (path / "__init__.py").is_file()
    }
    assert sorted(FLOORS) == sorted(inside - {"__init__"})


@pytest.mark.parametrize("package", FLOORS)
def test_imports_go_down(package):
    place = ROOT / "simharness" / package
    upward = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in (modules(place) if place.is_dir() else [place.with_suffix(".py")])
        for name, line in imports(file)
        if name.startswith("simharness.")
        and (target := name.split(".")[1]) != package
        and target not in FLOORS[: FLOORS.index(package)]
    ]
    assert not upward, f"{package} may import only what stands above it in docs/architecture.md"


@pytest.mark.parametrize(
    ("package", "forbidden"), [("mvpose", OURS - {"mvpose"}), ("simharness", OURS - {"mvpose", "simharness"})]
)
def test_packages_stand_alone(package, forbidden):
    wrong = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in modules(package)
        for name, line in imports(file)
        if name.partition(".")[0] in forbidden
    ]
    assert not wrong
