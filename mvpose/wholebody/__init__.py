"""Hands, face and feet: people are matched on the body, and their other joints triangulated with the same error model.

The method sees the 17 joints of COCO of every detection and nothing else, so that its results are the same to the bit
with and without other joints. :func:`whole_body` wraps any estimator or tracker; neither :class:`mvpose.Detections` nor
the pipeline know of it: detections are on a skeleton with more joints, and so are the estimates.
"""

from mvpose.wholebody.estimator import (
    WholeBody,
    WholeBodyTracking,
    body_of,
    body_part,
    complete,
    whole_body,
    with_body_boxes,
)
from mvpose.wholebody.skeletons import SKELETONS, known_names, read_skeleton, register, skeleton_by_name

__all__ = [
    "SKELETONS", "WholeBody", "WholeBodyTracking", "body_of", "body_part", "complete", "known_names", "read_skeleton",
    "register", "skeleton_by_name", "whole_body", "with_body_boxes",
]  # fmt: skip
