"""Reports of a gate check: a Markdown summary for the page of a workflow run on GitHub, and JUnit for CI.

The JUnit report has a test case for each case of the suite, the whole suite, and time. Changes of scores are the same
text in both and in the terminal.
"""

import math
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from mvpose.report.documents import fill_template
from simharness.gate.baseline import TIME
from simharness.gate.compare import Change, GateResult, Verdict
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.catalogue import SCORES

_HEADINGS: dict[str, Verdict] = {"Worse": "worse", "Better than its bound": "unexpected", "Better": "better"}
_LISTED = 20  # changes of each kind: a bug that breaks everything breaks a hundred scores

WHOLE, SPEED = "whole suite", "time of the method"
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


def markdown(check: GateResult) -> str:
    """Return the summary: verdict, regressions, gains, headline scores, and the command that runs the worst trial."""
    lists = [("Could not be run", [f"{each.case}, seed {each.seed}: {each.error}" for each in check.failed], "")]
    for heading, verdict in _HEADINGS.items():
        lines = [sentence(change) for change in check.comparison.with_verdict(verdict)]
        lists.append((heading, lines, check.advice if verdict == "unexpected" else ""))
    lists.append(("Worse, but too few seeds to judge", [sentence(change) for change in check.comparison.undecided], ""))
    templates = Path(__file__).parent / "templates"
    given = {"check": check, "lists": lists, "listed": _LISTED, "plain": _escaped, "cells": _cells}
    return fill_template("summary.md", folder=templates, **given) + "\n"


def _cells(change: Change) -> tuple[str, ...]:
    after, before = (number(change.score, value) for value in (change.after, change.before))
    verdict = "" if change.verdict == "same" else f"**{change.verdict}**"
    return title(change.score), after, before, difference(change), allowed(change), verdict


def _escaped(text: str) -> str:
    """Return text on one line, with the characters escaped that start a table cell or HTML in Markdown."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def title(score: str) -> str:
    """Return the title of a score with its unit."""
    if score == TIME:
        return "Time, × reference"
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def number(score: str, value: float) -> str:
    """Return a value of a score as text."""
    return fixed(value, _digits(score))


def difference(change: Change) -> str:
    """Return a change with its interval as text; a ratio for time."""
    if change.score != TIME and change.difference == change.low == change.high == 0:
        return "none"
    interval = ""
    if math.isfinite(change.low):
        interval = f" ({difference_text(change.score, change.low)} to {difference_text(change.score, change.high)})"
    return difference_text(change.score, change.difference) + interval


def allowed(change: Change) -> str:
    """Return the changes that fail nothing as text: from the largest loss to the largest gain."""
    loss, gain = change.allowed.loss, change.allowed.gain
    if change.score == TIME:
        return f"to {difference_text(TIME, math.exp(loss))}"
    info = SCORES[change.score]
    if info.target is not None:
        return f"±{gain:g}, off {info.target:g} +{loss:g}"
    low, high = (-loss, gain) if info.better == "higher" else (-gain, loss)
    return f"{low:g} to +{high:g}"


def place(change: Change) -> str:
    """Return the case of a change, or "whole suite"."""
    return change.case or "whole suite"


def sentence(change: Change) -> str:
    """Return a change as one line of text."""
    before, after = (number(change.score, value) for value in (change.before, change.after))
    return (
        f"{change.variant}, {place(change)}: {title(change.score)}: {before} before, {after} now: "
        f"{difference(change)}, allowed {allowed(change)}, p = {change.p:.2g} over {change.n} seeds"
        f"{f'; {change.where}' if change.where else ''}"
    )


def _digits(score: str) -> int:
    return 2 if score == TIME else SCORES[score].digits


def difference_text(score: str, value: float) -> str:
    """Return a difference of a score with its sign; a ratio for time."""
    return f"×{value:.2f}" if score == TIME else signed(value, max(_digits(score), 1))


def junit(check: GateResult) -> str:
    """Return the report as XML.

    A regression is a failure of its case and lists all scores that got worse; so is an unexpected improvement that
    nobody has accepted. A trial that could not be run is an error of its case. An undecided loss fails nothing; it is
    printed as output of its case.
    """
    suite = ElementTree.Element("testsuite", name=check.suite, time=f"{check.seconds:.1f}")
    _add(suite, check, WHOLE, _of(None))
    for case in check.comparison.cases:
        _add(suite, check, case, _of(case))
    _add(suite, check, SPEED, lambda change: change.score == TIME)
    for kind in ("failure", "error"):
        suite.set(f"{kind}s", str(len(suite.findall(f"testcase/{kind}"))))
    suite.set("tests", str(len(suite)))
    root = ElementTree.Element("testsuites", name="simharness check")
    root.append(suite)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _of(case: str | None) -> Callable[[Change], bool]:
    """Return a predicate: whether a change is a change of a score, not of time, in a case (None: whole suite)."""
    return lambda change: change.case == case and change.score != TIME


def _add(suite: ElementTree.Element, check: GateResult, name: str, belongs: Callable[[Change], bool]) -> None:
    """Add a test case with the changes that belong to it."""
    worse = list(filter(belongs, check.comparison.with_verdict("worse")))
    refused = list(filter(belongs, check.refused))
    undecided = list(filter(belongs, check.comparison.undecided))
    case = ElementTree.SubElement(suite, "testcase", classname=f"simharness.{_clean(check.suite)}", name=_clean(name))
    # A suite without cases is one test case, which gets all failed trials.
    failed = [each for each in check.failed if each.case == name or (name == WHOLE and not check.comparison.cases)]
    if failed:
        text = "\n".join(f"seed {each.seed}: {each.error}" for each in failed)
        _problem(case, "error", f"{len(failed)} trials could not be run", text)
    elif worse or refused:
        parts = [("worse", worse), ("unexpected improvement", refused)]
        lines = [f"{kind}: {sentence(change)}" for kind, changes in parts for change in changes]
        _problem(case, "failure", lines[0], "\n".join([*lines, check.advice] if refused else lines))
    if undecided:
        text = "\n".join(["worse, but too few seeds to judge", *map(sentence, undecided)])
        ElementTree.SubElement(case, "system-out").text = _clean(text)


def _problem(case: ElementTree.Element, kind: str, message: str, text: str) -> None:
    ElementTree.SubElement(case, kind, message=_clean(message)).text = _clean(text)


def _clean(text: str) -> str:
    """Replace the characters that XML 1.0 forbids."""
    return _FORBIDDEN.sub("?", text)
