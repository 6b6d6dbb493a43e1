"""Runs of the gate, of tests and of effects over bugs, several at a time, each in its own copy of the checkout."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.planted_bugs.catalogue import Bug, read_catalogue
from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.effects import effect, fresh_seeds, read_scores
from benchmarks.planted_bugs.gate import Gate, write_suite
from benchmarks.planted_bugs.hunting import hunt_bug
from benchmarks.planted_bugs.near_tests import run_tests
from benchmarks.planted_bugs.records import Outcome, Records
from benchmarks.planted_bugs.simulations import first_stage
from simharness.scenario.load import load_study

_LOCK = threading.Lock()
_SLOWER = 12.0  # times the limit of a bug: the first run compiles all kernels and simulates everything
_FEWEST = 6  # seeds that the gate accepts
_SIMULATED = 24  # most fresh seeds for a bug in the simulator, which must simulate everything again; 12 prove nothing

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
    """Folder with a copy of the checkout, simulations and finished results.

    Args:
        folder: the folder.
        records: finished results.
        workers: number of bugs that are run at the same time.
        limit: time limit of one run, seconds.
    """

    def __init__(self, folder: Path, records: Records, *, workers: int, limit: float) -> None:
        self._folder, self._records, self._workers, self._limit = folder.resolve(), records, workers, limit
        self._clean = Checkout.make(self._folder / "checkout")
        if not any(self._clean.root.rglob("__pycache__/*.nbk")):
            _say("compile kernels")
            run_tests(self._clean, _WARM, limit=_SLOWER * limit)

    def tests(self, bugs: Iterable[Bug]) -> dict[str, Outcome]:
        """Run the tests near each bug with the bug planted.

        Tests that fail without any bug notice nothing.
        """

        def run(bug: Bug) -> Outcome:
            clean = self._clean_tests(bug.tests)
            if clean.caught:
                return Outcome(False, f"fails without the bug: {clean.what}", clean.seconds)
            with self._clean.planted(bug) as planted:
                return run_tests(planted, bug.tests, limit=self._limit)

        return self._outcomes("tests", bugs, run)

    def gate(self, bugs: Iterable[Bug]) -> dict[str, Outcome]:
        """Run the gate with each bug planted, on the suite of the bug, against a baseline without bugs."""
        bugs = list(bugs)
        gates = {suite: self._gate(suite) for suite in _suites(bugs)}
        return self._outcomes("gate", bugs, lambda bug: gates[bug.suite].check_bug(self._clean, bug, limit=self._limit))

    def hunts(self, bugs: Iterable[Bug]) -> dict[str, Outcome]:
        """Hunt for each bug, with the bug planted."""

        def run(bug: Bug) -> Outcome:
            return hunt_bug(self._clean, bug, folder=self._folder / "hunts" / bug.id, limit=self._limit)

        return self._outcomes("hunt", bugs, run)

    def effects(self, bugs: Iterable[Bug], *, seeds: int) -> dict[str, str]:
        """Measure the effect of each bug on the scores of its suite with fresh seeds, as text."""
        bugs = list(bugs)
        values: dict[str, str] = {}
        for suite in _suites(bugs):
            values |= self._effects(suite, [bug for bug in bugs if bug.suite == suite], seeds)
        return {bug.id: values[bug.id] for bug in bugs}

    def _effects(self, name: str, bugs: list[Bug], seeds: int) -> dict[str, str]:
        """Measure the effects of bugs on the scores of one suite."""
        suite = self._folder / f"fresh-{name}-{seeds}.toml"
        few = self._folder / f"fresh-{name}-{min(seeds, _SIMULATED)}.toml"
        for path, count in ((suite, seeds), (few, min(seeds, _SIMULATED))):
            write_suite(path, suite=name, seeds=fresh_seeds(count))
        gate = self._gate(str(suite))
        before = read_scores(gate.baseline)

        def run(bug: Bug) -> dict[str, Any]:
            first = first_stage(bug.file)
            into = self._folder / "effects" / f"{bug.id}.json"
            with self._clean.planted(bug) as planted:
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
        """Run each suite on the code without bugs, each time with another noise of the detector."""
        changes = [
            replace(
                NEUTRAL,
                id=f"{suite}-{n}",
                edits=tuple((text, other.replace("{n}", str(n))) for text, other in NEUTRAL.edits),
                suite=suite,
            )
            for suite in _suites(read_catalogue().values())
            for n in range(1, count + 1)
        ]
        gates = {suite: self._gate(suite) for suite in _suites(changes)}
        return self._outcomes(
            "clean", changes, lambda bug: gates[bug.suite].check_bug(self._clean, bug, limit=self._limit)
        )

    def _gate(self, suite: str) -> Gate:
        """Return the gate of a suite, with a baseline of this code; it is made where it is missing."""
        name = Path(suite).stem
        gate = Gate(suite, self._folder / f"baseline-{name}.json", self._folder / "simulations")
        if self._records.value("baseline", name) is None or not gate.baseline.is_file():
            _say(f"baseline of {name}, without bugs")
            self._simulate(gate, name)
            done = gate.measure(
                self._clean, first="estimates", keep=True, into=gate.baseline, limit=_SLOWER * self._limit
            )
            if done.code != 0:
                raise RuntimeError(f"the suite cannot be measured without bugs:\n{done.output}")
            self._records.add("baseline", name, value={"seconds": done.seconds})
        return gate

    def _simulate(self, gate: Gate, name: str) -> None:
        """Simulate a suite in several processes, each some of its seeds, before its scores are measured in one."""
        seeds = load_study(gate.suite).seeds
        parts = [seeds[k :: self._workers] for k in range(self._workers)]

        def simulate(k: int) -> None:
            part = replace(gate, suite=str(self._folder / "parts" / f"{name}-{k}.toml"))
            write_suite(Path(part.suite), suite=gate.suite, seeds=parts[k])
            into = self._folder / "parts" / f"{name}-{k}.json"
            part.measure(self._clean, first="estimates", keep=True, into=into, limit=_SLOWER * self._limit)

        if min(map(len, parts)) >= _FEWEST:
            with ThreadPoolExecutor(self._workers) as pool:
                list(pool.map(simulate, range(self._workers)))

    def _clean_tests(self, tests: tuple[str, ...]) -> Outcome:
        """Return the outcome of tests without bugs; each set of tests is run once."""
        known = self._records.outcome("clean tests", *tests)
        if known is None:
            known = run_tests(self._clean, tests, limit=_SLOWER * self._limit)
            self._records.add("clean tests", *tests, value=known)
        return known

    def _outcomes(self, what: str, bugs: Iterable[Bug], run: Callable[[Bug], Outcome]) -> dict[str, Outcome]:
        return {name: Outcome(**value) for name, value in self._each(what, bugs, run).items()}

    def _each(
        self, what: str, bugs: Iterable[Bug], run: Callable[[Bug], Outcome | dict[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Run a function on each bug that has no result yet; return all results by the name of the bug."""
        bugs = list(bugs)
        left = [bug for bug in bugs if self._records.value(what, bug.id, bug.digest) is None]

        def run_one(bug: Bug) -> Bug:
            self._records.add(what, bug.id, bug.digest, value=run(bug))
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
                    shown = f"caught: {value['what']}" if value["caught"] else value["what"] or "passed"
                _say(f"{what} {done}/{len(left)} {bug.id}: {shown} ({value['seconds']:.0f} s)")
        results = {bug.id: self._records.value(what, bug.id, bug.digest) for bug in bugs}
        return {name: value for name, value in results.items() if value is not None}


def _suites(bugs: Iterable[Bug]) -> list[str]:
    """Return the suites that have to notice some bugs."""
    return list(dict.fromkeys(bug.suite for bug in bugs))


def _say(text: str) -> None:
    with _LOCK:
        print(text, file=sys.stderr, flush=True)
