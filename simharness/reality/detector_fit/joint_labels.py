"""Labels of all joints that a detector could have reported: their error, and the errors that were possible.

Errors are measured against the consensus of the other views (:mod:`simharness.reality.detector_fit.consensus`). What
hides what comes from the bodies that re-enact the people, as it will in a twin, or else from capsules about skeletons.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.detector.draws import PARENT
from simharness.detector.error_classes import MIRROR, classify, distinguishable, opposite_hits
from simharness.detector.reported import beyond_border, last_pixels
from simharness.detector.viewing_conditions import (
    OUTSIDE,
    OVERLAP_MIN,
    VISIBLE,
    head_bearings,
    image_axes,
    oks_units,
    overlaps,
    trunk_depths,
)
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.association import Association, associate
from simharness.reality.detector_fit.consensus import Consensus, find_consensus
from simharness.reality.detector_fit.occlusion import complete_face, in_picture, occlusion_classes, person_boxes
from simharness.reality.detector_fit.sample import Sample
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS
from simharness.types.truth import KeypointError

CLASSES = ("drop", "swap", "inversion", "miss", "jitter")
"""Error classes in the order in which they take joints."""

_OF_KIND = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
_USUAL = 3.0  # deviations
_HALF = len(LIMB_JOINTS) // 2  # limb joints in the picture from which a person is expected to be detected


@dataclass(frozen=True)
class LabelledJoints:
    """Labels of every joint of every known person in every view."""

    time: Floats
    """Times of the frames, (T,) seconds."""
    step: float
    """Seconds between consecutive frames."""
    kind: DetectorKind
    """Kind of the detector."""
    known: Bools
    """People who are measured, (T, P)."""
    association: Association
    """People shown by the detections."""
    consensus: Consensus
    """Joints on which the views agree."""
    boxes: Floats
    """Boxes of the people, (T, V, P, 4)."""
    unit: Floats
    """OKS sigma x sqrt(area), (T, V, P, 17) pixels."""
    target: Floats
    """Joints as the other views place them, or as the sample where they do not, (T, V, P, 17, 2) pixels."""
    occlusion: NDArray[np.int8]
    """Occlusion class estimated from skeletons, (T, V, P, 17): VISIBLE, SELF_OCCLUDED or OCCLUDED."""
    bearing: NDArray[np.int64]
    """Bin of the bearing of the camera from the head, to the left of straight ahead, (T, V, P)."""
    depth: Floats
    """Depth of the joints behind the middle of the trunk, as seen from the side, (T, V, P, 17) metres."""
    inside: Bools
    """Joints inside of the image, as the sample places them, (T, V, P, 17)."""
    beyond: Floats
    """Distance of joints outside of the image from its border, units of limb joints, (T, V, P, 17)."""
    expected: Bools
    """People who should be detected, (T, V, P): known people with half of the limb joints in the picture."""
    error: NDArray[np.int8]
    """:class:`KeypointError`, (T, V, P, 17); ABSENT where not reported or where the views do not agree."""
    risk: Mapping[str, Bools]
    """For each of CLASSES, the joints that it could have taken, (T, V, P, 17)."""
    taken: Mapping[str, Bools]
    """For each of CLASSES, the joints that it took, (T, V, P, 17)."""
    chance: Mapping[str, Bools]
    """For swap and inversion, the misses opposite to the place of that error, (T, V, P, 17): as many are expected to
    fall on the place by chance."""
    residual: Floats
    """Keypoint minus target, units, without the noise of the target, (T, V, P, 17, 2); NaN where unknown."""
    axes: Floats
    """Right and down in the picture as directions in the world, (T, V, P, 2, 3)."""


def label_joints(sample: Sample) -> LabelledJoints:
    """Label the joints of all known people of a sample."""
    rig = sample.rig
    boxes = person_boxes(sample.reference, rig)
    unit = oks_units(boxes)
    association = associate(sample, _project(sample.reference, rig), boxes)
    consensus = find_consensus(rig, association.keypoints, unit)
    predictable = np.isfinite(consensus.predicted[..., 0])
    target = np.where(predictable[..., None], consensus.predicted, _project(sample.reference, rig))
    residual = _without_noise(association.keypoints - consensus.predicted, unit, consensus)
    keypoints = target + residual * unit[..., None]
    neighbour = _neighbours(boxes, target, association.unannotated, rig)
    error = classify(keypoints, target, unit, other=neighbour)

    staged, occlusion = sample.staged, sample.occlusion
    if staged is None or occlusion is None:
        staged, normals = complete_face(sample.reference, consensus.joints)
        occlusion = occlusion_classes(staged, normals, association.unannotated, rig)
        inside = in_picture(sample.reference, rig)
    else:
        inside = occlusion != OUTSIDE
    found = association.detected[..., None] & sample.known[:, None, :, None] & inside & (occlusion != OUTSIDE)
    classes = error_classes(
        error, keypoints, target, neighbour, unit, found=found, scores=association.scores, kind=sample.kind
    )
    return LabelledJoints(
        time=sample.time,
        step=sample.step,
        kind=sample.kind,
        known=sample.known,
        association=association,
        consensus=consensus,
        boxes=boxes,
        unit=unit,
        target=target,
        occlusion=np.where(occlusion == OUTSIDE, np.int8(VISIBLE), occlusion),
        bearing=bearing_bins(staged, rig),
        depth=trunk_depths(staged, rig),
        inside=inside,
        beyond=beyond_border(_project(staged, rig), unit, last_pixels(rig)[:, None]),
        expected=expected_people(sample.known, inside),
        error=error,
        risk=classes.risk,
        taken=classes.taken,
        chance=classes.chance,
        residual=np.where(classes.labelled[..., None], residual, np.nan),
        axes=image_axes(sample.reference[:, :, LIMB_JOINTS].mean(axis=2), rig),
    )


class ErrorClasses(NamedTuple):
    """Joints whose error is known, (T, V, P, 17), and those that each class could have taken, took, and may have taken
    by chance, by class.
    """

    labelled: Bools
    risk: Mapping[str, Bools]
    taken: Mapping[str, Bools]
    chance: Mapping[str, Bools]


def error_classes(
    error: NDArray[np.int8],
    keypoints: Floats,
    target: Floats,
    neighbour: Floats,
    unit: Floats,
    *,
    found: Bools,
    scores: Floats,
    kind: DetectorKind,
) -> ErrorClasses:
    """Return which joints each of CLASSES could have taken and took, as the attributes of :class:`LabelledJoints`.

    Args:
        error: :class:`KeypointError`, (T, V, P, 17).
        keypoints: places of the keypoints, (T, V, P, 17, 2) pixels.
        target: true places, (T, V, P, 17, 2) pixels.
        neighbour: the same joints of the person whose box overlaps most, (T, V, P, 17, 2); NaN where there is none.
        unit: OKS sigma x sqrt(area), (T, V, P, 17) pixels.
        found: joints in the picture of people who are detected, (T, V, P, 17).
        scores: scores of the keypoints, (T, V, P, 17); 0 where not reported.
        kind: kind of the detector.
    """
    reported = found & (scores > 0)
    droppable = found.copy()
    if kind == "bottom-up":
        for joint in np.flatnonzero(PARENT >= 0):
            droppable[..., joint] &= reported[..., PARENT[joint]]
    mirrored = target[..., MIRROR, :]
    labelled = reported & (error != KeypointError.ABSENT)
    swap, inversion = error == KeypointError.SWAP, error == KeypointError.INVERSION
    miss, jitter = error == KeypointError.MISS, error == KeypointError.JITTER
    risk = {
        "drop": droppable,
        "swap": labelled & distinguishable(neighbour, target, unit),
        "inversion": labelled & ~swap & distinguishable(mirrored, target, unit),
        "miss": labelled & ~swap & ~inversion,
        "jitter": labelled & ~swap & ~inversion & ~miss,
    }
    taken = {"drop": droppable & ~reported, "swap": swap, "inversion": inversion, "miss": miss, "jitter": jitter}
    chance = {
        "swap": miss & opposite_hits(keypoints, target, neighbour, unit),
        "inversion": miss & opposite_hits(keypoints, target, mirrored, unit),
    }
    return ErrorClasses(
        labelled,
        risk,
        {key: each & risk[key] for key, each in taken.items()},
        {key: each & risk[key] for key, each in chance.items()},
    )


def expected_people(known: Bools, inside: Bools) -> Bools:
    """Return which known people (T, P) have half of their limb joints (T, V, P, 17) inside the picture, (T, V, P)."""
    return known[:, None] & (inside[..., LIMB_JOINTS].sum(axis=-1) >= _HALF)


def _without_noise(residual: Floats, unit: Floats, consensus: Consensus) -> Floats:
    """Return residuals (T, V, P, 17, 2) from the prediction in units, without the noise of the prediction.

    A residual of usual size is reduced by its share of the noise; one beyond _USUAL deviations, which is an error, is
    left as it is.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = residual / unit[..., None]
        factor = 1 + consensus.noise
        square = (residual**2).sum(axis=-1)
        alike = np.where(consensus.agrees, square / factor, np.nan)
        known = np.isfinite(alike).sum(axis=(0, 1, 2)) @ _OF_KIND
        variance = np.nansum(alike, axis=(0, 1, 2)) @ _OF_KIND / known / 2  # of each kind of joint, per axis
    usual = square < _USUAL**2 * variance[list(KIND_OF_JOINT)] * factor
    return np.where(usual[..., None], residual / np.sqrt(factor)[..., None], residual)


