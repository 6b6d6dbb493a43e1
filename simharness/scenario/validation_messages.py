"""What a scenario says wrongly, in one clear line each: the place, the key, what was expected, what was got."""

from __future__ import annotations

import difflib
import json
import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from simharness.scenario.file_model import ScenarioFile

_VARIANTS = ("method", "variants")  # for which a file may also say variants
_SHOWN = 60  # characters of a refused value that a message repeats


def explain(mistake: Mapping[str, Any], places: dict[tuple[str, ...], str], file: str) -> str:
    """One of pydantic's errors as "place: key: what was expected, what was got".

    Args:
        mistake: the error; its location is that in a :class:`ScenarioFile`.
        places: who set a key where the file did not: ``--set people.count=6`` for ("people", "count").
        file: the file that is at fault where nobody else is.
    """
    location = tuple(mistake["loc"])
    place = place_of(location, places, file)
    key = _written(location, places)
    if mistake["type"] == "extra_forbidden":
        return f"{place}: {_unknown(location)}"
    if mistake["type"] == "missing":
        return f"{place}: {key} is missing and has no default; give it a value"
    section = section_at(location)
    if mistake["type"] in ("model_type", "model_attributes_type") and section is not None:
        expected = f"a section [{key}] with keys {', '.join(sorted(section.model_fields)) or 'of your own'}"
    else:
        said = mistake["msg"].replace(" should match ", " should be text that matches ")
        said = re.sub(r" items? after validation, not \d+$", "", said).replace("at least 1", "at least one")
        expected = re.sub(r"^(?:\w+ should(?: be| have)?|Value error,) ", "", said)
    field = _field(location)
    about = f" ({field.description})" if field is not None and field.description else ""
    got = json.dumps(mistake["input"], ensure_ascii=False, default=str)
    got = got if len(got) <= _SHOWN else got[: _SHOWN - 1] + "…"
    return f"{place}: {key}{about}: expected {expected}, got {got}"


def place_of(location: Sequence[str | int], places: dict[tuple[str, ...], str], file: str) -> str:
    """Who set a key last, or something in it, or the section that it is in; the file where nobody else did."""
    location = tuple(location)
    setters = (
        place
        for key, place in reversed(places.items())
        if location[: len(key)] == key or key[: len(location)] == location
    )
    return next(setters, file)


def is_key(location: Sequence[str]) -> bool:
    """Whether a scenario file has a key, or a section."""
    section = section_at(location[:-1])
    return section is not None and location[-1] in section.model_fields


def section_at(location: Sequence[str | int]) -> type[BaseModel] | None:
    """The section that a location names, the file for none; None where it names a value or nothing."""
    section: type[BaseModel] | None = ScenarioFile
    for part in location:
        section = None if section is None else _nested(section.model_fields.get(str(part)))
    return section


def _dotted(location: Sequence[str | int]) -> str:
    """``("cameras", "size", 1)`` as ``cameras.size[1]``."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _written(location: tuple[str | int, ...], places: dict[tuple[str, ...], str]) -> str:
    """A location as whoever set it last wrote it: as ``variants`` or as ``method.variants``, which are the same."""
    last = next((key for key in reversed(places) if key in (_VARIANTS, _VARIANTS[1:])), _VARIANTS)
    if location[: len(_VARIANTS)] == _VARIANTS:
        location = (*last, *location[len(_VARIANTS) :])
    return _dotted(location)


def _unknown(location: Sequence[str | int]) -> str:
    """What to say of a key that does not exist."""
    *parents, wrong = map(str, location)
    section = section_at(parents) or ScenarioFile
    valid = sorted(section.model_fields)
    candidates = [".".join([*parents, key]) for key in difflib.get_close_matches(wrong, valid, n=1)]
    # A key of another section, most often one written above its [section] or below the wrong one.
    candidates = candidates or [key for key in _keys(ScenarioFile) if key.rsplit(".", 1)[-1] == wrong]
    hint = f"; did you mean {' or '.join(candidates)}?" if candidates else ";"
    where = f"[{'.'.join(parents)}]" if parents else "a scenario"
    return f"{_dotted(location)} is not a key{hint} {where} has {', '.join(valid)}"


def _keys(section: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every dotted key of a section and the sections in it."""
    for name, field in section.model_fields.items():
        yield prefix + name
        nested = _nested(field)
        if nested is not None:
            yield from _keys(nested, f"{prefix}{name}.")


def _field(location: Sequence[str | int]) -> FieldInfo | None:
    """The field that a location, or the beginning of it, names."""
    section: type[BaseModel] | None = ScenarioFile
    field = None
    for part in location:
        if section is None:
            break
        field = section.model_fields.get(str(part))
        section = _nested(field)
    return field


def _nested(field: FieldInfo | None) -> type[BaseModel] | None:
    """The section that a field holds, if it holds one."""
    kind: Any = None if field is None else field.annotation
    if isinstance(kind, types.UnionType):  # a section that may be absent
        kind = next((each for each in typing.get_args(kind) if each is not type(None)), None)
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None
