"""The JSON schema of scenario files: it is current, and it says what the loader says."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from simharness.scenario.load import ScenarioError, load_study
from tools.scenario_schema import dumps, scenario_schema

SCENARIOS = Path(__file__).parents[3] / "scenarios"
SHIPPED = sorted(SCENARIOS.glob("*.toml"))


@pytest.fixture(scope="module")
def validator():
    schema = scenario_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_committed_schema_is_current():
    assert (SCENARIOS / "schema.json").read_text(encoding="utf-8") == dumps(), (
        "write it again: python -m tools.scenario_schema"
    )
    assert json.loads(dumps()) == scenario_schema()


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_scenario_is_valid(validator, path):
    assert [error.message for error in validator.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))] == []


VALID = [
    "seeds = 3",
    "seeds = [1, 2]",
    'variants = ["full"]',
    'variants = ["mine"]\n[method.estimators]\nmine = "mine.py:Mine"\ntheirs = "package.module:make"',
    "[gate]\nlevel = 0.1",
    "[detector.keypoints]\nmiss = 0.1\njitter = { hips = 0.2 }\nmiss_some = 0.3",
    '[detector]\nprofile = "poor"\n[cameras]\nrig = "ring5"',
    "[sweep]\none_at_a_time = true\ncameras.count = [2, 3]\nrate = { from = 1, to = 2, steps = 3 }",
    '[sweep]\ndetector.keypoints.miss = [0.1]\ndetector.keypoints.miss_some.hips = [0.1]\ncameras.rig = ["ring5"]',
    "[sweep]\ncameras.size = [[320, 240], [640, 480]]\nclutter.coverage = [0.1, 0.2]",
    "[[sweep.paired]]\npeople.count = [1, 2]\npeople.area = { from = 1, to = 2, steps = 2 }",
    "[cases.a]\n[cases.b]\npeople.count = 2\ndetector.keypoints.miss = 0.1",
]
INVALID = [
    "seeds = 0",
    "seeds = []",
    "variants = []",
    "[method.estimators]\nmine = 3",
    '[method.estimators]\nmine = "mine.py"',
    '[method.estimators]\nMine = "mine.py:Mine"',
    '[sweep]\nmethod.estimators.mine = ["mine.py:Mine"]',
    '[cases.a]\nmethod.estimators.mine = "mine.py:Mine"',
    "duratoin = 3",
    "[people]\ncuont = 2",
    "[people]\ncount = -2",
    "[gate]\nlevle = 0.1",
    "[detector.keypoints]\nmiss = 1.5",
    "[detector.keypoints.miss]\ntoes = 0.5",
    "[sweep]\npeople.count = 2",
    "[sweep]\npeople.count = []",
    "[sweep]\npeople.count = [-2]",
    "[sweep]\npeople.cuont = [2]",
    "[sweep]\nseed = [2]",
    "[sweep]\nmethod.variants = [['full']]",
    "[sweep]\npeople.area = { from = 1, to = 2 }",
    "[sweep]\npeople.area = { start = 1, stop = 2, steps = 3 }",
    "[[sweep.paired]]\npeople.cuont = [1, 2]",
    "[cases.a]\nseed = 2",
    "[cases.a]\npeople.cuont = 2",
]


@pytest.mark.parametrize(("text", "valid"), [(t, True) for t in VALID] + [(t, False) for t in INVALID])
def test_schema_and_loader_agree(validator, tmp_path, text, valid):
    path = tmp_path / "x.toml"
    path.write_text(f'name = "x"\n{text}')
    assert validator.is_valid(tomllib.loads(path.read_text())) == valid
    if valid:
        load_study(path)
    else:
        with pytest.raises(ScenarioError):
            load_study(path)


def test_a_file_has_a_name_or_a_base_that_has_one(validator):
    assert validator.is_valid({"name": "x"})
    assert validator.is_valid({"extends": "x.toml"})
    assert not validator.is_valid({"seed": 3})


def test_keys_say_what_they_mean():
    schema = scenario_schema()
    cameras = schema["$defs"]["CamerasFileSection"]
    assert cameras["properties"]["fov"]["description"] == "horizontal field of view, degrees"
    swept = schema["properties"]["sweep"]["properties"]["cameras"]["$ref"].rpartition("/")[2]
    assert schema["$defs"][swept]["properties"]["fov"]["description"] == "horizontal field of view, degrees"
