"""Both distributions: what they hold and require, and that nothing in them lacks types."""

import ast
import fnmatch
import importlib
import re
import tomllib
import zipfile

import pytest
from built_wheels import ROOT, build_wheels, packaged_files
from packaging.metadata import Metadata
from packaging.requirements import Requirement

from simharness.capture.rendering import gl
from simharness.capture.rendering.raster import make_renderer
from simharness.capture.rendering.renderer import Unavailable

SIMHARNESS, MVPOSE = (tomllib.loads((ROOT / each).read_text()) for each in ("pyproject.toml", "mvpose/pyproject.toml"))
PACKAGING = {"pyproject.toml", "README.md", "LICENSE"}


def names(requirements):
    return {Requirement(each).name for each in requirements}


class TestPyproject:
    def test_the_list_of_packages_of_mvpose_is_complete(self):
        folders = {file.parent for file in packaged_files("mvpose") if file.name == "__init__.py"}
        assert sorted(MVPOSE["tool"]["setuptools"]["packages"]) == sorted(
            ".".join(("mvpose", *each.parts)) for each in folders
        )

    @pytest.mark.parametrize(
        ("package", "project"), [("mvpose", MVPOSE), ("mvpose", SIMHARNESS), ("simharness", SIMHARNESS)]
    )
    def test_all_data_is_packaged(self, package, project):
        patterns = project["tool"]["setuptools"]["package-data"][package]
        data = [file for file in packaged_files(package) if file.suffix != ".py" and str(file) not in PACKAGING]
        assert data
        assert [str(file) for file in data if not any(fnmatch.fnmatch(str(file), each) for each in patterns)] == []

    def test_all_scenarios_are_packaged(self):
        patterns = SIMHARNESS["tool"]["setuptools"]["package-data"]["simharness.scenarios"]
        shipped = list(packaged_files("scenarios"))
        assert [str(file) for file in shipped if not any(fnmatch.fnmatch(str(file), each) for each in patterns)] == []

    def test_both_have_one_version_and_one_license(self):
        fallback = [each["tool"]["setuptools_scm"]["fallback_version"] for each in (SIMHARNESS, MVPOSE)]
        assert fallback[0] == fallback[1]
        assert (ROOT / "LICENSE").read_bytes() == (ROOT / "mvpose" / "LICENSE").read_bytes()

    def test_a_requirement_is_written_once(self):
        ours, its = names(SIMHARNESS["tool"]["simharness"]["dependencies"]), names(MVPOSE["project"]["dependencies"])
        assert its == {"numpy", "scipy", "numba", "threadpoolctl"}
        extras = MVPOSE["project"]["optional-dependencies"]
        assert not ours & its.union(*(names(each) for each in extras.values()))


def test_scripts_name_functions_that_exist():
    scripts = SIMHARNESS["tool"]["simharness"]["scripts"] | MVPOSE["project"]["scripts"]
    assert scripts.keys() == {"simharness", "mvpose"}
    for place in scripts.values():
        module, _, function = place.partition(":")
        assert callable(getattr(importlib.import_module(module), function))


def test_only_compiled_functions_go_without_types():
    """Mypy lets the packages with kernels define untyped functions; these must be compiled by Numba."""
    untyped = []
    for package in ("mvpose", "simharness"):
        for inside in packaged_files(package):
            if inside.suffix != ".py":
                continue
            for node in ast.walk(ast.parse((ROOT / package / inside).read_text(encoding="utf-8"))):
                if not isinstance(node, ast.FunctionDef):
                    continue
                compiled = any(
                    "jit" in ast.unparse(each) or "compiled" in ast.unparse(each) for each in node.decorator_list
                )
                arguments = [each for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                typed = node.returns is not None or any(each.annotation for each in arguments)
                if not typed and not compiled:
                    untyped.append(f"{package}/{inside}:{node.lineno} {node.name}")
    assert not untyped


def test_without_pyrender_the_rasteriser_renders(monkeypatch):
    monkeypatch.setattr(gl, "find_spec", lambda name: None)
    assert type(make_renderer("auto")) is type(make_renderer("raster"))
    with pytest.raises(Unavailable, match=r"pyrender is not installed; pip install 'simharness\[gl\]'"):
        make_renderer("gl")


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """Both wheels by name."""
    return build_wheels(tmp_path_factory.mktemp("checkout"))


@pytest.fixture(scope="module")
def metadata(wheels):
    found = {}
    for name, wheel in wheels.items():
        with zipfile.ZipFile(wheel) as opened:
            (file,) = (each for each in opened.namelist() if each.endswith(".dist-info/METADATA"))
            found[name] = Metadata.from_email(opened.read(file), validate=True)
    return found


@pytest.mark.slow
class TestWheels:
    """The release recipe (docs/releasing.md) up to the upload."""

    def test_there_are_two(self, metadata):
        assert {name: each.name for name, each in metadata.items()} == {"mvpose": "mvpose", "simharness": "simharness"}
        assert metadata["mvpose"].version == metadata["simharness"].version

    def test_each_has_its_own_program(self, wheels):
        for name, wheel in wheels.items():
            with zipfile.ZipFile(wheel) as opened:
                (file,) = (each for each in opened.namelist() if each.endswith(".dist-info/entry_points.txt"))
                assert re.findall(r"^(\w+) =", opened.read(file).decode(), re.M) == [name]

    def test_simharness_requires_mvpose_of_its_version(self, metadata):
        (required,) = (each for each in metadata["simharness"].requires_dist if each.name == "mvpose")
        assert str(required) == f"mvpose[films,networks,recordings]=={metadata['simharness'].version}"

    @pytest.mark.parametrize("name", ["mvpose", "simharness"])
    def test_a_wheel_holds_its_package_and_nothing_else(self, wheels, name):
        with zipfile.ZipFile(wheels[name]) as opened:
            held = {each for each in opened.namelist() if ".dist-info/" not in each}
        expected = {f"{name}/{each}" for each in packaged_files(name) if str(each) not in PACKAGING}
        if name == "simharness":
            expected |= {f"simharness/scenarios/{each}" for each in packaged_files("scenarios")}
        assert held == expected


def test_the_release_recipe_names_targets_that_exist():
    recipe = (ROOT / "docs" / "releasing.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert set(re.findall(r"^ +make (\w+)", recipe, re.M)) <= targets
    assert (ROOT / ".ci" / "run").is_file()
