"""The gate as shipped, run on a suite with a bug planted, against a baseline of the same copy without bugs."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import Checkout, Finished
from benchmarks.planted_bugs.records import Outcome
from benchmarks.planted_bugs.simulations import First, first_stage

_PASSED, _REGRESSION = 0, 1
_VERDICT = re.compile(r"^(?:worse|unexpected|failed)\b.*", re.MULTILINE)


def write_suite(path: Path, *, suite: str, seeds: Sequence[int]) -> None:
    """Write a suite that is another suite at other seeds.

    Args:
        path: the file.
        suite: the other suite, a name or a file.
        seeds: the seeds.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"extends = {json.dumps(suite)}\nname = {json.dumps(path.stem)}\nseeds = {list(seeds)}\n", "utf-8")


@dataclass(frozen=True)
class Gate:
    """Gate with a baseline without bugs.

    Attributes:
        suite: suite, a name or a file.
        baseline: file of the baseline.
        simulations: folder of the simulations of the run without bugs.
    """

    suite: str
    baseline: Path
    simulations: Path

    def measure(self, copy: Checkout, *, first: First, keep: bool = False, into: Path, limit: float) -> Finished:
        """Run the suite and write its scores into a file.

        Args:
            copy: the copy of the checkout, with or without a bug.
            first: first stage to run, for simulations that the folder has.
            keep: whether to keep other simulations in the folder.
            into: file in the format of baselines.
            limit: time limit, seconds.
        """
        return self._run(copy, first, keep, into, ["--update-baseline"], limit)

    def check(self, copy: Checkout, *, first: First, limit: float) -> Outcome:
        """Return whether the check fails, and its first line that says why.

        Raises:
            RuntimeError: the check ended neither with success nor with a regression.
        """
        done = self._run(copy, first, False, self.baseline, [], limit)
        if done.code is None:
            return Outcome(True, f"no end after {limit:.0f} s", done.seconds)
        if done.code == _PASSED:
            return Outcome(False, "", done.seconds)
        verdicts = _VERDICT.findall(done.output)
        if done.code != _REGRESSION or not verdicts:
            last = (done.output.strip().splitlines() or ["no output"])[-1]
            return Outcome(True, f"exit code {done.code}: {last}", done.seconds)
        return Outcome(True, " ".join(verdicts[0].split()), done.seconds)

    def check_bug(self, copy: Checkout, bug: Bug, *, limit: float) -> Outcome:
        """Return the outcome of :meth:`check` with a bug planted."""
        with copy.planted(bug) as planted:
            return self.check(planted, first=first_stage(bug.file), limit=limit)

    def _run(
        self, copy: Checkout, first: First, keep: bool, baseline: Path, options: list[str], limit: float
    ) -> Finished:
        stored = [str(self.simulations), first, "keep" if keep else "use"]
        command = ["check", self.suite, "--baseline", str(baseline), *options]
        return copy.run(["-m", "benchmarks.planted_bugs.simulations", *stored, *command], limit=limit)
