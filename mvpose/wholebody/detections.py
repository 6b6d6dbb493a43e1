"""Detections of the whole body, and their part that the method sees: the 17 joints of COCO."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Integers
from mvpose.checks import as_array, seal
from mvpose.detections import Detections
from mvpose.heatmaps import Heatmaps
from mvpose.skeleton import COCO17, Skeleton


@lru_cache(maxsize=64)
def rows_of(skeleton: Skeleton) -> tuple[Integers, Integers]:
    """Return the row of each joint of COCO17 in a skeleton, (17,), -1 for none, and the rows of its other joints, (E,).

    Raises:
        ValueError: a skeleton with none of the joints of COCO17, or with no others.
    """
    body = np.array([skeleton.joints.index(joint) if joint in skeleton.joints else -1 for joint in COCO17.joints])
    if (body < 0).all():
        raise ValueError(
            f"skeleton {skeleton.name!r} has no joint of COCO17, on which people are matched: expected names such as "
            f"{COCO17.joints[5]}, got {', '.join(skeleton.joints[:8])}"
        )
    others = np.setdiff1d(np.arange(len(skeleton)), body)
    if not len(others):
        raise ValueError(f"skeleton {skeleton.name!r} has no joint beyond COCO17; use COCO17 itself, in its order")
    seal(body, others)
    return body, others


def body_part(detections: Detections) -> Detections:
    """Return the detections on COCO17, with their boxes, descriptors and times; a joint that they lack is missing."""
    if detections.skeleton == COCO17:
        return detections
    rows, _ = rows_of(detections.skeleton)
    maps = detections.likelihoods
    return Detections(
        detections.view,
        np.where(rows[:, None] >= 0, detections.keypoints[:, rows], np.nan),
        np.where(rows >= 0, detections.scores[:, rows], 0.0),
        detections.boxes,
        detections.box_scores,
        COCO17,
        detections.descriptors,
        # A joint without a map would be one of -1, the last: its score of 0 overrides it.
        None if maps is None else Heatmaps(maps.values[:, rows], maps.origin, maps.stride),
        detections.time,
    )


def with_body_boxes(view: ArrayLike, keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton) -> Detections:
    """Create detections of the whole body with boxes that span the joints of COCO17 and have their mean score.

    So the method gets what :meth:`mvpose.Detections.from_keypoints` makes of the body alone.

    Args:
        view: camera of each detection, (m,).
        keypoints: pixels, (m, J, 2).
        scores: confidence of each keypoint, 0 to 1, (m, J).
        skeleton: the J joints.

    Raises:
        ValueError: as :class:`mvpose.Detections`, or a skeleton without joints of COCO17.
    """
    whole = Detections.from_keypoints(view, keypoints, scores, skeleton=skeleton)
    if skeleton == COCO17:
        return whole
    seen = body_part(whole)
    body = Detections.from_keypoints(seen.view, seen.keypoints, seen.scores)
    boxes = as_array(body.boxes, (len(whole), 4), "boxes")
    return Detections(whole.view, whole.keypoints, whole.scores, boxes, body.box_scores, skeleton)
