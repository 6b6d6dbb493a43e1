"""Which detection shows whom: the first thing to know about a detector, and nothing that it says.

Recordings have people whom nobody annotated. Detections of no annotated person that agree in 3D across views are taken
for such people, and only the rest for false: an upper bound of what is false.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, Detections, Pipeline
from mvpose.arrays import Bools, Floats
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Triangulation
from simharness.reality.detector_fit.sample import LIMBS, Sample

GATE = 0.3
"""Of the root of a person's area: a detection whose median limb joint is farther off does not show the person."""

AGAIN = 0.12
"""The same for one more detection of a person who has one."""

_LEAST = 3  # limb joints that must be reported to say whom a detection shows


@dataclass(frozen=True)
class Association:
    """Whom the detections show.

    Attributes:
        keypoints: of each known person in each view, (T, V, P, 17, 2); NaN where not detected or not reported.
        scores: of those, (T, V, P, 17); 0 where not reported.
        repeated: how many more detections of each known person there are, (T, V, P).
        consensus: joints of each known person as their detections have them, triangulated robustly, (T, P, 17, 3)
            metres; NaN where they do not agree.
        strangers: joints of the people whom nobody annotated, (T, N, 17, 3) metres; NaN where there are fewer.
        fragments: how many detections have too few limb joints to say whether they show anybody, (T, V).
        false: how many detections show nobody, (T, V).
        false_scores: scores of their keypoints, (T, V, F, 17); 0 where not reported or where there are fewer.
    """

    keypoints: Floats
    scores: Floats
    repeated: NDArray[np.int64]
    consensus: Floats
    strangers: Floats
    fragments: NDArray[np.int64]
    false: NDArray[np.int64]
    false_scores: Floats

    @property
    def found(self) -> Bools:
        """Who is detected where, (T, V, P)."""
        return np.any(self.scores > 0, axis=-1)


def associate(sample: Sample, pixels: Floats, boxes: Floats) -> Association:
    """Find out whom the detections of a sample show.

    Args:
        sample: people and detections.
        pixels: where the reference joints are in the pictures, (T, V, P, 17, 2); NaN where unknown.
        boxes: of the people, (T, V, P, 4).
    """
    frames, views, people = boxes.shape[:3]
    keypoints, scores = np.full((*boxes.shape[:3], 17, 2), np.nan), np.zeros((*boxes.shape[:3], 17))
    repeated = np.zeros((frames, views, people), np.int64)
    size = np.sqrt(boxes[..., 2] * boxes[..., 3])
    strangers: list[Floats] = []
    fragments: list[NDArray[np.int64]] = []
    false: list[list[Floats]] = []
    consensus = np.full((frames, people, len(COCO17), 3), np.nan)
    fast, triangulate = Pipeline.preset("fast"), Triangulation()
    for frame, found in enumerate(sample.detections):
        left, shown = np.ones(len(found), bool), np.full(len(found), -1)
        for view in range(views):
            mine = np.flatnonzero(found.view == view)
            far = _distances(found.keypoints[mine], pixels[frame, view], size[frame, view])
            for person, index in zip(*linear_sum_assignment(np.minimum(far, 2 * GATE)), strict=True):
                if far[person, index] < GATE:
                    here = frame, view, person
                    keypoints[here], scores[here] = found.keypoints[mine[index]], found.scores[mine[index]]
                    left[mine[index]], shown[mine[index]], far[:, index] = False, person, np.inf
            near = far < AGAIN
            np.add.at(repeated[frame, view], far[:, near.any(axis=0)].argmin(axis=0), 1)
            left[mine[near.any(axis=0)]] = False
        seen, who = np.unique(shown[shown >= 0], return_inverse=True)
        theirs = _only(found, shown >= 0)
        consensus[frame, seen] = triangulate(viewing_rays(sample.rig, theirs), who, found.skeleton).joints
        rest = _only(found, left)
        answer = fast.estimate(sample.rig, rest)
        strangers.append(answer.joints)
        enough = (rest.scores[:, LIMBS] > 0).sum(axis=1) >= _LEAST
        nobody = enough & (answer.matching.labels < 0)
        fragments.append(np.bincount(rest.view[~enough & (answer.matching.labels < 0)], minlength=views))
        false.append([rest.scores[nobody & (rest.view == view)] for view in range(views)])
    most = max((len(each) for row in false for each in row), default=0)
    false_scores = np.zeros((frames, views, most, len(COCO17)))
    for frame, row in enumerate(false):
        for view, each in enumerate(row):
            false_scores[frame, view, : len(each)] = each
    return Association(
        keypoints=keypoints,
        scores=scores,
        repeated=repeated,
        consensus=consensus,
        strangers=_padded(strangers),
        fragments=np.reshape(fragments, (frames, views)),
        false=np.array([[len(each) for each in row] for row in false]).reshape(frames, views),
        false_scores=false_scores,
    )


def _distances(keypoints: Floats, pixels: Floats, size: Floats) -> Floats:
    """Median distance of limb joints over the person's size, (P, m); infinite where too few are to be compared."""
    away = keypoints[None, :, LIMBS] - pixels[:, None, LIMBS]
    far = np.sort(np.hypot(away[..., 0], away[..., 1]), axis=-1)  # NaN last
    count = np.isfinite(far).sum(axis=-1)
    middle = np.maximum(count - 1, 0)
    low, high = (np.take_along_axis(far, each[..., None], axis=-1)[..., 0] for each in (middle // 2, (middle + 1) // 2))
    enough = (count >= _LEAST) & (size[:, None] > 0)
    return np.where(enough, (low + high) / 2 / np.maximum(size, 1e-9)[:, None], np.inf)


def _only(found: Detections, kept: Bools) -> Detections:
    return Detections(
        found.view[kept],
        found.keypoints[kept],
        found.scores[kept],
        found.boxes[kept],
        found.box_scores[kept],
        found.skeleton,
    )


def _padded(people: list[Floats]) -> Floats:
    """Different numbers of people a frame as one array, (T, N, 17, 3)."""
    result = np.full((len(people), max(map(len, people), default=0), len(COCO17), 3), np.nan)
    for frame, joints in enumerate(people):
        result[frame, : len(joints)] = joints
    return result
