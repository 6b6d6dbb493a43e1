"""Matching problems: random affinities, and affinities of noisy detections of a crowd."""

from __future__ import annotations

import numpy as np
from people import crowd, ring

from mvpose import Detections
from mvpose.affinity import ray_distance, sigmoid
from mvpose.rays import viewing_rays


def instance(seed, *, views=5, people=4, noise=0.2, miss=0.2):
    """Draw affinities of about 0.8 for the same person and 0.2 otherwise, with noise and missed people."""
    rng = np.random.default_rng(seed)
    view, person = np.array([(v, p) for v in range(views) for p in range(people) if rng.random() > miss]).T
    affinity = np.where(person[:, None] == person, 0.8, 0.2) + noise * rng.standard_normal((len(view), len(view)))
    affinity = np.clip(np.triu(affinity, 1) + np.triu(affinity, 1).T, 0, 1)
    affinity[view[:, None] == view] = 0
    return affinity, view, person


def filmed(seed, *, views, people, noise=12.0, miss=0.3, phantoms=1):
    """Simulate people 1 m apart in a ring of cameras; return affinity, view and person of each detection.

    Keypoints have ``noise`` pixels of noise, a fraction ``miss`` of the people is missed in a view, and every view has
    ``phantoms`` more people that no other view has (persons -1, -2, ...).
    """
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(people)))
    grid = np.stack(np.divmod(np.arange(people), side), axis=1) - (side - 1) / 2
    place = grid + rng.uniform(-0.25, 0.25, (people, 2))
    bodies = crowd(people, spacing=0.0, seed=seed)
    bodies[:, :, :2] += place[:, None]
    rig = ring(views, radius=max(4.0, 0.7 * side + 2.5))
    shown, view, person = [], [], []
    for v in range(views):
        false = bodies[rng.integers(people, size=phantoms)] + np.append(rng.uniform(-2, 2, 2), 0.0)
        seen = np.flatnonzero(rng.random(people) >= miss)
        shown += [*rig.project(bodies[seen])[v], *rig.project(false)[v]]
        view += [v] * (len(seen) + phantoms)
        person += [*seen, *(-1 - v * phantoms - np.arange(phantoms))]
    order = rng.permutation(len(view))
    view, person = np.array(view)[order], np.array(person)[order]
    keypoints = np.array(shown)[order]
    keypoints = keypoints + noise * rng.standard_normal(keypoints.shape)
    detections = Detections.from_keypoints(view, keypoints, np.full(keypoints.shape[:2], 0.9))
    distance, _ = ray_distance(viewing_rays(rig, detections), saturation=0.5)
    return np.where(distance > 0.25, 0.0, sigmoid(distance, midpoint=0.15, slope=0.04)), view, person


def sort_by_view(affinity, view, *more):
    order = np.argsort(view, kind="stable")
    return affinity[np.ix_(order, order)], view[order], *(other[order] for other in more)


def f1(labels, person, view):
    """Pairwise F1 of a grouping over pairs of different views."""
    across = view[:, None] != view
    matched = (labels[:, None] == labels) & (labels[:, None] >= 0) & across
    true = (person[:, None] == person) & across
    return 2 * (matched & true).sum() / (matched.sum() + true.sum())
