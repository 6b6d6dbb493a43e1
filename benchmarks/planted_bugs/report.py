"""Table of the planted bugs: what noticed each of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.records import Outcome

_LONGEST = 90  # characters of a cell


@dataclass(frozen=True)
class Row:
    """Results of one bug; None where it was not run."""

    bug: Bug
    gate: Outcome | None
    tests: Outcome | None
    effect: str
    hunt: Outcome | None = None

    @property
    def caught(self) -> bool:
        """Whether the gate, the tests or a hunt noticed the bug."""
        return any(each is not None and each.caught for each in (self.gate, self.tests, self.hunt))


def rows(
    bugs: Iterable[Bug],
    gate: Mapping[str, Outcome],
    tests: Mapping[str, Outcome],
    effects: Mapping[str, str],
    hunts: Mapping[str, Outcome] = MappingProxyType({}),
) -> list[Row]:
    """Return a row for each bug from the results by name; an effect that was not measured is that of the catalogue."""
    return [
        Row(bug, gate.get(bug.id), tests.get(bug.id), effects.get(bug.id, bug.measured), hunts.get(bug.id))
        for bug in bugs
    ]


def table(results: Iterable[Row]) -> str:
    """Return the results as a Markdown table."""
    lines = ["| bug | breaks | effect | gate | tests | hunt |", "|---|---|---|---|---|---|"]
    for row in results:
        effect = " · ".join(filter(None, (row.bug.effect, row.effect or row.bug.why)))
        cells = (row.bug.id, row.bug.breaks, effect, _cell(row.gate), _cell(row.tests), _cell(row.hunt))
        lines.append("| " + " | ".join(each.replace("|", "/") for each in cells) + " |")
    return "\n".join(lines)


def totals(results: Iterable[Row]) -> str:
    """Return how many bugs were caught, by effect, and the names of the others."""
    lines = []
    results = list(results)
    for effect in dict.fromkeys(row.bug.effect for row in results):
        of_effect = [row for row in results if row.bug.effect == effect]
        by = [
            f"by {name} {sum(bool(getattr(row, field)) and getattr(row, field).caught for row in of_effect)}"
            for field, name in (("gate", "the gate"), ("tests", "tests"), ("hunt", "hunts"))
        ]
        missed = [row.bug.id for row in of_effect if not row.caught]
        line = f"{effect}: {len(of_effect)} bugs, caught {', '.join(by)}, by none {len(missed)}"
        lines.append(f"{line}: {', '.join(missed)}" if missed else line)
    return "\n".join(lines)


def _cell(outcome: Outcome | None) -> str:
    if outcome is None:
        return "not run"
    if not outcome.caught:
        return outcome.what or "passed"
    return outcome.what if len(outcome.what) <= _LONGEST else outcome.what[: _LONGEST - 1] + "…"
