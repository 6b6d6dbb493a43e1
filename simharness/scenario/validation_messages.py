"""Messages about mistakes in scenario files, one line each: where, the key, what was expected, what was given."""

import difflib
import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from mvpose.files.message_text import shown
from simharness.scenario.file_model import ScenarioFile
from simharness.scenario.sections.section import Elements

_EXPLAINED = 20  # mistakes; a message lists fewer, and to find the nearest key takes time
_VARIANTS = ("method", "variants")  # a file may also write it as variants


def explain_all(
    error: ValidationError,
    origins: dict[tuple[str, ...], str],
    file: str,
    *,
    section: tuple[str, ...] = (),
    root: type[BaseModel] = ScenarioFile,
) -> list[str]:
    """Return a message for each mistake of a validation.

    Args:
        error: raised by a model of a scenario file.
        origins: as in :func:`explain`.
        file: as in :func:`explain`.
        section: location of the model in a scenario file.
        root: model of the whole file.
    """
    mistakes: list[dict[str, Any]] = [{**mistake, "loc": (*section, *mistake["loc"])} for mistake in error.errors()]
    wrong = [mistake["loc"] for mistake in mistakes]
    # A list whose elements are wrong counts as too short as well, because only valid elements are counted.
    messages = [
        explain(mistake, origins, file, root=root)
        for mistake in mistakes[:_EXPLAINED]
        if mistake["type"] != "too_short" or not any(_is_within(each, mistake["loc"]) for each in wrong)
    ]
    return messages + [f"{file}: {_dotted(location)}: not valid" for location in wrong[_EXPLAINED:]]


def explain(
    mistake: Mapping[str, Any], origins: dict[tuple[str, ...], str], file: str, *, root: type[BaseModel] = ScenarioFile
) -> str:
    """Return one of pydantic's errors as "where: key: what was expected, what was given".

    Args:
        mistake: the error; its location is one in a file of the model ``root``.
        origins: origin of the keys that were not set by ``file``: ``--set people.count=6`` for ("people", "count").
        file: the file that is named where a key has no other origin.
        root: model of the whole file, with the title of such files in messages ("a scenario").
    """
    location = tuple(mistake["loc"])
    origin = origin_of(location, origins, file)
    key = _written(location, origins)
    if mistake["type"] == "extra_forbidden":
        return f"{origin}: {_unknown(location, root)}"
    if length := _wrong_length(mistake, location, origins, root):
        return f"{origin}: {length}"
    if mistake["type"] == "missing":
        return f"{origin}: {key} is missing and has no default; give it a value"
    expected, hint = _expected(mistake, location, key, root), _nearest(mistake, location, root)
    field = field_at(location, root)
    about = f" ({field.description})" if field is not None and field.description else ""
    return f"{origin}: {key}{about}: expected {expected}, got {shown(mistake['input'])}{hint}"


def _is_within(location: Sequence[str | int], outer: Sequence[str | int]) -> bool:
    """Return whether a location is one within another."""
    return len(location) > len(outer) and tuple(location[: len(outer)]) == tuple(outer)


def origin_of(location: Sequence[str | int], origins: dict[tuple[str, ...], str], file: str) -> str:
    """Return the last origin of a key, of something in it, or of the section around it; else the file."""
    location = tuple(location)
    setters = (
        origin
        for key, origin in reversed(origins.items())
        if location[: len(key)] == key or key[: len(location)] == location
    )
    return next(setters, file)


def is_key(location: Sequence[str]) -> bool:
    """Return whether a scenario file has a key or section of this name."""
    section = section_at(location[:-1])
    return section is not None and location[-1] in section.model_fields


def section_at(location: Sequence[str | int], root: type[BaseModel] = ScenarioFile) -> type[BaseModel] | None:
    """Return the section at a location; the whole file for an empty one; None for values and unknown keys."""
    section: type[BaseModel] | None = root
    for part in location:
        if section is not None and not isinstance(part, int):  # an index stays in the section of a list of tables
            section = _nested(section.model_fields.get(part))
    return section


