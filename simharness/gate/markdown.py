"""Markdown summary of a gate check, for the page of a workflow run on GitHub."""

from __future__ import annotations

from collections.abc import Iterator

from simharness.gate.change_text import allowed, difference, number, sentence, title
from simharness.gate.compare import Change, Verdict
from simharness.gate.gate_result import GateResult

_HEADINGS: dict[str, Verdict] = {"Worse": "worse", "Better than its bound": "unexpected", "Better": "better"}
_LISTED = 20  # changes of each kind: a bug that breaks everything breaks a hundred scores


def markdown(check: GateResult) -> str:
    """Return the summary: verdict, regressions, gains, headline scores, and the command that runs the worst trial."""
    return "\n".join(_lines(check)) + "\n"


def _lines(check: GateResult) -> Iterator[str]:
    yield f"## {check.suite}: {check.verdict}"
    yield ""
    yield f"{check.trials} trials in {check.seconds:.0f} s, compared with the baseline seed by seed."
    yield from _list("Could not be run", [f"{each.case}, seed {each.seed}: {each.error}" for each in check.failed])
    for heading, verdict in _HEADINGS.items():
        yield from _list(heading, [sentence(change) for change in check.comparison.with_verdict(verdict)])
        if verdict == "unexpected" and check.advice:
            yield ""
            yield check.advice
    undecided = [sentence(change) for change in check.comparison.undecided]
    yield from _list("Worse, but too few seeds to judge", undecided)
    for variant in check.variants:
        yield from _table(check, variant)
    yield ""
    yield f"{check.worst_description[0].upper()}{check.worst_description[1:]}"
    yield ""
    yield "```sh"
    yield check.command
    yield "```"


def _list(heading: str, lines: list[str]) -> Iterator[str]:
    if not lines:
        return
    yield ""
    yield f"### {heading}"
    yield ""
    for line in lines[:_LISTED]:
        yield f"- {_escaped(line)}"
    if len(lines) > _LISTED:
        yield f"- and {len(lines) - _LISTED} more"


def _table(check: GateResult, variant: str) -> Iterator[str]:
    yield ""
    yield f"### {_escaped(variant)}"
    yield ""
    yield "| score | now | baseline | difference (95 %) | allowed | |"
    yield "|:--|--:|--:|--:|--:|:--|"
    for change in check.comparison.changes_of(variant):
        yield f"| {' | '.join(_escaped(cell) for cell in _cells(change))} |"


def _cells(change: Change) -> tuple[str, ...]:
    after, before = (number(change.score, value) for value in (change.after, change.before))
    verdict = "" if change.verdict == "same" else f"**{change.verdict}**"
    return title(change.score), after, before, difference(change), allowed(change), verdict


def _escaped(text: str) -> str:
    """Return text on one line, with the characters escaped that start a table cell or HTML in Markdown."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
