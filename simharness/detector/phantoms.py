"""People who are not there: false detections of a view and a frame, each by itself.

A phantom is a plausible upright 2D pose of any size anywhere in the image, with low scores, as detectors find in
coats, chairs and shadows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtr

from mvpose import COCO17, Detections
from mvpose.camera import Rig
from simharness.random import stream

# A person seen from the front in a box of 1 x 1: x to the right, y down, COCO-17.
# fmt: off
_FRONT = np.array(
    [
        [.50, .08], [.53, .06], [.47, .06], [.58, .07], [.42, .07], [.72, .20], [.28, .20], [.83, .35], [.17, .35],
        [.90, .49], [.10, .49], [.65, .51], [.35, .51], [.66, .74], [.34, .74], [.67, .96], [.33, .96],
    ]
)
# fmt: on
_ASPECT = 0.36  # width of a person's box over its height
_LIMBS = np.array([0.02] * 5 + [0.03, 0.03, 0.08, 0.08, 0.14, 0.14, 0.04, 0.04, 0.08, 0.08, 0.10, 0.10])[:, None]


def phantoms(rig: Rig, frames: int, *, rate: float, seed: int) -> list[Detections]:
    """Draw the phantoms of every frame.

    Args:
        rig: for the images' sizes.
        frames: how many, T.
        rate: mean number of phantoms in a view and frame; their number is Poisson distributed. A higher rate keeps
            the phantoms of a lower one and adds to them.
        seed: of the scenario.

    Returns:
        The phantoms of each of the T frames, ordered by view.
    """
    found: list[tuple[list[int], list[NDArray[np.float64]], list[NDArray[np.float64]]]] = [
        ([], [], []) for _ in range(frames)
    ]
    most = pdtr(np.arange(rate + 10 * np.sqrt(rate) + 10), rate)  # P(at most k); beyond, 1 in double precision
    for view, camera in enumerate(rig):
        # Inverting the Poisson distribution, so that a draw gives at least as many at a higher rate.
        count = np.searchsorted(most, stream(seed, "detector", "phantom count", view).random(frames))
        for k in range(count.max(initial=0)):
            draws = stream(seed, "detector", "phantom", view, k)
            center, height = draws.random((frames, 2)), draws.uniform(0.25, 0.75, frames)
            turn = draws.random(frames) < 0.5
            limbs = _LIMBS * draws.standard_normal((frames, len(COCO17), 2))
            scores = np.clip(draws.normal(0.45, 0.15, (frames, len(COCO17))), 0.0, 1.0)
            for t in np.flatnonzero(count > k):
                pose = _FRONT[list(COCO17.mirror)] if turn[t] else _FRONT
                size = height[t] * camera.size[1] * np.array([_ASPECT, 1.0])
                keypoints = center[t] * camera.size + (pose - 0.5 + limbs[t]) * size
                views_, points_, scores_ = found[t]
                views_.append(view)
                points_.append(keypoints)
                scores_.append(np.where(camera.inside(keypoints), scores[t], 0.0))
    joints = len(COCO17)
    return [
        Detections.from_keypoints(view, np.reshape(points, (-1, joints, 2)), np.reshape(scores, (-1, joints)))
        for view, points, scores in found
    ]
