"""What is wrong with the variants that a scenario names, before any is made."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from mvpose.pipeline import PRESETS
from simharness.scenario.sections.scenario import Method


def wrong_variants(method: Method) -> Iterator[tuple[str, str]]:
    """Keys of section [method], and what to say of each."""
    own = method.estimators.places
    for name in own:
        if name in PRESETS:
            yield f"estimators.{name}", "that is a preset of mvpose.Pipeline; choose another name"
    known = [*PRESETS, *own]
    for name in method.variants:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            yield "variants", f"there is no {name!r}; {hint}there are {', '.join(known)}"
    if len(set(method.variants)) < len(method.variants):
        yield "variants", f"{', '.join(method.variants)} has one twice; take one out"
