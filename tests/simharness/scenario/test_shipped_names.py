"""Shipped scenarios by name: on the command line, in ``extends``, from any folder."""

from pathlib import Path

import pytest

import simharness
from simharness.scenario.load import load, load_study
from simharness.scenario.shipped import shipped_folder, shipped_names
from simharness.scenario.toml_files import ScenarioError


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(name: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(name)
    return str(caught.value)


@pytest.mark.parametrize("name", shipped_names())
def test_every_shipped_scenario_is_read_by_its_name(name):
    study = load_study(name)
    assert study.name == name
    assert study.path == Path(name)  # as it was given, for commands that are shown


def test_a_file_extends_a_shipped_scenario_by_name(elsewhere):
    (elsewhere / "kitchen.toml").write_text('extends = "quickstart"\nname = "kitchen"\n[people]\ncount = 2\n')
    kitchen, quickstart = load("kitchen.toml"), load("quickstart")
    assert (kitchen.name, kitchen.people.count, kitchen.cameras) == ("kitchen", 2, quickstart.cameras)


def test_a_file_of_that_name_comes_first(elsewhere):
    (elsewhere / "quickstart.toml").write_text('name = "local"')
    assert load("quickstart").name == "local"
    (elsewhere / "lab").mkdir()
    (elsewhere / "lab" / "views.toml").write_text('name = "other"\nextends = "base"')
    (elsewhere / "lab" / "base").write_text('name = "base"\nseed = 9')
    assert load("lab/views.toml").seed == 9


def test_a_file_of_a_shipped_name_extends_the_shipped_one(elsewhere):
    (elsewhere / "quickstart.toml").write_text('extends = "quickstart"\n[people]\ncount = 1\n')
    loaded = load("quickstart.toml")
    assert (loaded.name, loaded.people.count, loaded.clutter.boxes) == ("quickstart", 1, 6)


def test_an_unknown_name_is_refused_with_the_nearest(elsewhere):
    message = refusal("quikstart")
    assert message.startswith("quikstart: no such scenario; did you mean quickstart? ")
    assert all(name in message for name in shipped_names())
    assert "did you mean" not in refusal("zzzzzz")
    (elsewhere / "top.toml").write_text('extends = "gathring"')
    assert refusal("top.toml").startswith("top.toml: extends: gathring: no such scenario; did you mean gathering? ")


@pytest.mark.parametrize("path", ["quickstart.toml", "scenarios/quickstart.toml"])
def test_the_path_of_a_shipped_scenario_that_is_missing_gives_its_name(path):
    assert refusal(path).startswith(f"{path}: no such file; did you mean quickstart?")


def test_a_wheel_has_them_inside_the_package(tmp_path, monkeypatch):
    package = tmp_path / "site-packages" / "simharness"
    (package / "scenarios").mkdir(parents=True)
    text = 'name = "only"\n[detector]\nname = "perfect"\n[sensor]\nprofile = ""'
    (package / "scenarios" / "only.toml").write_text(text)
    assert shipped_folder() == Path(simharness.__file__).parents[1] / "scenarios"
    monkeypatch.setattr(simharness, "__file__", str(package / "__init__.py"))
    assert shipped_folder() == package / "scenarios"
    assert shipped_names() == ["only"]
    assert load("only").name == "only"
