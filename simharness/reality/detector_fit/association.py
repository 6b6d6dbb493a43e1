"""Association of detections with people.

Recordings have people who are not annotated. Detections of no annotated person that agree in 3D across views are
assigned to such people, and only the rest counts as false positives: an upper bound of their number.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, Detections, preset
from mvpose.arrays import Bools, Floats
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Triangulation
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample

GATE = 0.3
"""Largest median distance of limb joints of a detection from its person, in roots of the person's area."""

DUPLICATE_GATE = 0.12
"""The same for a further detection of a person who already has one."""

_MIN_JOINTS = 3  # reported limb joints needed to associate a detection


@dataclass(frozen=True)
class Association:
    """People shown by the detections."""

    keypoints: Floats
    """Keypoints of each known person in each view, (T, V, P, 17, 2); NaN where not detected or not reported."""
    scores: Floats
    """Scores of these keypoints, (T, V, P, 17); 0 where not reported."""
    duplicates: NDArray[np.int64]
    """Number of further detections of each known person, (T, V, P)."""
    consensus: Floats
    """Joints of each known person, triangulated robustly from the detections, (T, P, 17, 3) metres; NaN where
    detections do not agree."""
    unannotated: Floats
    """Joints of people without annotation, (T, N, 17, 3) metres; NaN in frames with fewer of them."""
    fragments: NDArray[np.int64]
    """Number of detections with too few limb joints to be associated, (T, V)."""
    false: NDArray[np.int64]
    """Number of detections that show no person, (T, V)."""
    false_scores: Floats
    """Scores of their keypoints, (T, V, F, 17); 0 where not reported or where there are fewer."""

    @property
    def detected(self) -> Bools:
        """Which people are detected in which views, (T, V, P)."""
        return np.any(self.scores > 0, axis=-1)


def associate(sample: Sample, pixels: Floats, boxes: Floats) -> Association:
    """Associate the detections of a sample with its people.

    Args:
        sample: people and detections.
        pixels: reference joints in the pictures, (T, V, P, 17, 2); NaN where unknown.
        boxes: boxes of the people, (T, V, P, 4).
    """
    frames, views, people = boxes.shape[:3]
    keypoints, scores = np.full((*boxes.shape[:3], 17, 2), np.nan), np.zeros((*boxes.shape[:3], 17))
    duplicates = np.zeros((frames, views, people), np.int64)
    size = np.sqrt(boxes[..., 2] * boxes[..., 3])
    unannotated: list[Floats] = []
    fragments: list[NDArray[np.int64]] = []
    false: list[list[Floats]] = []
    consensus = np.full((frames, people, len(COCO17), 3), np.nan)
    fast, triangulate = preset("fast"), Triangulation()
    for frame, found in enumerate(sample.detections):
        left, shown = np.ones(len(found), bool), np.full(len(found), -1)
        for view in range(views):
            rows = np.flatnonzero(found.view == view)
            far = _distances(found.keypoints[rows], pixels[frame, view], size[frame, view])
            for person, index in zip(*linear_sum_assignment(np.minimum(far, 2 * GATE)), strict=True):
                if far[person, index] < GATE:
                    where = frame, view, person
                    keypoints[where], scores[where] = found.keypoints[rows[index]], found.scores[rows[index]]
                    left[rows[index]], shown[rows[index]], far[:, index] = False, person, np.inf
            near = far < DUPLICATE_GATE
            np.add.at(duplicates[frame, view], far[:, near.any(axis=0)].argmin(axis=0), 1)
            left[rows[near.any(axis=0)]] = False
        seen, who = np.unique(shown[shown >= 0], return_inverse=True)
        of_known = _only(found, shown >= 0)
        consensus[frame, seen] = triangulate(viewing_rays(sample.rig, of_known), who, found.skeleton).joints
        rest = _only(found, left)
        estimate = fast.estimate(sample.rig, rest)
        unannotated.append(estimate.joints)
        enough = (rest.scores[:, LIMB_JOINTS] > 0).sum(axis=1) >= _MIN_JOINTS
        unmatched = enough & (estimate.matching.labels < 0)
        fragments.append(np.bincount(rest.view[~enough & (estimate.matching.labels < 0)], minlength=views))
        false.append([rest.scores[unmatched & (rest.view == view)] for view in range(views)])
    most = max((len(each) for row in false for each in row), default=0)
    false_scores = np.zeros((frames, views, most, len(COCO17)))
    for frame, row in enumerate(false):
        for view, each in enumerate(row):
            false_scores[frame, view, : len(each)] = each
    return Association(
        keypoints=keypoints,
        scores=scores,
        duplicates=duplicates,
        consensus=consensus,
        unannotated=_padded(unannotated),
        fragments=np.reshape(fragments, (frames, views)),
        false=np.array([[len(each) for each in row] for row in false]).reshape(frames, views),
        false_scores=false_scores,
    )


def _distances(keypoints: Floats, pixels: Floats, size: Floats) -> Floats:
    """Return median distances of limb joints over the person's size, (P, m); infinite with too few known joints."""
    away = keypoints[None, :, LIMB_JOINTS] - pixels[:, None, LIMB_JOINTS]
    far = np.sort(np.hypot(away[..., 0], away[..., 1]), axis=-1)  # NaN last
    count = np.isfinite(far).sum(axis=-1)
    middle = np.maximum(count - 1, 0)
    low, high = (np.take_along_axis(far, each[..., None], axis=-1)[..., 0] for each in (middle // 2, (middle + 1) // 2))
    enough = (count >= _MIN_JOINTS) & (size[:, None] > 0)
    return np.where(enough, (low + high) / 2 / np.maximum(size, 1e-9)[:, None], np.inf)


def _only(found: Detections, kept: Bools) -> Detections:
    """Return the detections (m,) that are ``kept``, without descriptors and heat maps."""
    return replace(found.select(kept), descriptors=None)


def _padded(people: list[Floats]) -> Floats:
    """Return the people of all frames as one array padded with NaN, (T, N, 17, 3)."""
    result = np.full((len(people), max(map(len, people), default=0), len(COCO17), 3), np.nan)
    for frame, joints in enumerate(people):
        result[frame, : len(joints)] = joints
    return result
