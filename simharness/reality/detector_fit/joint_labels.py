"""Labels of all joints that a detector could have reported: their error, and the errors that were possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.detector.conditions import OUTSIDE, OVERLAP_MIN, VISIBLE, oks_units, overlaps
from simharness.detector.error_classes import MIRROR, classify, distinguishable, opposite_hits
from simharness.detector.view_geometry import image_axes
from simharness.reality.detector_fit import sizes
from simharness.reality.detector_fit.association import Association, associate
from simharness.reality.detector_fit.bias_fit import LinearisedBias, apply_bias, fit_bias
from simharness.reality.detector_fit.occlusion import complete_face, occlusion_classes
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample
from simharness.types.truth import KeypointError

CLASSES = ("drop", "swap", "inversion", "miss", "jitter")
"""Error classes in the order in which they take joints."""

_HALF = len(LIMB_JOINTS) // 2  # limb joints in the picture from which a person is expected to be detected


@dataclass(frozen=True)
class LabelledJoints:
    """Labels of every joint of every known person in every view.

    Attributes:
        step: seconds between consecutive frames.
        association: people shown by the detections.
        boxes: boxes of the people, (T, V, P, 4).
        unit: OKS sigma x sqrt(area), (T, V, P, 17) pixels.
        target: true joints moved by the detector's bias, (T, V, P, 17, 2) pixels; NaN where unknown.
        occlusion: occlusion class estimated from skeletons, (T, V, P, 17): VISIBLE, SELF_OCCLUDED or OCCLUDED.
        expected: people who should be detected, (T, V, P): known people with half of the limb joints in the picture.
        error: :class:`KeypointError`, (T, V, P, 17); ABSENT where not reported or where the truth is unknown.
        risk: for each of CLASSES, the joints that it could have taken, (T, V, P, 17).
        taken: for each of CLASSES, the joints that it took, (T, V, P, 17).
        chance: for swap and inversion, the misses opposite to the place of that error, (T, V, P, 17): as many are
            expected to fall on the place by chance.
        residual: keypoint minus target, units, (T, V, P, 17, 2); NaN where unknown.
        axes: right and down in the picture as directions in the world, (T, V, P, 2, 3).
        offset: the detector's bias, (9, 3) metres.
        normal: normal equations of the bias, a (T, 9, 3, 3) and a (T, 9, 3) array.
    """

    step: float
    association: Association
    boxes: Floats
    unit: Floats
    target: Floats
    occlusion: NDArray[np.int8]
    expected: Bools
    error: NDArray[np.int8]
    risk: Mapping[str, Bools]
    taken: Mapping[str, Bools]
    chance: Mapping[str, Bools]
    residual: Floats
    axes: Floats
    offset: Floats
    normal: tuple[Floats, Floats]


def label_joints(sample: Sample) -> LabelledJoints:
    """Label the joints of all known people of a sample."""
    rig = sample.rig
    boxes = sizes.boxes(sample.reference, rig)
    unit = oks_units(boxes)
    association = associate(sample, _project(sample.reference, rig), boxes)
    keypoints = association.keypoints
    linear = LinearisedBias.of(sample.reference, keypoints, unit, rig)
    offset = fit_bias(linear)
    target = _project(apply_bias(sample.reference, offset), rig)
    neighbour = _neighbours(boxes, target, association.unannotated, rig)
    error = classify(keypoints, target, unit, other=neighbour)

    occlusion = occlusion_classes(*complete_face(sample.reference, association.consensus), association.unannotated, rig)
    inside = sizes.in_picture(sample.reference, rig)
    expected = sample.known[:, None] & (inside[..., LIMB_JOINTS].sum(axis=-1) >= _HALF)
    found = association.detected[..., None] & inside & (occlusion != OUTSIDE)
    reported = found & (association.scores > 0)
    mirrored = target[..., MIRROR, :]
    labelled = reported & (error != KeypointError.ABSENT)
    swap, inversion = error == KeypointError.SWAP, error == KeypointError.INVERSION
    miss, jitter = error == KeypointError.MISS, error == KeypointError.JITTER
    risk = {
        "drop": found,
        "swap": labelled & distinguishable(neighbour, target, unit),
        "inversion": labelled & ~swap & distinguishable(mirrored, target, unit),
        "miss": labelled & ~swap & ~inversion,
        "jitter": labelled & ~swap & ~inversion & ~miss,
    }
    taken = {"drop": found & ~reported, "swap": swap, "inversion": inversion, "miss": miss, "jitter": jitter}
    chance = {
        "swap": miss & opposite_hits(keypoints, target, neighbour, unit),
        "inversion": miss & opposite_hits(keypoints, target, mirrored, unit),
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = np.where(labelled[..., None], (keypoints - target) / unit[..., None], np.nan)
    return LabelledJoints(
        step=sample.step,
        association=association,
        boxes=boxes,
        unit=unit,
        target=target,
        occlusion=np.where(occlusion == OUTSIDE, np.int8(VISIBLE), occlusion),
        expected=expected,
        error=error,
        risk=risk,
        taken={key: each & risk[key] for key, each in taken.items()},
        chance={key: each & risk[key] for key, each in chance.items()},
        residual=residual,
        axes=image_axes(sample.reference[:, :, LIMB_JOINTS].mean(axis=2), rig),
        offset=offset,
        normal=linear.normal_equations(offset),
    )


def _project(joints: Floats, rig: Rig) -> Floats:
    """Project joints (T, P, 17, 3) into the pictures, (T, V, P, 17, 2)."""
    return np.stack([camera.project(joints) for camera in rig], axis=1)


def _neighbours(boxes: Floats, target: Floats, unannotated: Floats, rig: Rig) -> Floats:
    """Return the joints of the person whose box overlaps most, (T, V, P, 17, 2); NaN where no box overlaps."""
    people = boxes.shape[2]
    everyone = np.concatenate([target, _project(unannotated, rig)], axis=2)
    overlap = overlaps(np.concatenate([boxes, sizes.boxes(unannotated, rig)], axis=2))[..., :people, :]
    if not overlap.shape[-1]:
        return np.full(target.shape, np.nan)
    nearest = overlap.argmax(axis=-1)[..., None, None]
    chosen = np.take_along_axis(everyone, nearest, axis=2)
    return np.where((overlap.max(axis=-1) > OVERLAP_MIN)[..., None, None], chosen, np.nan)
