"""Options that several commands share, declared once as the fields of a dataclass."""

import dataclasses
import inspect
import typing
from collections.abc import Callable, Collection
from contextvars import ContextVar
from typing import Annotated, Any, TypeVar

import typer

Command = Callable[..., None]
T = TypeVar("T")

_GIVEN: ContextVar[frozenset[str]] = ContextVar("given", default=frozenset())
_CONTEXT = "context_of_typer"
_OPTION, _MARKS = "option", "marks"  # in the metadata of a field


def option(default: T, text: str, *flags: str, marks: Collection[str] = (), **settings: Any) -> T:
    """Return a field of a dataclass of options, or the default of a parameter of a command that is :func:`grouped`.

    Args:
        default: value of an option that is not given.
        text: what it does, for the help.
        flags: its names on the command line, if they do not follow from that of the field.
        marks: words by which :func:`marked` finds it.
        settings: further arguments of ``typer.Option``.
    """
    about = typer.Option(*flags, help=text, **settings)
    field: T = dataclasses.field(default=default, metadata={_OPTION: about, _MARKS: marks})
    return field


def marked(mark: str, *groups: type[Any]) -> tuple[str, ...]:
    """Return the names of the fields with a mark, of some dataclasses of options."""
    fields = (field for group in groups for field in dataclasses.fields(group))
    return tuple(field.name for field in fields if mark in field.metadata.get(_MARKS, ()))


def grouped(*, without: Collection[str] = ()) -> Callable[[Command], Command]:
    """Return a decorator that gives a command the fields of its dataclass parameters as options.

    The fields, and the other parameters, are annotated as those of a typer command, or made by :func:`option`. The
    command itself is called with the dataclasses.

    Args:
        without: fields that are no options of this command; they keep their defaults.
    """

    def decorate(command: Command) -> Command:
        hints = typing.get_type_hints(command, include_extras=True)
        parameters: list[inspect.Parameter] = []
        groups: dict[str, type[Any]] = {}
        for parameter in inspect.signature(command).parameters.values():
            kind = hints[parameter.name]
            if dataclasses.is_dataclass(kind) and isinstance(kind, type):
                groups[parameter.name] = kind
                parameters += [each for each in _options(kind) if each.name not in without]
            else:
                parameters.append(_parameter(parameter.name, kind, parameter.default))

        parameters.append(inspect.Parameter(_CONTEXT, inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context))

        def called(**values: Any) -> None:
            source = values.pop(_CONTEXT).get_parameter_source
            _GIVEN.set(frozenset(name for name in values if getattr(source(name), "name", "") == "COMMANDLINE"))
            for name, kind in groups.items():
                fields = [field.name for field in dataclasses.fields(kind) if field.name not in without]
                values[name] = kind(**{field: values.pop(field) for field in fields})
            command(**values)

        called.__name__, called.__doc__ = command.__name__, command.__doc__
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {each.name: each.annotation for each in parameters}
        return called

    return decorate


def given(name: str) -> bool:
    """Return whether the user gave a parameter of the running grouped command; False outside of one."""
    return name in _GIVEN.get()


def flag(field: "dataclasses.Field[Any]") -> str:
    """Return the option of a field of a dataclass of options: "--max-error"."""
    about = field.metadata.get(_OPTION)
    declared = () if about is None else (about.default, *(about.param_decls or ()))  # typer sorts them later
    usual = f"--{field.name.replace('_', '-')}"
    return next((each for each in declared if str(each).startswith("--")), usual).partition("/")[0]


def _options(kind: type[Any]) -> list[inspect.Parameter]:
    """Return the fields of a dataclass as parameters."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return [_parameter(field.name, hints[field.name], field) for field in dataclasses.fields(kind)]


def _parameter(name: str, hint: Any, default: Any) -> inspect.Parameter:
    """Return a parameter, whose default may be a field; keyword-only, since typer passes names."""
    if isinstance(default, dataclasses.Field):
        hint = Annotated[hint, default.metadata[_OPTION]] if _OPTION in default.metadata else hint
        default = inspect.Parameter.empty if default.default is dataclasses.MISSING else default.default
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)
