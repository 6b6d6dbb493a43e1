"""People who walk in front of a ring of cameras, with exact truth at any time."""

from __future__ import annotations

import numpy as np
from people import STANDING, ring

from mvpose import Detections


def walking(time, *, paths):
    """Joints of people at one time, (n, 17, 3): each walks along ``start + velocity * time`` and swings its limbs.

    Args:
        time: seconds.
        paths: ``(x, y, vx, vy)`` of each person.
    """
    people = []
    for x, y, vx, vy in paths:
        heading = np.arctan2(vy, vx)
        swing = 0.2 * np.sin(2 * np.pi * time)
        body = STANDING.copy()
        body[[9, 16], 0] += swing
        body[[10, 15], 0] -= swing
        turn = np.array([[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]])
        people.append(body @ turn.T + [x + vx * time, y + vy * time, 0.0])
    return np.array(people).reshape(len(paths), 17, 3)


def film(paths, times, *, rig=None, noise=2.0, seed=0, lost=None, offsets=None, timed=True, hidden=None):
    """Detections of people at each time, and their joints, (T, n, 17, 3).

    Args:
        paths: of :func:`walking`.
        times: seconds, (T,).
        rig: cameras.
        noise: standard deviation of keypoints, pixels.
        seed: seed of the noise.
        lost: function of frame and camera: whether the picture is lost.
        offsets: time of each camera's pictures from the time of the frame, (V,), seconds.
        timed: whether detections carry the times of their pictures.
        hidden: function of frame, camera and person: whether the person is not detected.
    """
    rig = ring(5) if rig is None else rig
    rng = np.random.default_rng(seed)
    offsets = np.zeros(len(rig)) if offsets is None else np.asarray(offsets)
    frames = []
    for frame, now in enumerate(times):
        views, keypoints, clock = [], [], now + offsets
        for view, camera in enumerate(rig):
            errors = noise * rng.standard_normal((len(paths), 17, 2))
            pixels = camera.project(walking(clock[view], paths=paths)) + errors
            if lost is not None and lost(frame, view):
                clock[view] = np.nan
                continue
            for person in range(len(paths)):
                if hidden is None or not hidden(frame, view, person):
                    views.append(view)
                    keypoints.append(pixels[person])
        count = len(views)
        given = Detections.from_keypoints(views, np.reshape(keypoints, (count, 17, 2)), np.full((count, 17), 0.9))
        if timed:
            given = Detections(
                given.view, given.keypoints, given.scores, given.boxes, given.box_scores, given.skeleton, time=clock
            )
        frames.append(given)
    return rig, frames, np.array([walking(now, paths=paths) for now in times])


def identities(estimates, truth, *, reach=0.3):
    """Identity that stands at each true person in each frame, (T, n); -1 for none."""
    result = np.full(truth.shape[:2], -1)
    for frame, estimate in enumerate(estimates):
        for person in range(truth.shape[1]):
            if len(estimate):
                distance = np.nanmean(np.linalg.norm(estimate.joints - truth[frame, person], axis=2), axis=1)
                if np.nanmin(distance) < reach:
                    result[frame, person] = estimate.ids[np.nanargmin(distance)]
    return result
