"""Bias of the face: where a detector places nose, eyes and ears relative to the face of a simulated body.

Data sets do not annotate the face. The bodies that re-enact a recording have faces, turned as the detected ones; what
is left between the two, on average, is how the detector's joints of the face differ from the landmarks of the bodies.
"""

from __future__ import annotations

import warnings

import numpy as np

from mvpose.arrays import Floats
from simharness.detector.bias import SIDE, body_axes
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import KIND_OF_JOINT


def face_bias(tracked: Floats, staged: Floats) -> Floats:
    """Return the offset of the tracked joints of the face from the staged ones, (3, 3) metres: forward, outward, up.

    One row for nose, eyes and ears; 0 where nothing is known.

    Args:
        tracked: joints of people as detected, (F, P, 17, 3) metres; NaN where unknown.
        staged: joints of the bodies that re-enact them, (F, P, 17, 3) metres; NaN where absent.
    """
    face = slice(0, LIMB_JOINTS[0])
    offset = np.einsum("fpjc,fpkc->fpjk", (tracked - staged)[:, :, face], body_axes(staged))
    offset[..., 1] *= SIDE[face]
    kinds = np.array(KIND_OF_JOINT[face])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # people who are always absent
        # Each person counts alike: one with more frames says no more about the next one.
        of_person = np.nanmedian(offset, axis=0)
        return np.nan_to_num(np.stack([np.nanmean(of_person[:, kinds == kind], axis=(0, 1)) for kind in range(3)]))
