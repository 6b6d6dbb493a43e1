"""[method]: the variants under test, presets of ``mvpose.Pipeline`` and user-defined estimators."""

import difflib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from simharness.scenario.sections.section import Section, key

NAME = r"^[a-z0-9][a-z0-9_-]*$"
"""Pattern of the names of scenarios and estimators."""
_PLACE = r"^.+:[A-Za-z_]\w*$"


class EstimatorsSection(Section):
    """User-defined estimators by name: a file or module, and its attribute with a method ``estimate``."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "additionalProperties": {"type": "string", "pattern": _PLACE},
            "propertyNames": {"pattern": NAME},
        },
    )
    __pydantic_extra__: dict[str, str]

    @property
    def places(self) -> dict[str, str]:
        """Place of each estimator, by name: "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"."""
        return dict(self.model_extra or {})

    @property
    def files(self) -> tuple[Path, ...]:
        """Files among the places."""
        sources = (place.rpartition(":")[0] for place in self.places.values())
        return tuple(Path(source) for source in sources if source.endswith(".py"))

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, place in self.places.items():
            if not re.match(NAME, name):
                raise ValueError(f"names of lowercase letters, digits, - and _; {name!r} has other characters")
            if not re.match(_PLACE, place):
                raise ValueError(f"FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE; {place!r} of {name!r} is neither")
        return self


class MethodSection(Section):
    """Variants of the method that run on the detections."""

    variants: tuple[str, ...] = key(
        ("full", "no-3dps"),
        "presets of mvpose.Pipeline, also with +repair behind them: the rig and the clocks are repaired "
        "from the whole trial first; and names of method.estimators",
        min_length=1,
        max_length=100,
    )
    lag: Annotated[float, Field(ge=0.0, le=36_000.0)] = key(
        0.2,
        "track and track-fast: time of later frames that an estimate waits for, seconds; 0: none; at least "
        "the duration: the whole recording",
    )
    estimators: EstimatorsSection = key(
        EstimatorsSection(), 'user-defined estimators: name = "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"'
    )


def module_file(place: str, folder: Path) -> Path | None:
    """Return the file in a folder of the module "PACKAGE.MODULE" or "PACKAGE.MODULE:ATTRIBUTE"; None without one."""
    module = folder.joinpath(*place.partition(":")[0].split("."))
    return next((file for file in (module.with_suffix(".py"), module / "__init__.py") if file.is_file()), None)


def wrong_variants(method: MethodSection) -> Iterator[tuple[str, str]]:
    """Yield the faulty keys of section [method], each with a message."""
    from mvpose.presets import PRESETS, without_repair  # only where a method is checked: it imports the whole method

    estimators = method.estimators.places
    for name in estimators:
        if name in PRESETS:
            yield f"estimators.{name}", "this is the name of a preset of mvpose.Pipeline; choose another name"
    known = [*PRESETS, *estimators]
    for name in method.variants:
        if name not in known and without_repair(name) not in PRESETS:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            yield "variants", f"unknown variant {name!r}; {hint}expected one of {', '.join(known)}"
    if len(set(method.variants)) < len(method.variants):
        yield "variants", f"{', '.join(method.variants)}: a variant is listed twice; remove the repetition"
