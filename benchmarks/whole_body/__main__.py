"""Measure what hands, face and feet take beyond the body: ``python -m benchmarks.whole_body``.

Five views of four people with the 133 joints of COCO-WholeBody, 4 px of noise and a tenth of the keypoints missing. The
time is that of the processor for one frame, on one core: median and 95th percentile over frames, each measured many
times, of which the fastest counts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
import threadpoolctl

from benchmarks.method.scenes import LIVE, ring, stick_people
from mvpose import COCO17, Detections, Estimate, Rig, preset
from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton
from mvpose.wholebody import body_part, complete, skeleton_by_name, with_body_boxes

_SPREAD = 0.06  # metres; standard deviation of the other joints about the joint of the body that they belong to


def whole_people(skeleton: Skeleton, count: int, rng: np.random.Generator) -> Floats:
    """Return people with joints of a skeleton around those of their bodies, (count, J, 3), metres."""
    places = np.stack([np.arange(count) % 2, np.arange(count) // 2], axis=1).astype(float) - 0.5
    bodies = stick_people(places, rng)
    anchors = []
    for row in range(len(skeleton)):
        above = row
        while above >= 0 and skeleton.joints[above] not in COCO17.joints:
            above = skeleton.parents[above]
        anchors.append(COCO17.index(skeleton.joints[above]) if above >= 0 else 5)
    away = _SPREAD * rng.standard_normal((count, len(skeleton), 3))
    away[:, [joint in COCO17.joints for joint in skeleton.joints]] = 0.0
    return bodies[:, anchors] + away


def detected(rig: Rig, joints: Floats, skeleton: Skeleton, rng: np.random.Generator) -> Detections:
    """Return the detections of all people in all views."""
    pixels = rig.project(joints)
    pixels = pixels + LIVE.noise * rng.standard_normal(pixels.shape)
    view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
    scores = rng.uniform(0.5, 1.0, (len(view), len(skeleton)))
    scores[rng.random(scores.shape) < LIVE.joints_missing] = 0.0
    return with_body_boxes(view, pixels[view, person], scores, skeleton=skeleton)


def seconds(rig: Rig, frames: Sequence[tuple[Detections, Estimate]], rounds: int) -> Floats:
    """Return the time of the joints beyond the body for each frame, seconds: the least of some rounds."""
    times = np.empty((rounds, len(frames)))
    for row in times:
        for k, (detections, body) in enumerate(frames):
            start = time.process_time()
            complete(rig, detections, body)
            row[k] = time.process_time() - start
    return np.asarray(times.min(axis=0))


def main() -> None:
    """Print the time of each skeleton."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.whole_body", description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=5)
    parser.add_argument("--people", type=int, default=4)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=20)
    options = parser.parse_args()
    rig, pipeline = ring(options.views, options.people), preset("fast")
    print("| skeleton | joints beyond the body | median, ms | 95 %, ms |\n|:--|--:|--:|--:|")
    with threadpoolctl.threadpool_limits(1):
        for name in ("halpe26", "body25", "wholebody133", "openpose137"):
            skeleton, frames = skeleton_by_name(name), []
            for number in range(options.frames):
                rng = np.random.default_rng([number, 1])
                detections = detected(rig, whole_people(skeleton, options.people, rng), skeleton, rng)
                frames.append((detections, pipeline.estimate(rig, body_part(detections))))
            times = 1000 * seconds(rig, frames, options.rounds)
            median, late = np.percentile(times, [50, 95])
            print(f"| {name} | {len(skeleton) - len(COCO17)} | {median:.2f} | {late:.2f} |", flush=True)


if __name__ == "__main__":
    main()
