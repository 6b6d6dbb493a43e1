"""Runs of the gate, of tests and of effects over bugs, several at a time, each in its own copy of the checkout."""

from __future__ import annotations

import queue
import sys
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.effects import effect, read_scores, write_suite
from benchmarks.planted_bugs.gate import SUITE, Gate
from benchmarks.planted_bugs.near_tests import run_tests
from benchmarks.planted_bugs.records import Outcome, Records
from benchmarks.planted_bugs.simulations import first_stage

_LOCK = threading.Lock()
_SLOWER = 12.0  # times the limit of a bug: the first run compiles all kernels and simulates everything
_SIMULATED = 12  # most fresh seeds for a bug in the simulator, which must simulate everything again

_WARM = ("tests/mvpose/test_pipeline.py", "tests/mvpose/reconstruction", "tests/simharness/capture/test_rays.py")

NEUTRAL = Bug(
    id="neutral",
    file="simharness/detector/draws.py",
    edits=(
        (
            'return stream(self.seed, "detector", *key).random(',
            'return stream(self.seed, "detector", {n}, *key).random(',
        ),
        (
            'return stream(self.seed, "detector", *key).standard_normal(',
            'return stream(self.seed, "detector", {n}, *key).standard_normal(',
        ),
    ),
    breaks="nothing: the detector has another noise",
    tests=("tests/simharness/detector/test_draws.py",),
    effect="equivalent",
    why="another noise of the same distribution",
)
"""Template of a change that makes nothing worse."""


