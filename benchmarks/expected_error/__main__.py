"""Compare the expected error of a recording's page with the real one, on ten simulated rigs and on real Shelf.

    python -m benchmarks.expected_error [--shelf FOLDER] [--preset track]

The pages of recordings (:mod:`mvpose.report`) show the median error that covariances lead one to expect. Here the truth
is known: on ten rigs that differ in layout, number and resolution of cameras, detector and number of people, the
medians over all joints are put side by side. The scenes are those of no suite.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

import simharness
from mvpose import COCO17, SHELF14, Detections, Estimate, Rig, preset
from mvpose.arrays import Floats
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.report.examined_recording import expected_median
from simharness.reality.recording_file import read_recording
from simharness.scoring.pairing import pair

_SEED = 2_000  # of the first scene; far from those of suites and baselines
_NO_WALLS = "room.walls=false"  # cameras that stand farther out than the room is large
RIGS: dict[str, tuple[str, ...]] = {
    "ring of 4": ("cameras.count=4",),
    "ring of 5, low": ("cameras.height=1.4", "people.count=3"),
    "ring of 6, high": ("cameras.count=6", "cameras.height=2.6"),
    "ring of 8, VGA": ("cameras.count=8", "cameras.size=[640,480]", "people.count=5"),
    "corners, full HD": ("cameras.layout='corners'", "cameras.count=4", "cameras.size=[1920,1080]"),
    "arc of 4": ("cameras.layout='arc'", "cameras.count=4"),
    "line of 3": (
        "cameras.layout='line'",
        "cameras.count=3",
        "people.count=2",
        "cameras.spacing=2.0",
        "room.walls=false",
    ),
    "Shelf's rig": ("cameras.layout='preset'", "cameras.preset='shelf'", _NO_WALLS),
    "ring of 3, excellent detector": ("cameras.count=3", "people.count=2", "detector.profile='excellent'"),
    "ring of 5, 6 people": ("people.count=6",),
}
"""Overrides of the scenario ``quickstart`` that make each rig."""

_COMMON = ("duration=10.0", "rate=25.0", "rendering.renderer='rays'")


LIMBS = [COCO17.index(joint) for joint in SHELF14.joints if joint in COCO17.joints]
"""The twelve joints that COCO17 and SHELF14 have in common, in the order of SHELF14."""


def medians(truth: Sequence[Floats], estimates: Sequence[Estimate]) -> tuple[float, float]:
    """Return the real and the expected median error of the joints of people who were found, metres.

    Args:
        truth: true joints of each frame, (P, J, 3), metres.
        estimates: estimate of each frame.
    """
    errors, covariances, freedoms = [], [], []
    for true, estimate in zip(truth, estimates, strict=True):
        paired = pair(true, estimate.joints).estimate
        found = paired >= 0
        if estimate.covariance is not None and found.any():
            errors.append(np.linalg.norm(estimate.joints[paired[found]] - true[found], axis=-1).ravel())
            covariances.append(estimate.covariance[paired[found]].reshape(-1, 3, 3))
            unknown = np.full(estimate.scores.shape, np.nan)
            freedoms.append((unknown if estimate.freedom is None else estimate.freedom)[paired[found]].ravel())
    errors_of_all = np.concatenate(errors)
    known = np.isfinite(errors_of_all)
    return float(np.median(errors_of_all[known])), expected_median(
        np.concatenate(covariances)[known], np.concatenate(freedoms)[known]
    )


def on_simulated_rigs(pipeline: Estimator) -> Iterator[tuple[str, float, float]]:
    """Yield name, real and expected median error of each of :data:`RIGS`."""
    for number, (name, overrides) in enumerate(RIGS.items()):
        scenario = simharness.load_scenario("quickstart", overrides=(*_COMMON, *overrides), seed=_SEED + number)
        recording = simharness.simulate(scenario)
        estimates = _estimates(pipeline, recording.rig, recording.detections)
        yield name, *medians([true.joints for true in recording.truth], estimates)


def on_shelf(pipeline: Estimator, folder: Path) -> tuple[float, float]:
    """Return real and expected median error of the limbs of Shelf's actors; the real one holds errors of annotation."""
    recording = read_recording("shelf", folder)
    estimates = [_of_limbs(each) for each in _estimates(pipeline, recording.rig, recording.detections)]
    return medians([true[:, : len(LIMBS)] for true in recording.truth], estimates)


def _of_limbs(estimate: Estimate) -> Estimate:
    covariance, freedom = (None if each is None else each[:, LIMBS] for each in (estimate.covariance, estimate.freedom))
    joints, scores = estimate.joints[:, LIMBS], estimate.scores[:, LIMBS]
    return Estimate(joints, scores, estimate.matching, covariance, freedom=freedom)


def _estimates(pipeline: Estimator, rig: Rig, frames: Sequence[Detections]) -> list[Estimate]:
    if isinstance(pipeline, SequenceEstimator):
        return list(pipeline.track(rig, frames))
    return [pipeline.estimate(rig, detections) for detections in frames]


def main() -> None:
    """Print a row for each rig."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.expected_error", description=__doc__)
    parser.add_argument("--shelf", type=Path, help="folder with Shelf, which is compared as well")
    parser.add_argument("--preset", default="track", help="variant of the method")
    options = parser.parse_args()
    pipeline = preset(options.preset)
    print("| rig | real, mm | expected, mm | expected / real |\n|:--|--:|--:|--:|")
    rows: Iterable[tuple[str, float, float]] = on_simulated_rigs(pipeline)
    if options.shelf:
        rows = itertools.chain(rows, [("real Shelf", *on_shelf(pipeline, options.shelf))])
    for name, real, expected in rows:
        print(f"| {name} | {1000 * real:.1f} | {1000 * expected:.1f} | {expected / real:.2f} |", flush=True)


if __name__ == "__main__":
    main()
