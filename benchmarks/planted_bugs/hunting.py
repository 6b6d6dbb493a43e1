"""Hunts for planted bugs: a bug is found if a frame that was kept fails with the bug, and does not without it."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.records import Outcome
from simharness.hunt.kept_failure import failures_in
from simharness.hunt.properties import USUAL

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

_MOST, _FEWEST = 0.2, 0.8  # shares of noise seeds with which a frame that a bug breaks fails without and with it


def hunt_bug(clean: Checkout, bug: Bug, *, folder: Path, limit: float) -> Outcome:
    """Hunt in a copy with a bug, and replay the kept failures in the copy without it.

    Args:
        clean: the copy without the bug.
        bug: the bug.
        folder: folder of the hunt; what it has of earlier code is removed.
        limit: time limit, seconds.
    """
    shutil.rmtree(folder, ignore_errors=True)
    properties = [word for name in (*USUAL, "displaced_joint") for word in ("--property", name)]
    scenario = str(clean.root / "benchmarks" / "planted_bugs" / SCENARIO.name)
    with clean.planted(bug) as planted:
        done = planted.run(
            ["-m", "simharness.cli", "hunt", scenario, *properties, "--trials", str(TRIALS), "--out", str(folder)],
            limit=limit,
        )
    if done.code != 0:
        what = "no end" if done.code is None else (done.output.strip().splitlines() or ["no output"])[-1]
        return Outcome(True, f"the hunt stops: {what}", done.seconds)
    kept = folder / "hunted" / "failures"
    if not kept.is_dir():
        return Outcome(False, "", done.seconds)
    replayed = clean.run(["-m", "benchmarks.planted_bugs.hunting", str(kept)], limit=limit)
    if replayed.code != 0:
        raise RuntimeError(f"failures cannot be replayed:\n{replayed.output}")
    rows = map(json.loads, replayed.output.strip().splitlines())
    found = [
        each for each in rows if each["before"] >= _FEWEST * each["seeds"] and each["now"] <= _MOST * each["seeds"]
    ]
    what = "; ".join(f"{each['name']}, {each['before']} of {each['seeds']}, without {each['now']}" for each in found)
    return Outcome(bool(found), what, done.seconds)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print with how many seeds of noise each kept failure of a folder failed when it was kept, and fails now."""
    (folder,) = sys.argv[1:] if arguments is None else arguments
    for each in failures_in(Path(folder)):
        row = {
            "name": each.name,
            "seeds": each.noise_seeds,
            "before": each.noise_failed,
            "now": each.noise_failed_now(),
        }
        print(json.dumps(row))


if __name__ == "__main__":
    main()