@dataclass(frozen=True)
class _List:
    """Type of a list in a scenario file."""

    elements: tuple[Any, ...]
    """Types of the elements; one type of a list of any length."""
    names: tuple[str, ...]
    """Names of the elements of a list of fixed length; () where they have none."""
    fixed: bool
    """Whether the length is fixed."""
    default: Any = None
    """Default of the field, where the list is the field's whole value."""

    def example(self, given: Any) -> str:
        """Return a valid value as TOML-like text, with as much of the given value as possible."""
        if not self.fixed:
            number = _plain(self.elements[0]) in (int, float)
            single = not isinstance(given, bool) and isinstance(given, (int, float) if number else str)
            return shown([given] if single else list(self.default or ()))
        if isinstance(given, str):
            numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", given)]
            given = numbers if len(numbers) == len(self.elements) else []
        numbers = [value for value in given if isinstance(value, int | float)] if isinstance(given, list) else []
        default = list(self.default or [0] * len(self.elements))
        values = [*numbers[: len(default)], *default[len(numbers) :]]
        return "[" + ", ".join(f"{value:g}" for value in values) + "]"


def _expected(mistake: Mapping[str, Any], location: tuple[str | int, ...], key: str, root: type[BaseModel]) -> str:
    """Return what a message says was expected."""
    section = section_at(location, root)
    if mistake["type"] in ("model_type", "model_attributes_type") and section is not None:
        return f"a section [{key}] with keys {', '.join(sorted(section.model_fields)) or 'of your choice'}"
    kind = _list_at(location, root)
    if kind is not None and mistake["type"] in ("tuple_type", "list_type"):
        example = kind.example(mistake["input"])
        form = f"[{', '.join(kind.names)}]" if kind.fixed and kind.names else "a list"
        return f"{form}, e.g. {example}" if example != "[]" else form
    message = mistake["msg"].replace(" should match ", " should be text that matches ")
    message = re.sub(r" items? after validation, not \d+$", "", message).replace("at least 1", "at least one")
    return re.sub(r"^(?:\w+ should(?: be| have)?|Value error,) ", "", message)


def _wrong_length(
    mistake: Mapping[str, Any], location: tuple[str | int, ...], origins: Mapping[Any, str], root: type[BaseModel]
) -> str:
    """Return the message about a list of fixed length that is too short or too long; "" for other mistakes."""
    if mistake["type"] == "missing" and location and isinstance(location[-1], int):
        location = location[:-1]
    elif mistake["type"] != "too_long":
        return ""
    kind = _list_at(location, root)
    if kind is None or not kind.fixed:
        return ""
    given, field = mistake["input"], field_at(location, root)
    whole = field is not None and not isinstance(location[-1], int)
    about = (field.description if whole and field is not None else None) or ", ".join(kind.names)
    return (
        f"{_written(location, origins)}: expected {len(kind.elements)} numbers{f' ({about})' if about else ''}, "
        f"got {len(given)}: {shown(given)}; e.g. {kind.example(given)}"
    )


def _nearest(mistake: Mapping[str, Any], location: Sequence[str | int], root: type[BaseModel]) -> str:
    """Return a hint at the valid value that was probably meant, for keys with a list of valid values."""
    if mistake["type"] != "literal_error" or not isinstance(mistake["input"], str):
        return ""
    values = [str(value) for value in typing.get_args(_type_at(location, root)[0])]
    near = difflib.get_close_matches(mistake["input"], values, n=1, cutoff=0.5)
    return f"; did you mean {shown(near[0])}?" if near else ""


