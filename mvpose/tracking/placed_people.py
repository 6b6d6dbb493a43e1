"""Poses of tracked people as the stages of one frame place them, the evidence of the filter where there are any."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.rays import Rays
from mvpose.reconstruction.poses import Poses
from mvpose.reconstruction.triangulation import Triangulation
from mvpose.skeleton import Skeleton
from mvpose.tracking.frame_kernels import number_people


class PlacedPeople(NamedTuple):
    """Poses of k of n tracked people, arguments of :func:`mvpose.tracking.frame_kernels.update_tracks`.

    Attributes:
        of_pose: row of each track in the poses, (n,); -1 for a track whose rays are the evidence.
        places: joints, (k, J, 3), metres; NaN for an unknown joint.
        spreads: their covariances, (k, J, 3, 3).
        confidences: their scores, (k, J).
        factor: factor of these covariances, at least 1.
    """

    of_pose: Integers
    places: Floats
    spreads: Floats
    confidences: Floats
    factor: float


def place_people(
    reconstruction: Callable[[Rays, Integers, Skeleton], Poses],
    rays: Rays,
    skeleton: Skeleton,
    labels: Integers,
    groups: Integers,
    lead: Floats,
    *,
    factor: float,
) -> PlacedPeople:
    """Place the tracked people whom several cameras see at the time of the frame.

    Triangulation uses each joint's rays alone, which the filter does better: then nobody is placed.

    Args:
        reconstruction: stage of one frame.
        rays: viewing rays of the m detections.
        skeleton: their skeleton.
        labels: group of each, (m,), or -1.
        groups: group of each track, (n,), or -1.
        lead: time from the frame to the picture of each detection, (m,), seconds.
        factor: factor of the covariances, of :func:`repetition`.
    """
    joints = len(skeleton)
    of_pose, people = np.full(len(groups), -1), np.full(len(labels), -1)
    if not isinstance(reconstruction, Triangulation):
        number_people(labels, groups, lead, of_pose, people)
    if not (people >= 0).any():
        nobody = np.empty((0, joints, 3)), np.empty((0, joints, 3, 3)), np.empty((0, joints))
        return PlacedPeople(of_pose, *nobody, 1.0)
    poses = reconstruction(rays, people, skeleton)
    return PlacedPeople(of_pose, poses.joints, poses.covariance, poses.scores, factor)


def repetition(since: float, correlation: float) -> float:
    """Return the factor of the variance of errors that repeat those of ``since`` seconds ago.

    Errors with the correlation ``exp(-t / correlation)`` average out over many frames like independent ones of
    ``coth(since / (2 correlation))`` times the variance.
    """
    return 1.0 / math.tanh(since / (2.0 * correlation)) if since > 0.0 and correlation > 0.0 else 1.0
