"""How far off in the pictures: estimates drawn into them, against the detections.

The paper says that estimates projected back into the views are much more accurate than the detections (Dong et al.,
CVPR 2019, section 4.4). Both are compared with the true pixel at the same joints: every detected keypoint of a person
with an estimate, where the joint is visible. A person who was detected twice in a view has both compared.

True pixels are those of the cameras as they truly stand, and estimates are projected with the rig as believed: a wrong
calibration is part of their error, as it is of an overlay that somebody looks at.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.types.recording import Recording
from simharness.types.views import Visibility


def reprojection_errors(recording: Recording, placed: Floats) -> tuple[Floats, Floats]:
    """Distances from the true pixels.

    Args:
        recording: the truth, the detections and the believed rig.
        placed: the estimate of every true person, (T, P, J, 3), metres; NaN where missing.

    Returns:
        Of the reprojected estimates and of the detections, both (k,), pixels: entry by entry of the same joint in the
        same view. A joint that the believed camera has behind it has no pixel, and is left out.
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
        seen = view == index
        reprojected[seen] = camera.project(joints[seen])
    estimate, detection = (np.linalg.norm(found - pixels, axis=-1) for found in (reprojected, keypoints))
    compared = visible & np.isfinite(estimate) & np.isfinite(detection)
    return estimate[compared], detection[compared]