def _type_at(location: Sequence[str | int], root: type[BaseModel]) -> tuple[Any, tuple[str, ...], Any]:
    """Return the type at a location, the names of its elements and its default; (None, (), None) for unknown keys."""
    section: type[BaseModel] | None = root
    found: Any = None
    names: tuple[str, ...] = ()
    default: Any = None
    for part in location:
        if section is not None and isinstance(part, int):  # an element of a list of tables
            continue
        if section is not None:
            field = section.model_fields.get(str(part))
            if field is None:
                return None, (), None
            section, found, default = _nested(field), _plain(field.annotation), field.default
            names = next((each.names for each in field.metadata if isinstance(each, Elements)), ())
            continue
        elements = typing.get_args(found)
        if typing.get_origin(found) is not tuple or not isinstance(part, int) or not elements:
            return None, (), None
        element = elements[0] if elements[-1] is Ellipsis else elements[min(part, len(elements) - 1)]
        extra = typing.get_args(element)[1:] if typing.get_origin(element) is Annotated else ()
        names = next((each.names for each in extra if isinstance(each, Elements)), ())
        found, default = _plain(element), None
    return found, names, default


def _list_at(location: Sequence[str | int], root: type[BaseModel]) -> _List | None:
    """Return the type of a list at a location; None where the value is not a list."""
    kind, names, default = _type_at(location, root)
    if typing.get_origin(kind) is not tuple:
        return None
    elements = typing.get_args(kind)
    fixed = elements[-1] is not Ellipsis
    return _List(elements if fixed else elements[:1], names, fixed, default if isinstance(default, tuple) else None)


def _plain(kind: Any) -> Any:
    """Return a type without its annotations, and without None where it is optional."""
    if typing.get_origin(kind) is Annotated:
        return _plain(typing.get_args(kind)[0])
    if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
        present = [each for each in typing.get_args(kind) if each is not type(None)]
        return _plain(present[0]) if len(present) == 1 else kind
    return kind


def _dotted(location: Sequence[str | int]) -> str:
    """Return ``cameras.size[1]`` for ``("cameras", "size", 1)``."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _written(location: tuple[str | int, ...], origins: Mapping[Any, str]) -> str:
    """Return a location as it was written last: ``variants`` or ``method.variants``, which are the same key."""
    last = next((key for key in reversed(list(origins)) if key in (_VARIANTS, _VARIANTS[1:])), _VARIANTS)
    if location[: len(_VARIANTS)] == _VARIANTS:
        location = (*last, *location[len(_VARIANTS) :])
    return _dotted(location)


def _unknown(location: Sequence[str | int], root: type[BaseModel]) -> str:
    """Return the message about a key that does not exist."""
    wrong = str(location[-1])
    section = section_at(location[:-1], root) or root
    parents = [part for part in location[:-1] if isinstance(part, str)]  # without indices in lists of tables
    valid = sorted(section.model_fields)
    candidates = [".".join([*parents, key]) for key in difflib.get_close_matches(wrong, valid, n=1)]
    # A key of another section, most often one written above its [section] or below the wrong one.
    candidates = candidates or [key for key in _keys(root) if key.rsplit(".", 1)[-1] == wrong]
    hint = f"; did you mean {' or '.join(candidates)}?" if candidates else ";"
    where = f"[{'.'.join(parents)}]" if parents else root.model_config.get("title") or "a scenario"
    return f"{_dotted(location)} is not a key{hint} {where} has {', '.join(valid)}"


def _keys(section: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield every dotted key of a section and of the sections in it."""
    for name, field in section.model_fields.items():
        yield prefix + name
        nested = _nested(field)
        if nested is not None:
            yield from _keys(nested, f"{prefix}{name}.")


def field_at(location: Sequence[str | int], root: type[BaseModel]) -> FieldInfo | None:
    """Return the field at a location, or at the longest part of it that names one."""
    section: type[BaseModel] | None = root
    field = None
    for part in location:
        if section is None:
            break
        if isinstance(part, int):  # an element of a list of tables
            continue
        field = section.model_fields.get(part)
        section = _nested(field)
    return field


def _nested(field: FieldInfo | None) -> type[BaseModel] | None:
    """Return the section that a field holds, or a list of which it holds; None where it holds a value."""
    kind: Any = None if field is None else _plain(field.annotation)
    if typing.get_origin(kind) is tuple and len(typing.get_args(kind)) == 2 and typing.get_args(kind)[1] is Ellipsis:
        kind = _plain(typing.get_args(kind)[0])
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None
