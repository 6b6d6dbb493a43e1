"""One noun, one class, one file: names of classes and modules, and the length of signatures, over both packages."""

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("mvpose", "simharness")
FAMILIES = {"page", "plots", "tables", "kernels", "command"}  # names that a folder tells apart
LONGEST = 10  # parameters
LONGER = {
    "mvpose/tracking/frame_kernels.py:judge_tracks",  # a call with tuples from Python takes half as long as the kernel
    "simharness/world/motion/poses/kinematic_chain.py:_solve_all",
}
"""Functions with more parameters. The list only becomes shorter."""


def modules(package):
    """Yield the modules of a package, without what a build leaves."""
    for file in sorted((ROOT / package).rglob("*.py")):
        if "build" not in file.relative_to(ROOT / package).parts:
            yield file


@cache
def trees():
    """Return the syntax tree of each module by file."""
    return {
        file.relative_to(ROOT).as_posix(): ast.parse(file.read_text(encoding="utf-8"))
        for package in PACKAGES
        for file in modules(package)
    }


def parameters(function):
    """Return the number of parameters of a function, without ``self`` and ``cls``."""
    given = function.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return len(named) - (bool(named) and named[0].arg in ("self", "cls"))


def test_there_is_something_to_read():
    assert len(trees()) > 400


def test_public_class_names_are_unique():
    homes = defaultdict(list)
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(file)
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_file_names_are_unique(package):
    homes = defaultdict(list)
    for file in trees():
        if file.startswith(f"{package}/"):
            homes[Path(file).stem].append(file)
    twice = {name: files for name, files in homes.items() if len(files) > 1 and not name.startswith("__")}
    assert {name: files for name, files in twice.items() if name not in FAMILIES} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_name_is_defined_once_in_its_module(package):
    """A second assignment would silently change what functions above it read."""
    twice = []
    for file, tree in trees().items():
        names = []
        for node in tree.body if file.startswith(f"{package}/") else []:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names += [] if any("overload" in ast.dump(each) for each in node.decorator_list) else [node.name]
            for target in (
                node.targets
                if isinstance(node, ast.Assign)
                else [node.target]
                if isinstance(node, ast.AnnAssign)
                else []
            ):
                names += [
                    each.id
                    for each in ast.walk(target)
                    if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)
                ]
        twice += [f"{file}: {name}" for name in sorted(set(names)) if names.count(name) > 1]
    assert twice == []


def test_signatures_are_short():
    long = {
        f"{file}:{node.name}"
        for file, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and parameters(node) > LONGEST
    }
    assert long - LONGER == set(), "arrays that travel together are a named tuple, options a frozen dataclass"
    assert LONGER - long == set(), "remove from LONGER what has become short"


@pytest.mark.parametrize(
    ("source", "count"),
    [("def f(a, b, /, c, *, d): ...", 4), ("def f(self, a): ...", 1), ("def f(): ...", 0), ("def f(*a, **b): ...", 0)],
)
def test_parameters_are_counted(source, count):
    assert parameters(ast.parse(source).body[0]) == count
