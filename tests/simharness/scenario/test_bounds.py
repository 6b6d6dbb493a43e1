"""Every key of a scenario is bounded, and so is what several keys cost together."""

import json
from functools import reduce

import pytest

from simharness.scenario.checks import MOST_FRAMES, oversized
from simharness.scenario.file_model import MOST_TRIALS, ScenarioFile
from simharness.scenario.load import StudyTooLarge, load, load_study, read_plan
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.shipped import shipped_folder
from simharness.scenario.toml_files import ScenarioError

UNBOUNDED = {
    "sweep": "its values are checked as those of the keys that they replace, and its settings are counted",
    "cases": "as sweep",
    "search": "as sweep",
    "method.estimators": "one name for each file of the user",
}


def unbounded(schema, document, where=""):
    """Yield every number without two bounds and every list without a greatest length, in a JSON schema."""
    if "$ref" in schema:
        schema = reduce(dict.__getitem__, schema["$ref"].removeprefix("#/").split("/"), document) | {
            key: value for key, value in schema.items() if key != "$ref"
        }
    for each in schema.get("anyOf", ()):
        yield from unbounded(each, document, where)
    kind = schema.get("type")
    if kind in ("number", "integer"):
        low, high = {"minimum", "exclusiveMinimum"}, {"maximum", "exclusiveMaximum"}
        if not (low & schema.keys() and high & schema.keys()):
            yield where
    elif kind == "array":
        if "maxItems" not in schema:
            yield where
        for each in (*schema.get("prefixItems", ()), *filter(None, [schema.get("items")])):
            yield from unbounded(each, document, where + "[]")
    elif kind == "object":
        if "properties" not in schema and where not in UNBOUNDED:
            yield where
        for key, each in schema.get("properties", {}).items():
            name = f"{where}.{key}".removeprefix(".")
            if name not in UNBOUNDED:
                yield from unbounded(each, document, name)


def numbers(schema):
    """Count the numeric types of a schema, so that a walk that sees none does not pass."""
    if isinstance(schema, dict):
        return (schema.get("type") in ("number", "integer")) + sum(map(numbers, schema.values()))
    return sum(map(numbers, schema)) if isinstance(schema, list) else 0


def test_every_number_has_both_bounds_and_every_list_a_greatest_length():
    schema = ScenarioFile.model_json_schema()
    assert numbers(schema) > 150
    assert list(unbounded(schema, schema)) == []


def test_the_walk_sees_missing_bounds():
    schema = {
        "$defs": {"Part": {"type": "object", "properties": {"length": {"type": "number", "minimum": 0}}}},
        "type": "object",
        "properties": {
            "part": {"$ref": "#/$defs/Part"},
            "list": {"type": "array", "items": {"type": "integer", "minimum": 0, "maximum": 3}},
            "either": {"anyOf": [{"type": "null"}, {"type": "integer", "maximum": 3}]},
        },
    }
    assert list(unbounded(schema, schema)) == ["part.length", "list", "either"]


@pytest.mark.parametrize("path", sorted(shipped_folder().glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_scenarios_are_within_the_bounds(path):
    plan = read_plan(path)
    assert plan.trials >= 1
    assert not list(oversized(plan.base))


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("duration=1e12", "duration (seconds): expected less than or equal to 36000, got 1000000000000.0"),
        ("duration=inf", "duration (seconds): expected a finite number, got Infinity"),
        ("rate=nan", "rate (frames per second): expected a finite number, got NaN"),
        ("people.count=1" + 40 * "0", "people.count (number of people): expected less than or equal to 100"),
        ("cameras.size=[100000, 600]", "cameras.size"),
        ("cameras.radius=1e6", "metres"),
        ("cameras.height=-1e300", "expected greater than or equal to -200"),
        ("faults.rotation=1e9", "degrees"),
        ("detector.scores.deviation=1e9", "logit"),
        ("seed=1" + 40 * "0", "seed of every random draw"),
        ("seeds=1" + 40 * "0", "seeds: expected a number of seeds, 1 to 1,000,000"),
        ("name=" + "a" * 300, "name"),
        ("cameras.heights=" + json.dumps([1] * 65), "expected at most 64"),
    ],
    ids=lambda text: text[:30],
)
def test_a_value_out_of_bounds_is_refused_in_one_line(override, message):
    with pytest.raises(ScenarioError) as refusal:
        load("quickstart", overrides=[override])
    text = str(refusal.value)
    assert message in text
    assert "\n" not in text
    assert len(text) < 700


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["duration=36000", "rate=1000"], "36000 s x 1000 Hz makes 36,000,000 frames: expected at most 100,000"),
        (
            ["duration=10000", "people.count=30", "cameras.count=40"],
            "100,000 frames x 40 cameras x 30 people makes 120,000,000 sights of people: expected at most 10,000,000",
        ),
        (
            ["duration=5000", "cameras.size=[8192, 8192]", "people.count=1"],
            'expected at most 10,000,000,000,000; rendering.renderer = "rays" renders none',
        ),
        (["people.count=100", "cameras.count=64"], "detections in a frame: expected at most 2000"),
    ],
    ids=["frames", "sights", "pixels", "detections"],
)
def test_products_of_keys_are_bounded(overrides, message):
    with pytest.raises(ScenarioError) as refusal:
        load("quickstart", overrides=overrides)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_rays_render_no_pixels():
    overrides = ["duration=5000", "cameras.size=[8192, 8192]", "people.count=1", 'rendering.renderer="rays"']
    assert load("quickstart", overrides=overrides).frames == 50_000


def test_the_largest_number_of_frames_is_accepted():
    largest = Scenario(
        name="a", duration=MOST_FRAMES / 10, rate=10.0, rendering={"renderer": "rays"}, people={"count": 1}
    )
    assert not list(oversized(largest))
    assert list(oversized(largest.model_copy(update={"duration": largest.duration + 0.1})))


def test_a_swept_value_is_checked_as_well():
    with pytest.raises(ScenarioError, match="makes 200,000 frames"):
        load_study("quickstart", overrides=["sweep.duration=[1.0, 20000.0]"])


def test_a_study_has_a_largest_number_of_trials_even_when_confirmed():
    with pytest.raises(StudyTooLarge, match=r"2,000,000 trials .* more than the 1,000,000 that a study may have"):
        load_study("quickstart", overrides=["sweep.cameras.count=[2, 3]"], seeds=MOST_TRIALS, limit=None)
