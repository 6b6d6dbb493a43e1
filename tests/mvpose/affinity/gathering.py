"""Synthetic rooms with people, cameras of any resolution, and detections with moderate noise."""

from __future__ import annotations

import numpy as np
from people import STANDING, look_at

from mvpose import Detections, Rig
from mvpose.affinity import GeometricAffinity
from mvpose.matching import match
from mvpose.rays import viewing_rays


def people_in_a_room(count, *, half=2.0, gap=0.6, seed=0):
    """Draw people in a square room, at least ``gap`` metres apart, with random headings and poses: (count, 17, 3)."""
    rng = np.random.default_rng(seed)
    spots: list[np.ndarray] = []
    while len(spots) < count:
        spot = rng.uniform(-half, half, 2)
        if all(np.hypot(*(spot - other)) > gap for other in spots):
            spots.append(spot)
    people = []
    for spot in spots:
        angle = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        body = STANDING * rng.uniform(0.9, 1.1) + 0.04 * rng.standard_normal(STANDING.shape)
        people.append(body @ turn.T + [*spot, 0])
    return np.array(people)


def rig_around(views, *, radius=5.0, size=(1280, 960), seed=0):
    """Cameras of 75 degrees around the origin, with slightly irregular positions and heights."""
    rng = np.random.default_rng(seed)
    focal = 0.5 * size[0] / np.tan(np.radians(37.5))
    bearings = 2 * np.pi * (np.arange(max(views, 3)) + rng.uniform(-0.3, 0.3, max(views, 3))) / max(views, 3)
    cameras = []
    for bearing in bearings[:views]:
        out, height = radius * rng.uniform(0.9, 1.1), rng.uniform(2.0, 2.8)
        center = [out * np.cos(bearing), out * np.sin(bearing), height]
        cameras.append(look_at(center, [0, 0, 1.0], focal=focal, size=size))
    return Rig(cameras)


def noisy(rig, people, *, seed=0, pixels=6.0, missed=0.1):
    """Detections of all people in every view, with noise of ``pixels`` in an image 1000 wide, and their people."""
    rng = np.random.default_rng(seed)
    width = np.array([camera.size[0] for camera in rig])
    exact = rig.project(people)
    keypoints = exact + (pixels * width / 1000)[:, None, None, None] * rng.standard_normal(exact.shape)
    scores = np.where(rng.random(exact.shape[:3]) < missed, 0.0, rng.uniform(0.4, 1.0, exact.shape[:3]))
    view, person = (index.ravel() for index in np.indices(exact.shape[:2]))
    order = rng.permutation(len(view))
    view, person = view[order], person[order]
    return Detections.from_keypoints(view, keypoints[view, person], scores[view, person]), person


def labels(rig, detections, affinity=None):
    """Labels by clustering with the geometric or another affinity."""
    matrix = (affinity or GeometricAffinity())(rig, detections, viewing_rays(rig, detections))
    return match(matrix, detections.view, method="clustering").labels


def pairwise_f1(found, person, view):
    """F1 over pairs of detections of different views."""
    across = view[:, None] != view
    matched = (found[:, None] == found) & (found[:, None] >= 0) & across
    true = (person[:, None] == person) & across
    return 2 * (matched & true).sum() / (matched.sum() + true.sum())
