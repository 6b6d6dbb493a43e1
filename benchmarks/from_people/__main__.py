"""Simulate recordings of people who walk, find the extrinsics as ``mvpose calibrate`` does, and print their errors.

Errors are those that remain once the cameras are laid over the true ones by a similarity: nothing in a picture tells
where the world has its origin, and its unit comes from the stature of the people.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.distance import pdist

from benchmarks.doctor.measures import aligned, camera_errors
from benchmarks.filmed_people import filmed_people
from benchmarks.from_people.peer import RATE, peer_rig
from mvpose import Rig
from mvpose.calibration.from_people import calibrate_from_people
from simharness.types.recording import Recording

_ACTIVITIES = (["walk"], ["walk", "wave"], ["walk", "point", "walk"])  # of one, two and three people


def _recording(number: int, seed: int, seconds: float) -> Recording:
    """Simulate a recording: 3 to 6 cameras, one to three people."""
    rng = np.random.default_rng(seed + number)
    return filmed_people(
        seed + number,
        rng,
        seconds=seconds,
        rate=RATE,
        activities=_ACTIVITIES[number % 3],
        views=3 + number % 4,
        layout=("ring", "corners", "arc", "ring")[number % 4],
        boxes=number % 3,
    )


def _peer(program: Path, recording: Recording) -> Rig | None:
    """Return what the peer finds from the person who walks farthest, as its documentation says."""
    frames, truths = list(recording.detections), recording.truth
    paths = np.array([each.joints[:, 11:13, :2].mean(1) for each in truths])
    chosen = int(np.linalg.norm(np.diff(paths, axis=0), axis=-1).sum(0).argmax())
    shape = (len(frames), len(recording.rig), 17)
    keypoints, scores = np.full((*shape, 2), np.nan), np.zeros(shape)
    for k, (detections, truth) in enumerate(zip(frames, truths, strict=True)):
        rows = np.flatnonzero(np.asarray(truth.person) == chosen)
        keypoints[k, detections.view[rows]] = detections.keypoints[rows]
        scores[k, detections.view[rows]] = detections.scores[rows]
    joints = np.array([each.joints[chosen] for each in truths])
    with TemporaryDirectory() as folder:
        return peer_rig(program, Path(folder), recording.rig, keypoints, scores, joints)


def main() -> None:
    """Print the errors of each rig, and their medians."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.from_people", description=__doc__)
    parser.add_argument("--count", type=int, default=20, metavar="N", help="rigs")
    parser.add_argument("--seed", type=int, default=71000, metavar="N", help="of the first recording")
    parser.add_argument("--seconds", type=float, default=15.0, metavar="S", help="length of each recording")
    parser.add_argument("--peer", type=Path, metavar="PROGRAM", help="executable of humancalib, compared too")
    options = parser.parse_args()
    all_errors: dict[str, list[tuple[float, float]]] = {"mvpose": [], "humancalib": []}
    for number in range(options.count):
        recording = _recording(number, options.seed, options.seconds)
        rig, start = recording.rig, time.perf_counter()
        words, found = "", dict[str, Rig | None]()
        try:
            result = calibrate_from_people(rig, list(recording.detections), period=1 / RATE)
            found["mvpose"], words = result.rig, "; ".join(result.warnings)
        except ValueError as error:
            found["mvpose"], words = None, str(error)
        seconds = time.perf_counter() - start
        if options.peer:
            found["humancalib"] = _peer(options.peer, recording)
        line = [f"{number}: {len(rig)} cameras"]
        for name, each in found.items():
            if each is None:
                line.append(f"{name} none")
                continue
            rotations, shifts = camera_errors(aligned(each, rig, resized=True), rig)
            centers = shifts / pdist(rig.centers).max()
            all_errors[name].append((float(np.median(rotations)), float(np.median(centers))))
            worst = f"worst {rotations.max():.2f}°, {100 * centers.max():.2f} %"
            line.append(f"{name} {np.median(rotations):.2f}°, {100 * np.median(centers):.2f} % ({worst})")
        print(", ".join(line), f"{seconds:.1f} s", words, flush=True)
    for name, rows in all_errors.items():
        if rows:
            turn, far = np.median(rows, axis=0)
            print(f"{name}: {len(rows)} rigs, median {turn:.2f}° and {100 * far:.2f} % of the largest baseline")


if __name__ == "__main__":
    main()
