"""Hunts for planted bugs: a bug is found if frames fail with it in which the unchanged code is right.

The hunt runs in a copy with the bug and asks the copy without it for its people in every frame. What is hunted is a
failure that the unchanged code does not have, on the same detections (differential testing: McKeeman, "Differential
testing for software", Digital Technical Journal 10, 1998). So scenes may be as hard as they like.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import Checkout
from benchmarks.planted_bugs.records import Outcome
from mvpose import Detections, Estimate, Rig, preset
from simharness.hunt.hunt_run import BATCH
from simharness.hunt.hunt_run import TRIALS as TRIALS_FILE
from simharness.hunt.properties import FrameAnswer, Violation, violations
from simharness.scoring.failure_classes import FailureKind, failures_of_frame
from simharness.types.truth import Truth

SCENARIO = Path(__file__).with_name("hunted.toml")
TRIALS = 8 * BATCH
"""Most trials of one hunt; it ends with the batch that finds the bug."""

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

_FEWEST = 2  # scenes that fail with the bug alone: in one, a decision may have been too close for rounding errors
_UNCHANGED = "PLANTED_BUGS_UNCHANGED"  # environment variable: folder of the copy without the bug


def hunt_bug(clean: Checkout, bug: Bug, *, folder: Path, limit: float) -> Outcome:
    """Hunt in a copy with a bug, batch by batch until the bug is found.

    Args:
        clean: the copy without the bug.
        bug: the bug.
        folder: folder of the hunt; what it has of earlier code is removed.
        limit: time limit, seconds.
    """
    shutil.rmtree(folder, ignore_errors=True)
    scenario = str(clean.root / "benchmarks" / "planted_bugs" / SCENARIO.name)
    options = ["--property", f"{__name__}:{worse.__name__}", "--keep", "0", "--out", str(folder)]
    seconds, found = 0.0, ""
    with clean.planted(bug) as planted:
        for trials in range(BATCH, TRIALS + 1, BATCH):
            arguments = ["-m", "simharness.cli", "hunt", scenario, *options, "--trials", str(trials)]
            environment = {_UNCHANGED: str(clean.root)}
            done = planted.run(arguments, limit=limit - seconds, environment=environment)
            seconds += done.seconds
            if done.code is None:
                return Outcome(False, f"nothing within {limit:.0f} s", seconds)
            if done.code != 0:
                return Outcome(
                    True, f"the hunt stops: {(done.output.strip().splitlines() or ['no output'])[-1]}", seconds
                )
            found = summary(folder / "hunted" / TRIALS_FILE)
            if found:
                break
    return Outcome(bool(found), found and f"{found}, within {trials} trials", seconds)


def summary(path: Path) -> str:
    """Return in how many scenes of a file of trials something fails; "" for too few."""
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    scenes = Counter(row["seed"] for row in rows if row["findings"])
    return f"failures that are none without the bug, in {len(scenes)} scenes" if len(scenes) >= _FEWEST else ""


def worse(rig: Rig, detections: Detections, truth: Truth, estimate: Estimate) -> str:
    """Return what fails in an answer and not in that of the unchanged code; "" if nothing does."""
    estimates = estimate, unchanged(rig, detections)
    changed, clean = (_failures(FrameAnswer(rig, detections, truth, each, preset("full"))) for each in estimates)
    new = [failure for failure in changed if not any(failure.is_like(known) for known in clean)]
    return f"{new[0].property} {new[0].text}" if new else ""


def _failures(answer: FrameAnswer) -> list[Violation]:
    """Return failures of all classes, people out of plain view who are missed among them, and of the covariance."""
    of_joints = (FailureKind.SWAPPED_LIMB, FailureKind.DISPLACED_JOINT)
    found = failures_of_frame(answer.rig, answer.detections, answer.truth, answer.estimate)
    classified = [Violation(str(each.kind), each.person, "", each.joints * (each.kind in of_joints)) for each in found]
    return [*classified, *violations(answer, ("overconfident",))]


def unchanged(rig: Rig, detections: Detections) -> Estimate:
    """Return the answer of the unchanged code."""
    program = _program(os.environ[_UNCHANGED])
    assert program.stdin is not None
    assert program.stdout is not None
    pickle.dump((rig, detections), program.stdin)
    program.stdin.flush()
    answer = pickle.load(program.stdout)
    assert isinstance(answer, Estimate)
    return answer


@cache
def _program(root: str) -> subprocess.Popen[bytes]:
    """Start the program that answers with the code of a checkout; it ends with its input."""
    environment = os.environ | {"PYTHONPATH": root}
    arguments = [sys.executable, "-m", __name__]
    return subprocess.Popen(arguments, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def main() -> None:
    """Answer frames (rig and detections, pickled) on the standard input with estimates on the standard output."""
    variant = preset("full")
    while True:
        try:
            rig, detections = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(variant.estimate(rig, detections), sys.stdout.buffer)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
