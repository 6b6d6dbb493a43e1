"""Shares of joints that are not reported: by occlusion, and for the face by the bearing of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.detector.bias import SIDE
from simharness.detector.conditions import OCCLUDED, OUTSIDE, VISIBLE
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS, DropSection, FaceSection


def drop_shares(drop: DropSection, face: FaceSection, occlusion: NDArray[np.int8], bearings: Floats | None) -> Floats:
    """Return the share of each joint that is not reported, (T, V, P, 17); for joints outside the image any value.

    Args:
        drop: shares by occlusion.
        face: shares of the face by bearing.
        occlusion: occlusion classes of the joints, (T, V, P, 17).
        bearings: bearings of the cameras from the heads, (T, V, P), radians to the left of straight ahead; None if
            ``face`` has no shares.
    """
    table = np.array([shares.by_joint() for shares in (drop.visible, drop.self_occluded, drop.occluded)])
    result = table[np.where(occlusion == OUTSIDE, VISIBLE, occlusion), np.arange(occlusion.shape[-1])]
    if bearings is None:
        return result
    for joint, kind in enumerate(KIND_OF_JOINT):
        shares = getattr(face, KINDS[kind], None)
        if shares is not None:
            unhidden = occlusion[..., joint] != OCCLUDED
            result[..., joint] = np.where(unhidden, _by_bearing(shares, SIDE[joint] * bearings), result[..., joint])
    return result


def _by_bearing(shares: tuple[float, ...], bearings: Floats) -> Floats:
    """Return shares interpolated at bearings (...), radians."""
    return np.interp(bearings, np.deg2rad(BEARINGS), shares, period=2 * np.pi)
