"""Pose non-maximum suppression: removal of detections that repeat a person in a view.

Detectors often report one person twice in a view, with two nearly equal poses. Matching takes at most one detection
per view into a person, so the second detections would form a ghost beside the person.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools
from mvpose.detections import Detections
from mvpose.kernels import njit

_BOX_SHARE = 0.53  # fraction of its box that a person fills (Ronchi & Perona, ICCV 2017)
_FAR = 5.0  # times the median distance from the median keypoint; 2.3 for the feet of a standing person


@dataclass(frozen=True)
class Duplicates:
    """Pose non-maximum suppression in each view, which keeps the most confident of several similar poses.

    The similarity of two poses is their object keypoint similarity (OKS), the mean over the joints that both have of
    ``exp(-d² / (2 s² (2 sigma)²))``, with d the distance in pixels and s² 0.53 of the area of the box around the
    detected keypoints, averaged over the two (Xiao, Wu & Wei, "Simple baselines", ECCV 2018, who suppress above 0.9).
    A keypoint far from the others is left out of the box, so that a single wrong joint does not make all poses
    similar.

    Suppression is greedy: the most confident detection is kept (the first of equals) and removes those similar to it,
    then the next of the remaining ones. Confidence is the box score times the mean score of all J joints, with missing
    joints as 0 (the ranking of Xiao et al.). So the second report of a face, with few but confident joints, does not
    outrank the whole person.

    Raises:
        ValueError: ``threshold`` outside 0..1, or ``least_joints`` below 1.
    """

    threshold: float = 0.9
    """OKS above which two poses of one view show one person."""
    least_joints: int = 3
    """Least number of shared detected joints; poses that share fewer are not compared, unless one repeats the other
    exactly."""

    def __post_init__(self) -> None:
        if not 0 <= self.threshold <= 1:
            raise ValueError(f"threshold must be an object keypoint similarity, 0 to 1, got {self.threshold}")
        if self.least_joints < 1:
            raise ValueError(f"least_joints must be at least 1, got {self.least_joints}")

    def __call__(self, detections: Detections) -> Bools:
        """Return a mask of the detections to keep, (m,)."""
        return _suppress(
            detections.view,
            detections.keypoints,
            detections.scores,
            detections.box_scores,
            detections.skeleton.variances,
            self.threshold,
            self.least_joints,
        )


@njit(cache=True)
def _suppress(view, keypoints, scores, box_scores, variances, threshold, least):
    m = len(view)
    keep, rival = np.ones(m, np.bool_), np.zeros(m, np.bool_)
    area = np.full(m, -1.0)  # computed on demand, because hardly any pair needs it
    box = np.empty(m)  # area with stray keypoints, never smaller than ``area``, so it gives an upper bound of the OKS
    for d in range(m):
        box[d] = _box_area(keypoints, scores, d, 0.0, 0.0, np.inf)
    first, second = np.empty(m * m // 2, np.int64), np.empty(m * m // 2, np.int64)
    count = 0
    for a in range(m):
        for b in range(a + 1, m):
            if view[a] == view[b] and _similar(a, b, keypoints, scores, variances, box, area, threshold, least):
                rival[a] = rival[b] = True
                first[count], second[count] = a, b
                count += 1
    while count:
        best = m
        for d in range(m):
            if rival[d] and (best == m or _more_confident(d, best, scores, box_scores)):
                best = d
        if best == m:
            break
        rival[best] = False
        for k in range(count):
            if first[k] == best or second[k] == best:
                other = first[k] + second[k] - best
                if rival[other]:
                    rival[other] = keep[other] = False
    return keep


@njit(cache=True)
def _more_confident(one, other, scores, box_scores):
    sum_one, sum_other = 0.0, 0.0
    for j in range(scores.shape[1]):
        sum_one += scores[one, j]
        sum_other += scores[other, j]
    return box_scores[one] * sum_one > box_scores[other] * sum_other


@njit(cache=True)
def _similar(a, b, keypoints, scores, variances, box, area, threshold, least):
    """Return whether the OKS of two poses is above the threshold; most pairs are rejected after two joints."""
    joints = len(variances)
    size = box[a] + box[b]
    for stray in (True, False):
        if not stray:
            for d in (a, b):
                if area[d] < 0.0:
                    area[d] = _area(keypoints, scores, d)
            size = area[a] + area[b]
        shared, lost = 0, 0.0
        for j in range(joints):
            if not (scores[a, j] > 0.0 and scores[b, j] > 0.0):
                continue
            shared += 1
            dx, dy = keypoints[a, j, 0] - keypoints[b, j, 0], keypoints[a, j, 1] - keypoints[b, j, 1]
            d2, scale = dx * dx + dy * dy, _BOX_SHARE * size * variances[j]  # 2 s², s² of the mean area
            if d2 >= 40.0 * scale:  # also true for an area of 0
                lost += 1.0 if d2 > 0.0 else 0.0
            else:
                lost += 1.0 - np.exp(-d2 / scale)
            if lost >= (1.0 - threshold) * joints:
                return False
        if shared < least and not (lost == 0.0 and shared == _detected(scores, a) == _detected(scores, b)):
            return False
        if lost >= (1.0 - threshold) * shared:
            return False
    return True


@njit(cache=True)
def _detected(scores, d):
    """Return the number of detected joints."""
    count = 0
    for j in range(scores.shape[1]):
        count += scores[d, j] > 0.0
    return count


@njit(cache=True)
def _area(keypoints, scores, d):
    """Return the area of the box around the keypoints of a detection, without those far from the others."""
    values = np.empty(scores.shape[1])
    x, y, median = 0.0, 0.0, 0.0
    for axis in range(3):  # x, y, and the greater of the distances in x and y
        count = 0
        for j in range(len(values)):
            if scores[d, j] > 0.0:
                u, v = keypoints[d, j, 0], keypoints[d, j, 1]
                value, at = (u if axis == 0 else v if axis == 1 else max(abs(u - x), abs(v - y))), count
                while at > 0 and values[at - 1] > value:  # insertion sort
                    values[at] = values[at - 1]
                    at -= 1
                values[at] = value
                count += 1
        median = values[(count - 1) // 2] if count else 0.0  # the lower of two
        x, y = (median if axis == 0 else x), (median if axis == 1 else y)
    return _box_area(keypoints, scores, d, x, y, _FAR * median)


@njit(cache=True)
def _box_area(keypoints, scores, d, x, y, reach):
    """Return the area of the box around the keypoints that lie within ``reach`` of a point in x and in y."""
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for j in range(scores.shape[1]):
        u, v = keypoints[d, j, 0], keypoints[d, j, 1]
        if scores[d, j] > 0.0 and abs(u - x) <= reach and abs(v - y) <= reach:
            left, right = (u if u < left else left), (u if u > right else right)
            top, bottom = (v if v < top else top), (v if v > bottom else bottom)
    return (right - left) * (bottom - top) if right >= left else 0.0
