"""Errors in the pictures, pixels: reprojected estimates compared with detections.

Dong et al. (CVPR 2019, section 4.4) report that estimates projected back into the views are much more accurate than the
detections. Both are compared with the true pixel at the same joints: every detected keypoint of a person with an
estimate, where the joint is visible. If a person is detected twice in a view, both detections are compared.

True pixels are projected with the true rig, and estimates with the believed rig: a wrong calibration is part of their
error, as it is in an overlay on the pictures.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.types.recording import Recording
from simharness.types.views import Visibility


def reprojection_errors(recording: Recording, placed: Floats) -> tuple[Floats, Floats]:
    """Return the distances of reprojected estimates and of detections from the true pixels.

    Args:
        recording: the truth, the detections and the believed rig.
        placed: joints of the estimate paired with every true person, (T, P, J, 3), metres; NaN where missing.

    Returns:
        Errors of the reprojected estimates and errors of the detections, both (k,), pixels; entry i of both is the same
        joint in the same view. Joints behind the believed camera have no pixel and are left out.
    """
    counts = [len(detections) for detections in recording.detections]
    frame = np.repeat(np.arange(len(recording)), counts)
    view = np.concatenate([detections.view for detections in recording.detections])
    person = np.concatenate([truth.person for truth in recording.truth])
    keypoints = np.concatenate([detections.keypoints for detections in recording.detections])

    known = np.flatnonzero(person >= 0)
    frame, view, person, keypoints = frame[known], view[known], person[known], keypoints[known]
    visible = np.stack([truth.visibility for truth in recording.truth])[frame, view, person] == Visibility.VISIBLE
    pixels = np.stack([truth.pixels for truth in recording.truth])[frame, view, person]
    joints = placed[frame, person]
    reprojected = np.full_like(keypoints, np.nan)
    for index, camera in enumerate(recording.rig):
        in_view = view == index
        reprojected[in_view] = camera.project(joints[in_view])
    estimate, detection = (np.linalg.norm(points - pixels, axis=-1) for points in (reprojected, keypoints))
    compared = visible & np.isfinite(estimate) & np.isfinite(detection)
    return estimate[compared], detection[compared]
