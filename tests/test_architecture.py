"""Imports go down only, by the two tables of floors in docs/architecture.md; no import is part of a circle."""

import ast
from pathlib import Path

import pytest

from tools.floor_plan import floors, picture

ROOT = Path(__file__).parents[1]
OURS = {"simharness", "mvpose", "tools", "benchmarks", "tests"}
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


FLOORS = {package: [names for names, _ in floors(package, TEXT)] for package in ("mvpose", "simharness")}


def modules(package):
    return sorted(
        file for file in (ROOT / package).rglob("*.py") if "build" not in file.relative_to(ROOT / package).parts
    )


def dotted(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {dotted(file) for package in FLOORS for file in modules(package)}


def imports(file):
    """Yield every imported module of this repository, with the line."""
    folder = file.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(folder[: len(folder) - node.level + 1]) + "." if node.level else ""
            module = f"{base}{node.module or ''}".rstrip(".")
            submodules = [f"{module}.{alias.name}" for alias in node.names if f"{module}.{alias.name}" in NAMES]
            names = submodules if len(submodules) == len(node.names) else [module, *submodules]
        else:
            continue
        yield from ((name, node.lineno) for name in names if name.partition(".")[0] in OURS)


def floor(name):
    """Return the floor of a module, None for the face of a package (``mvpose``, ``simharness``)."""
    package, _, inside = name.partition(".")
    path = inside.replace(".", "/")
    rooms = [
        (len(room), level)
        for level, row in enumerate(FLOORS[package])
        for room in row
        if path == room or path.startswith(f"{room}/")
    ]
    return max(rooms)[1] if rooms else None


@pytest.mark.parametrize("package", FLOORS)
def test_the_table_names_every_module(package):
    homeless = [name for name in sorted(NAMES) if name.startswith(f"{package}.") and floor(name) is None]
    assert set(homeless) <= {"simharness.world"}
    gone = [
        room
        for row in FLOORS[package]
        for room in row
        if f"{package}.{room.replace('/', '.')}" not in NAMES and not (ROOT / package / room).is_dir()
    ]
    assert not gone


@pytest.mark.parametrize("package", FLOORS)
def test_imports_go_down(package):
    upward = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in modules(package)
        if (own := floor(dotted(file))) is not None
        for name, line in imports(file)
        if name.startswith(f"{package}.") and (floor(name) or 0) > own
    ]
    assert not upward, f"{package} may import only what stands above it in docs/architecture.md"


def test_the_picture_is_of_the_tables():
    drawn = (ROOT / "docs" / "floors.svg").read_text(encoding="utf-8")
    assert drawn == picture(TEXT), "python -m tools.floor_plan draws it again"


@pytest.mark.parametrize("package", FLOORS)
def test_rooms_of_one_row_do_not_import_each_other(package):
    beside = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for row in FLOORS[package]
        for room in row
        if len(row) > 1
        for file in modules(package)
        if f"{dotted(file)}.".startswith(f"{package}.{room.replace('/', '.')}.")
        for name, line in imports(file)
        for other in row
        if other != room and f"{name}.".startswith(f"{package}.{other.replace('/', '.')}.")
    ]
    assert not beside


def test_no_module_imports_itself_through_others():
    """Imports inside functions count, those for annotations alone (``if TYPE_CHECKING``) as well; the faces do not."""
    graph = {
        dotted(file): {name for name, _ in imports(file) if name in NAMES and name not in FLOORS} - {dotted(file)}
        for package in FLOORS
        for file in modules(package)
        if dotted(file) not in FLOORS
    }
    while True:  # modules that import nothing of what remains are in no circle
        ends = {name for name, targets in graph.items() if not targets & graph.keys()}
        if not ends:
            break
        graph = {name: targets for name, targets in graph.items() if name not in ends}
    starts = True
    while starts:  # nor are those that nothing of what remains imports
        imported = set().union(*graph.values()) if graph else set()
        starts = graph.keys() - imported
        graph = {name: targets for name, targets in graph.items() if name not in starts}
    assert not sorted(graph)


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