class Bench:
    """Folder with copies of the checkout, compiled kernels, simulations and finished results.

    Args:
        folder: the folder.
        records: finished results.
        workers: number of copies in which bugs are run at the same time.
        limit: time limit of one run, seconds.
    """

    def __init__(self, folder: Path, records: Records, *, workers: int, limit: float) -> None:
        self._folder, self._records, self._limit = folder.resolve(), records, limit
        self._free: queue.SimpleQueue[Checkout] = queue.SimpleQueue()
        self._workers = workers
        with ThreadPoolExecutor(workers) as pool:
            for copy in pool.map(self._make_copy, range(workers)):
                self._free.put(copy)

    def tests(self, bugs: Iterable[Bug]) -> dict[str, Outcome]:
        """Run the tests near each bug with the bug planted.

        Raises:
            ValueError: the tests fail without any bug.
        """

        def run(copy: Checkout, bug: Bug) -> Outcome:
            clean = self._clean_tests(copy, bug.tests)
            if clean.caught:
                raise ValueError(
                    f"{clean.what} fails without any bug: mend it, or run on a checkout in which it passes"
                )
            with copy.planted(bug) as planted:
                return run_tests(planted, bug.tests, limit=self._limit)

        return self._outcomes("tests", bugs, run)

    def gate(self, bugs: Iterable[Bug]) -> dict[str, Outcome]:
        """Run the gate with each bug planted, against a baseline without bugs."""
        gate = self._gate(SUITE)
        return self._outcomes("gate", bugs, lambda copy, bug: gate.check_bug(copy, bug, limit=self._limit))

    def effects(self, bugs: Iterable[Bug], *, seeds: int) -> dict[str, str]:
        """Measure the effect of each bug on the scores of the suite with fresh seeds, as text."""
        suite = self._folder / f"fresh-{seeds}.toml"
        few = self._folder / f"fresh-{min(seeds, _SIMULATED)}.toml"
        for path, count in ((suite, seeds), (few, min(seeds, _SIMULATED))):
            write_suite(path, suite=SUITE, seeds=count)
        gate = self._gate(str(suite))
        before = read_scores(gate.baseline)

        def run(copy: Checkout, bug: Bug) -> dict[str, Any]:
            first = first_stage(bug.file)
            into = self._folder / "effects" / f"{bug.id}.json"
            with copy.planted(bug) as planted:
                measured = replace(gate, suite=str(suite if first == "estimates" else few))
                done = measured.measure(planted, first=first, into=into, limit=self._limit * seeds / _SIMULATED)
            if done.code != 0:
                return {"text": f"trials fail: {done.output.strip().splitlines()[0]}", "seconds": done.seconds}
            found = effect(before, read_scores(into))
            size = "clear" if found.clear else "identical" if found.identical else "not clear"
            return {"text": f"{size}: {found.text}, p = {found.p:.2g}, {found.seeds} seeds", "seconds": done.seconds}

        values = self._each(f"effect-{seeds}", bugs, run)
        return {name: value["text"] for name, value in values.items()}

    def clean_runs(self, count: int) -> dict[str, Outcome]:
        """Run the gate on the code without bugs, each time with another noise of the detector."""
        gate = self._gate(SUITE)
        changes = [
            replace(
                NEUTRAL,
                id=f"neutral-{n}",
                edits=tuple((text, other.replace("{n}", str(n))) for text, other in NEUTRAL.edits),
            )
            for n in range(1, count + 1)
        ]
        return self._outcomes("clean", changes, lambda copy, bug: gate.check_bug(copy, bug, limit=self._limit))

    def _make_copy(self, number: int) -> Checkout:
        """Copy the checkout, and compile the kernels that tests and gate use most where they are not compiled yet."""
        kernels = self._folder / "kernels" / str(number)
        copy = Checkout.make(self._folder / "copies" / str(number), kernels)
        if not any(kernels.iterdir()):
            _say(f"copy {number}: compile kernels")
            run_tests(copy, _WARM, limit=_SLOWER * self._limit)
        return copy

    def _gate(self, suite: str) -> Gate:
        """Return the gate of a suite, with a baseline of this code; it is made where it is missing."""
        name = Path(suite).stem
        gate = Gate(suite, self._folder / f"baseline-{name}.json", self._folder / "simulations")
        if self._records.value("baseline", name) is None or not gate.baseline.is_file():
            _say(f"baseline of {name}, without bugs")
            copy = self._free.get()
            try:
                limit = _SLOWER * self._limit
                done = gate.measure(copy, first="scenes", keep=True, into=gate.baseline, limit=limit)
            finally:
                self._free.put(copy)
            if done.code != 0:
                raise RuntimeError(f"the suite cannot be measured without bugs:\n{done.output}")
            self._records.add("baseline", name, value={"seconds": done.seconds})
        return gate

    def _clean_tests(self, copy: Checkout, tests: tuple[str, ...]) -> Outcome:
        """Return the outcome of tests without bugs; each set of tests is run once."""
        known = self._records.outcome("clean tests", *tests)
        if known is None:
            known = run_tests(copy, tests, limit=_SLOWER * self._limit)
            self._records.add("clean tests", *tests, value=known)
        return known

    def _outcomes(self, what: str, bugs: Iterable[Bug], run: Callable[[Checkout, Bug], Outcome]) -> dict[str, Outcome]:
        return {name: Outcome(**value) for name, value in self._each(what, bugs, run).items()}

    def _each(
        self, what: str, bugs: Iterable[Bug], run: Callable[[Checkout, Bug], Outcome | dict[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Run a function on each bug that has no result yet; return all results by the name of the bug."""
        bugs = list(bugs)
        left = [bug for bug in bugs if self._records.value(what, bug.id, bug.digest) is None]

        def run_one(bug: Bug) -> Bug:
            copy = self._free.get()
            try:
                self._records.add(what, bug.id, bug.digest, value=run(copy, bug))
            finally:
                self._free.put(copy)
            return bug

        with ThreadPoolExecutor(self._workers) as pool:
            futures = [pool.submit(run_one, bug) for bug in left]
            for done, future in enumerate(as_completed(futures), 1):
                try:
                    bug = future.result()
                except BaseException:
                    for other in futures:
                        other.cancel()
                    raise
                value = self._records.value(what, bug.id, bug.digest) or {}
                if "text" in value:
                    shown = value["text"]
                else:
                    shown = f"caught: {value['what']}" if value["caught"] else "passed"
                _say(f"{what} {done}/{len(left)} {bug.id}: {shown} ({value['seconds']:.0f} s)")
        results = {bug.id: self._records.value(what, bug.id, bug.digest) for bug in bugs}
        return {name: value for name, value in results.items() if value is not None}


def _say(text: str) -> None:
    with _LOCK:
        print(text, file=sys.stderr, flush=True)
