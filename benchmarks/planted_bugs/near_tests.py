"""Tests near a bug, run with the bug planted."""

from __future__ import annotations

import re
from collections.abc import Sequence

from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.records import Outcome

_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
_NOTHING_RUN = 5  # exit code of pytest


def run_tests(copy: Checkout, tests: Sequence[str], *, limit: float) -> Outcome:
    """Run tests up to the first failure, without those marked as slow.

    Args:
        copy: the copy of the checkout.
        tests: test files and folders.
        limit: time limit, seconds; a bug that makes the tests hang is caught.
    """
    done = copy.run(
        ["-m", "pytest", "-x", "-q", "-m", "not slow", "--tb=no", "-p", "no:cacheprovider", *tests], limit=limit
    )
    if done.code is None:
        return Outcome(True, f"no end after {limit:.0f} s", done.seconds)
    if done.code == 0:
        return Outcome(False, "", done.seconds)
    if done.code == _NOTHING_RUN:
        raise ValueError(f"{' '.join(tests)}: no tests were run; correct the catalogue")
    failed = _FAILED.search(done.output)
    last = (done.output.strip().splitlines() or ["no output"])[-1]
    return Outcome(True, failed[1] if failed else f"exit code {done.code}: {last}", done.seconds)
