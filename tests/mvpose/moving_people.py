"""People who walk on curves and swing their limbs, seen by a rig: detections over time with exact truth."""

from __future__ import annotations

import numpy as np
from people import STANDING

from mvpose import COCO17, Detections, Rig
from mvpose.calibration.tracklet_matching import corrected


def walk(count=3, *, frames=40, period=0.1, still=False, seed=0, radius=1.3):
    """Joints (T, count, 17, 3), metres: each person walks along an ellipse, turns with it and swings arms and legs."""
    rng = np.random.default_rng(seed)
    time = period * np.arange(frames)
    result = np.empty((frames, count, 17, 3))
    swing = np.zeros(17)
    swing[[9, 15, 7, 13]] = 0.3, -0.3, 0.15, -0.15
    swing[[10, 16, 8, 14]] = -0.3, 0.3, -0.15, 0.15
    for k in range(count):
        phase, speed = 2 * np.pi * k / count + rng.uniform(-0.3, 0.3), rng.uniform(0.4, 0.7) * rng.choice([-1, 1])
        size, along = rng.uniform(0.92, 1.08), np.zeros_like(time) if still else time
        bearing = phase + speed * along
        at = np.stack([radius * np.cos(bearing), 0.8 * radius * np.sin(bearing), np.zeros_like(bearing)], axis=-1)
        heading = bearing + np.sign(speed) * np.pi / 2
        stride, start = rng.uniform(0.7, 1.2), rng.uniform(0, 2 * np.pi)
        body = size * STANDING[None] + np.sin(2 * np.pi * stride * along + start)[:, None, None] * (
            swing[:, None] * np.array([1.0, 0.0, 0.0])
        )
        c, s, zero, one = np.cos(heading), np.sin(heading), np.zeros_like(heading), np.ones_like(heading)
        turn = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
        result[:, k] = np.einsum("tab,tjb->tja", turn, body) + at[:, None]
    return result


def film(rig: Rig, joints, *, noise=3.0, seed=0, only=None):
    """Detections of every frame, without gaps, and the true person of each detection (m,), by frame.

    Args:
        rig: true cameras.
        joints: (T, P, 17, 3), metres.
        noise: standard deviation of keypoints, pixels.
        seed: of the noise.
        only: for each view the people whom it sees; all by default.
    """
    rng = np.random.default_rng(seed)
    frames, people = [], []
    for each in joints:
        pixels = rig.project(each)
        view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
        seen = (
            np.ones(len(view), bool)
            if only is None
            else np.array([p in only[v] for v, p in zip(view, person, strict=True)])
        )
        order = rng.permutation(np.flatnonzero(seen))
        view, person = view[order], person[order]
        keypoints = pixels[view, person] + noise * rng.standard_normal((len(view), len(COCO17), 2))
        frames.append(Detections.from_keypoints(view, keypoints, np.full((len(view), len(COCO17)), 0.9)))
        people.append(person)
    return frames, people


def disturbed(rig: Rig, degrees, metres, *, seed=0, views=None):
    """The rig with cameras turned and shifted by normal errors of these standard deviations along each axis."""
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((len(rig), 2, 3))
    return Rig(
        [
            corrected(c, np.radians(degrees) * turn, metres * shift) if views is None or v in views else c
            for v, (c, (turn, shift)) in enumerate(zip(rig, draws, strict=True))
        ]
    )
