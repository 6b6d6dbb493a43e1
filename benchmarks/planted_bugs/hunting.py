"""Hunts for planted bugs: a bug is found if a trial fails with most draws of noise with it, and not without it."""

from __future__ import annotations

import json
import shutil
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.records import Outcome
from simharness.hunt.hunt_run import TRIALS as TRIALS_FILE
from simharness.hunt.hunted_trial import NOISES, hunt_in_trial
from simharness.hunt.properties import USUAL
from simharness.scenario.load import read_plan

SCENARIO = Path(__file__).with_name("hunted.toml")
TRIALS = 64
"""Trials of one hunt."""

HUNTED = (
    "undistortion-p1-sign",
    "rays-principal-point",
    "affinity-threshold",
    "matching-two-per-view",
    "duplicates-threshold",
    "likelihood-not-robust",
    "likelihood-no-pixel",
    "pictorial-no-single-views",
    "covariance-no-ambiguity",
    "person-lost",
    "matching-lambda",
    "matching-no-warm-start",
)
"""Bugs of the method that are hunted by default. The last two change no result: finding one would be a false alarm."""

_PROPERTIES = (*USUAL, "displaced_joint")
_FEWEST = NOISES - 1  # fresh draws of noise of which a failure takes so many with the bug, and none without it


def hunt_bug(clean: Checkout, bug: Bug, *, folder: Path, limit: float) -> Outcome:
    """Hunt in a copy with a bug, and run the trials that failed in the copy without it.

    Args:
        clean: the copy without the bug.
        bug: the bug.
        folder: folder of the hunt; what it has of earlier code is removed.
        limit: time limit, seconds.
    """
    shutil.rmtree(folder, ignore_errors=True)
    properties = [word for name in _PROPERTIES for word in ("--property", name)]
    scenario = str(clean.root / "benchmarks" / "planted_bugs" / SCENARIO.name)
    options = ["--trials", str(TRIALS), "--keep", "0", "--out", str(folder), *properties]
    with clean.planted(bug) as planted:
        done = planted.run(["-m", "simharness.cli", "hunt", scenario, *options], limit=limit)
    if done.code != 0:
        what = "no end" if done.code is None else (done.output.strip().splitlines() or ["no output"])[-1]
        return Outcome(True, f"the hunt stops: {what}", done.seconds)
    again = clean.run(["-m", "benchmarks.planted_bugs.hunting", str(folder / "hunted" / TRIALS_FILE)], limit=limit)
    if again.code != 0:
        raise RuntimeError(f"trials cannot be run without the bug:\n{again.output}")
    found = again.output.strip().splitlines()
    return Outcome(bool(found), found[0] if found else "", done.seconds)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the failures of a file of trials that come back with (almost) all draws of noise there, and with none here.

    A line for each property, with the number of its failures, the most frequent property first.
    """
    (path,) = sys.argv[1:] if arguments is None else arguments
    plan, found = read_plan(SCENARIO), Counter[str]()
    for row in map(json.loads, Path(path).read_text(encoding="utf-8").splitlines()[1:]):
        failed = [each for each in row["findings"] if each["failed"] >= _FEWEST]
        if not failed:
            continue
        now = hunt_in_trial(plan.at(row["values"], row["seed"]), ("full",), properties=_PROPERTIES)
        known = {(each.violated, each.person) for each in now.findings}
        found.update(each["violated"] for each in failed if (each["violated"], each["person"]) not in known)
    for name, count in found.most_common():
        print(f"{name}: {count} failures that are none without the bug")


if __name__ == "__main__":
    main()
