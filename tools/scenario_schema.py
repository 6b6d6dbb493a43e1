"""JSON schema of scenario files, for editors: ``python -m tools.scenario_schema`` writes ``scenarios/schema.json``.

With it editors complete keys, describe them, and validate files while typing.

It is derived from the models. Rules that a schema cannot express (keys that belong together, presets that exist) are
checked by :func:`simharness.scenario.load.load` alone.
"""

import json
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from simharness.scenario.file_model import ScenarioFile
from simharness.scenario.sweep import MOST_ADDED, NOT_VARIED

Schema = dict[str, Any]

_DEFS = "#/$defs/"
_RANGE: Schema = {
    "type": "object",
    "description": "a range of values, including both ends",
    "properties": {
        "from": {"type": "number"},
        "to": {"type": "number"},
        "steps": {"type": "integer", "minimum": 2},
        "scale": {"enum": ["linear", "log"], "default": "linear"},
    },
    "required": ["from", "to", "steps"],
    "additionalProperties": False,
}


def scenario_schema() -> Schema:
    """Return the JSON schema (2020-12) of a scenario file."""
    schema = ScenarioFile.model_json_schema(schema_generator=_Generator)
    definitions: dict[str, Schema] = schema["$defs"]
    properties: dict[str, Schema] = schema["properties"]
    for name in ("Shares", "Amounts", "Factors", "Means"):
        definitions[name] = _by_joint(definitions[name])
    varied = {key for key in properties if (key,) not in NOT_VARIED} - {"method"}  # its only values are the variants
    case = {key: {"$ref": f"#/properties/{key}"} for key in properties if key in varied}
    swept = _Swept(definitions)
    keys = swept.properties({key: properties[key] for key in properties if key in varied}, "#")
    definitions["Range"] = _RANGE
    definitions["Paired"] = _table(keys)
    one_at_a_time = {"type": "boolean", "description": "the base, and each key alone, instead of all combinations"}
    few = {"type": "boolean", "description": "few combinations, with all pairs of values of two keys, instead of all"}
    paired = {"type": "array", "items": {"$ref": f"{_DEFS}Paired"}, "description": "keys that are varied together"}
    about = "values that a run adds at most to each key, between those where scores break"
    refine = {"type": "integer", "minimum": 0, "maximum": MOST_ADDED, "description": about}
    how: dict[str, Any] = {"one_at_a_time": one_at_a_time, "pairwise": few, "refine": refine, "paired": paired}
    properties["sweep"] |= _table({**keys, **how})
    properties["cases"]["additionalProperties"] = _table(case)
    properties["extends"]["minLength"] = properties["variants"]["minItems"] = 1
    del schema["required"]
    schema = {"$schema": GenerateJsonSchema.schema_dialect, **schema, "title": "Scenario of simharness"}
    schema["anyOf"] = [{"required": ["name"]}, {"required": ["extends"]}]
    return _without_tables(schema)


def dumps() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(scenario_schema(), indent=1, ensure_ascii=False) + "\n"


class _Generator(GenerateJsonSchema):
    """Generator without titles, which would repeat the names of the keys."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def _by_joint(section: Schema) -> Schema:
    """Return the schema of a section with a value for each kind of joint, or one number for all kinds."""
    number = {key: value for key, value in section["properties"]["nose"].items() if key != "default"}
    return {"description": section["description"], "anyOf": [number, section]}


class _Swept:
    """Definitions of the sections in [sweep], where every key has a list or a range of values."""

    def __init__(self, definitions: dict[str, Schema]) -> None:
        self._definitions = definitions

    def properties(self, keys: dict[str, Schema], above: str) -> dict[str, Schema]:
        """Return the keys of the section at the address ``above``."""
        return {key: self._key(schema, f"{above}/properties/{key}") for key, schema in keys.items()}

    def _key(self, schema: Schema, address: str) -> Schema:
        named = schema.get("$ref") or next((each["$ref"] for each in schema.get("anyOf", ()) if "$ref" in each), None)
        section = self._definitions[named.removeprefix(_DEFS)] if named else {}
        values = {"anyOf": [{"type": "array", "minItems": 1, "items": {"$ref": address}}, {"$ref": f"{_DEFS}Range"}]}
        if "description" in schema:
            values["description"] = schema["description"]
        if not named:
            return values
        name = f"Swept{named.removeprefix(_DEFS)}"
        if name not in self._definitions:
            by_joint = section.get("anyOf", [section])[-1]
            where = f"{named}/anyOf/1" if "anyOf" in section else named
            self._definitions[name] = _table(self.properties(by_joint["properties"], where))
        table = {"$ref": f"{_DEFS}{name}"}
        return {**values, "anyOf": [*values["anyOf"], table]} if "anyOf" in section else table


def _table(properties: dict[str, Schema]) -> Schema:
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _without_tables(schema: Any) -> Any:
    """Return a schema without defaults that are whole sections, which would repeat the sections."""
    if isinstance(schema, list):
        return [_without_tables(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: value for key, value in schema.items() if key != "default" or not isinstance(value, dict)}
    return {key: _without_tables(value) for key, value in kept.items()}


if __name__ == "__main__":
    (Path(__file__).parents[1] / "scenarios" / "schema.json").write_text(dumps(), encoding="utf-8")