def bearing_bins(joints: Floats, rig: Rig) -> NDArray[np.int64]:
    """Return the bins of the bearings of the cameras from the heads of people (T, P, 17, 3), (T, V, P)."""
    turn = np.nan_to_num(head_bearings(joints, rig)) / (2 * np.pi) * len(BEARINGS)
    return np.round(turn).astype(np.int64) % len(BEARINGS)


def _project(joints: Floats, rig: Rig) -> Floats:
    """Project joints (T, P, 17, 3) into the pictures, (T, V, P, 17, 2)."""
    return np.stack([camera.project(joints) for camera in rig], axis=1)


def _neighbours(boxes: Floats, target: Floats, unannotated: Floats, rig: Rig) -> Floats:
    """Return the joints of the person whose box overlaps most, (T, V, P, 17, 2); NaN where no box overlaps."""
    people = boxes.shape[2]
    everyone = np.concatenate([target, _project(unannotated, rig)], axis=2)
    overlap = overlaps(np.concatenate([boxes, person_boxes(unannotated, rig)], axis=2))[..., :people, :]
    if not overlap.shape[-1]:
        return np.full(target.shape, np.nan)
    nearest = overlap.argmax(axis=-1)[..., None, None]
    chosen = np.take_along_axis(everyone, nearest, axis=2)
    return np.where((overlap.max(axis=-1) > OVERLAP_MIN)[..., None, None], chosen, np.nan)
