"""Disagreement of the views of a recording, and of its truth with them: what shows a wrong twin long before PCP does.

Keypoints are compared with the place where the other views put the joint, in units of OKS sigma x sqrt(area); viewing
rays with each other, where a wrong calibration shows. Distances are truncated, so that gross errors, which have a
figure of their own, do not decide the others.
"""

import itertools

import numpy as np

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.detector.error_classes import MISS_FROM
from simharness.reality.detector_fit.consensus import find_consensus
from simharness.reality.detector_fit.sample import LIMB_JOINTS
from simharness.reality.validation.evidence import Ratio, by_frame
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS

_FARTHEST = 3.0  # units
_FARTHEST_RAYS = 100.0  # mm
_FARTHEST_TRUTH = 200.0  # mm


def view_disagreement(
    rig: Rig, keypoints: Floats, unit: Floats, reference: Floats, following: Bools
) -> dict[str, Ratio]:
    """Return the figures of F frames by key, of limb joints; views are numbered from 1.

    ``residual.VIEW`` (mean distance from the place where the other views put the joint, units), ``memory.VIEW``
    (correlation of this offset from one frame to the next), ``gross`` and ``gross_joints.KIND`` (share beyond 2.35
    units), ``epipolar.V-W`` and ``offset.V-W`` (mean distance of the viewing rays of two views, without and with its
    sign, mm), and ``annotation.KIND`` (mean distance of the truth from the consensus of the views, mm).

    Args:
        rig: the V cameras.
        keypoints: keypoints of the actors, (F, V, A, 17, 2) pixels; NaN where not reported.
        unit: OKS sigma x sqrt(area), (F, V, A, 17) pixels; 0 where the person is not in the picture.
        reference: the truth, (F, A, 17, 3) metres; NaN where unknown.
        following: which frames come directly after the frame before, (F,).
    """
    consensus = find_consensus(rig, keypoints, unit)
    limbs = np.zeros(keypoints.shape[3], bool)
    limbs[LIMB_JOINTS] = True
    with np.errstate(invalid="ignore", divide="ignore"):
        away = np.where(limbs[:, None], (keypoints - consensus.predicted) / unit[..., None], np.nan)
        distance = np.linalg.norm(away, axis=-1)  # (F, V, A, 17)
        away = away * np.minimum(1.0, _FARTHEST / np.maximum(distance, 1e-9))[..., None]
        to_truth = 1000.0 * np.linalg.norm(reference - consensus.joints, axis=-1)
    result: dict[str, Ratio] = {}
    for view in range(len(rig)):
        result[f"residual.{view + 1}"] = _mean(np.minimum(distance[:, view], _FARTHEST))
        result[f"memory.{view + 1}"] = _memory(away[:, view], following)
    result["gross"] = _mean(np.where(np.isfinite(distance), distance > MISS_FROM, np.nan))
    kinds = np.array(KIND_OF_JOINT)
    for kind in dict.fromkeys(kinds[limbs]):
        of_kind = distance[..., kinds == kind]
        gross = np.where(np.isfinite(of_kind), of_kind > MISS_FROM, np.nan)
        result[f"gross_joints.{KINDS[kind]}"] = _mean(gross)
        result[f"annotation.{KINDS[kind]}"] = _mean(np.minimum(to_truth[..., kinds == kind], _FARTHEST_TRUTH))
    return result | _rays(rig, np.where(limbs[:, None], keypoints, np.nan))


def _rays(rig: Rig, keypoints: Floats) -> dict[str, Ratio]:
    """Return the distances of the viewing rays of each pair of views."""
    rays = [camera.rays(keypoints[:, view]) for view, camera in enumerate(rig)]
    result = {}
    for one, other in itertools.combinations(range(len(rig)), 2):
        across = np.cross(rays[one], rays[other])
        apart = 1000.0 * (across @ (rig.centers[other] - rig.centers[one]))
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.clip(apart / np.linalg.norm(across, axis=-1), -_FARTHEST_RAYS, _FARTHEST_RAYS)
        pair = f"{one + 1}-{other + 1}"
        result[f"epipolar.{pair}"], result[f"offset.{pair}"] = _mean(np.abs(apart)), _mean(apart)
    return result


def _mean(values: Floats) -> Ratio:
    """Return the mean of values (F, ...) without NaN."""
    known = np.isfinite(values)
    return Ratio(by_frame(np.where(known, values, 0.0)), by_frame(known))


def _memory(away: Floats, following: Bools) -> Ratio:
    """Return the correlation of offsets (F, ..., 2) with those of the frame before."""
    before = np.concatenate([np.full_like(away[:1], np.nan), away[:-1]])
    both = np.isfinite(away).all(axis=-1) & np.isfinite(before).all(axis=-1)
    both &= following.reshape(-1, *(1,) * (both.ndim - 1))
    now, before = (np.where(both[..., None], each, 0.0) for each in (away, before))
    return Ratio(by_frame(now * before), by_frame(now**2 + before**2) / 2)
