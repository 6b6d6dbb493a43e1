"""JUnit report of a gate check: a test case for each case of the suite, the whole suite, and time."""

from __future__ import annotations

import re
from collections.abc import Callable
from xml.etree import ElementTree

from simharness.gate.baseline import TIME
from simharness.gate.change_text import sentence
from simharness.gate.compare import Change
from simharness.gate.gate_result import GateResult

WHOLE, SPEED = "whole suite", "time of the method"

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


def junit(check: GateResult) -> str:
    """Return the report as XML.

    A regression is a failure of its case and lists all scores that got worse; so is an unexpected improvement that
    nobody has accepted. A trial that could not be run is an error
    of its case. An undecided loss fails nothing; it is printed as output of its case.
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
