"""The check as a JUnit report, which every CI shows: a test case for each case of the suite, the whole, and time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree

from simharness.gate.baseline import TIME
from simharness.gate.check import Check
from simharness.gate.comparing import Change
from simharness.gate.wording import sentence

WHOLE, SPEED = "whole suite", "time of the method"

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


def junit(check: Check) -> str:
    """The report, XML.

    A regression is a failure of its case, with all that got worse; a trial that could not be run is an error of its
    case.
    """
    suite = ElementTree.Element("testsuite", name=check.suite, time=f"{check.seconds:.1f}")
    worse = check.comparison.that_are("worse")
    _add(suite, check, WHOLE, [change for change in worse if change.case is None and change.score != TIME])
    for case in check.comparison.cases:
        _add(suite, check, case, [change for change in worse if change.case == case])
    _add(suite, check, SPEED, [change for change in worse if change.score == TIME])
    for kind in ("failure", "error"):
        suite.set(f"{kind}s", str(len(suite.findall(f"testcase/{kind}"))))
    suite.set("tests", str(len(suite)))
    root = ElementTree.Element("testsuites", name="simharness check")
    root.append(suite)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(suite: ElementTree.Element, check: Check, name: str, worse: Sequence[Change]) -> None:
    """Add a test case."""
    case = ElementTree.SubElement(suite, "testcase", classname=f"simharness.{_clean(check.suite)}", name=_clean(name))
    # Without cases of its own the suite is one case, and what failed in it belongs there.
    failed = [each for each in check.failed if each.case == name or (name == WHOLE and not check.comparison.cases)]
    if failed:
        said = "\n".join(f"seed {each.seed}: {each.error}" for each in failed)
        _problem(case, "error", f"{len(failed)} trials could not be run", said)
    elif worse:
        _problem(case, "failure", sentence(worse[0], check.gate), "\n".join(sentence(c, check.gate) for c in worse))


def _problem(case: ElementTree.Element, kind: str, message: str, text: str) -> None:
    ElementTree.SubElement(case, kind, message=_clean(message)).text = _clean(text)


def _clean(text: str) -> str:
    """Without the characters that XML cannot hold."""
    return _FORBIDDEN.sub("?", text)
