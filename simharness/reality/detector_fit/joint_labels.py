"""Every joint that a detector could have found, judged: what was found of it, and what could have gone wrong."""

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
from simharness.reality.detector_fit.bias_fit import Linear, fit_offsets, moved
from simharness.reality.detector_fit.occlusion import seen, with_face
from simharness.reality.detector_fit.sample import LIMBS, Sample
from simharness.types.truth import KeypointError

CLASSES = ("drop", "swap", "inversion", "miss", "jitter")
"""In the order in which they take joints."""

_HALF = len(LIMBS) // 2  # limb joints in the picture from which a person should be found


@dataclass(frozen=True)
class Judged:
    """What became of every joint of every known person in every view.

    Attributes:
        step: seconds from one frame to the next.
        association: which detection shows whom.
        boxes: of the people, (T, V, P, 4).
        unit: OKS sigma x sqrt(area), (T, V, P, 17) pixels.
        target: where the detector means the joints to be, (T, V, P, 17, 2) pixels; NaN where unknown.
        seen: how each joint is seen, as far as skeletons tell, (T, V, P, 17): VISIBLE, SELF_OCCLUDED or OCCLUDED.
        wanted: who should be found, (T, V, P): known people of whom half the limb joints are in the picture.
        error: :class:`KeypointError`, (T, V, P, 17); ABSENT where not reported or where no truth is known.
        risk: of each of CLASSES, which joints it could have taken, (T, V, P, 17).
        taken: which it took, (T, V, P, 17).
        chance: of swap and inversion, which misses would have been taken for one had the place been opposite.
        residual: of what is found from where the detector means it to be, units, (T, V, P, 17, 2); NaN where unknown.
        axes: right and down in the picture as directions in the world, (T, V, P, 2, 3).
        offset: the detector's bias, (9, 3) metres.
        normal: the normal equations of the bias, a (T, 9, 3, 3) and a (T, 9, 3) array.
    """

    step: float
    association: Association
    boxes: Floats
    unit: Floats
    target: Floats
    seen: NDArray[np.int8]
    wanted: Bools
    error: NDArray[np.int8]
    risk: Mapping[str, Bools]
    taken: Mapping[str, Bools]
    chance: Mapping[str, Bools]
    residual: Floats
    axes: Floats
    offset: Floats
    normal: tuple[Floats, Floats]


def judge(sample: Sample) -> Judged:
    """Judge the detections of a sample."""
    rig = sample.rig
    boxes = sizes.boxes(sample.reference, rig)
    unit = oks_units(boxes)
    association = associate(sample, _pictured(sample.reference, rig), boxes)
    keypoints = association.keypoints
    linear = Linear.of(sample.reference, keypoints, unit, rig)
    offset = fit_offsets(linear)
    target = _pictured(moved(sample.reference, offset), rig)
    neighbour = _neighbours(boxes, target, association.strangers, rig)
    error = classify(keypoints, target, unit, other=neighbour)

    sight = seen(*with_face(sample.reference, association.consensus), association.strangers, rig)
    inside = sizes.in_picture(sample.reference, rig)
    wanted = sample.known[:, None] & (inside[..., LIMBS].sum(axis=-1) >= _HALF)
    found = association.found[..., None] & inside & (sight != OUTSIDE)
    reported = found & (association.scores > 0)
    mirrored = target[..., MIRROR, :]
    judged = reported & (error != KeypointError.ABSENT)
    swap, inversion = error == KeypointError.SWAP, error == KeypointError.INVERSION
    miss, jitter = error == KeypointError.MISS, error == KeypointError.JITTER
    risk = {
        "drop": found,
        "swap": judged & distinguishable(neighbour, target, unit),
        "inversion": judged & ~swap & distinguishable(mirrored, target, unit),
        "miss": judged & ~swap & ~inversion,
        "jitter": judged & ~swap & ~inversion & ~miss,
    }
    taken = {"drop": found & ~reported, "swap": swap, "inversion": inversion, "miss": miss, "jitter": jitter}
    chance = {
        "swap": miss & opposite_hits(keypoints, target, neighbour, unit),
        "inversion": miss & opposite_hits(keypoints, target, mirrored, unit),
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = np.where(judged[..., None], (keypoints - target) / unit[..., None], np.nan)
    return Judged(
        step=sample.step,
        association=association,
        boxes=boxes,
        unit=unit,
        target=target,
        seen=np.where(sight == OUTSIDE, np.int8(VISIBLE), sight),
        wanted=wanted,
        error=error,
        risk=risk,
        taken={key: each & risk[key] for key, each in taken.items()},
        chance={key: each & risk[key] for key, each in chance.items()},
        residual=residual,
        axes=image_axes(sample.reference[:, :, LIMBS].mean(axis=2), rig),
        offset=offset,
        normal=linear.normal_equations(offset),
    )


def _pictured(joints: Floats, rig: Rig) -> Floats:
    """Joints (T, P, 17, 3) in the pictures, (T, V, P, 17, 2)."""
    return np.stack([camera.project(joints) for camera in rig], axis=1)


def _neighbours(boxes: Floats, target: Floats, strangers: Floats, rig: Rig) -> Floats:
    """Joints of whom each may be mistaken for: whose box overlaps most, (T, V, P, 17, 2); NaN where none does."""
    people = boxes.shape[2]
    everyone = np.concatenate([target, _pictured(strangers, rig)], axis=2)
    overlap = overlaps(np.concatenate([boxes, sizes.boxes(strangers, rig)], axis=2))[..., :people, :]
    if not overlap.shape[-1]:
        return np.full(target.shape, np.nan)
    nearest = overlap.argmax(axis=-1)[..., None, None]
    chosen = np.take_along_axis(everyone, nearest, axis=2)
    return np.where((overlap.max(axis=-1) > OVERLAP_MIN)[..., None, None], chosen, np.nan)
