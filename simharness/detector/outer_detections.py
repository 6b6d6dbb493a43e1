"""Detections of outer joints: feet, hands and others beyond COCO17.

Detectors of the whole body find a foot where they find its ankle and a hand where they find its wrist. So an outer
joint has one or two joints of COCO17 as anchors, and follows them in every detection, whatever errors it has (split,
merged, repeated people, late pictures):

- it is reported only where its anchors are, and beyond that dropped with the shares of the kind of its anchor, by its
  own occlusion; the outer joints of a limb are dropped together;
- where an anchor is a jitter, a miss or a guess, it is displaced with the anchor; where the anchor is an inversion or a
  swap, it is at its left-right counterpart, or at the same joint of the other person;
- it scatters about this place as good keypoints of the kind of its anchor do, in units of its own OKS sigma;
- its score is that of its anchor, with the factor of hidden good keypoints where it is not visible itself.

False positives have no outer joints. All draws are separate from those of the joints of COCO17, which stay the same to
the bit.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from mvpose import COCO17
from mvpose.arrays import Bools, Floats, Integers
from mvpose.skeleton import Skeleton
from mvpose.wholebody.estimator import rows_of
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.scatter import Scatter
from simharness.detector.steps import Context
from simharness.detector.viewing_conditions import (
    BOX_SHARE,
    OUTSIDE,
    VISIBLE,
    image_axes,
    occlusion_classes,
    pixel_offsets,
)
from simharness.scenario.sections.detector_section import BiasSection
from simharness.types.outer_joints import OuterTruth
from simharness.types.truth import KeypointError

_OF_PEOPLE = (Origin.PERSON, Origin.DUPLICATE, Origin.LOWER_HALF)
_DISPLACED = (KeypointError.JITTER, KeypointError.MISS)
_MIDDLES = {"neck": "shoulder", "head": "shoulder", "mid_hip": "hip", "hip": "hip"}
_ENDS = {"big": "ankle", "small": "ankle", "heel": "ankle", "hand": "wrist"}  # by the first word after the side


@dataclass(frozen=True)
class OuterDetections:
    """Outer joints of n detections."""

    keypoints: Floats
    """Pixels, (n, E, 2); NaN where not reported."""
    scores: Floats
    """0 to 1, (n, E); 0 where not reported."""


def anchors_of(skeleton: Skeleton) -> Integers:
    """Return the two anchors of each joint of a skeleton beyond COCO17, (E, 2), joints of COCO17; often twice the same.

    Joints of the face, which bodies do not have, are anchored at the nose.
    """
    _, others = rows_of(skeleton)
    result = []
    for name in (skeleton.joints[row] for row in others):
        side, *words = name.split("_")
        end = _ENDS.get(words[0]) if words and side in ("left", "right") else None
        if name in _MIDDLES:
            pair = [f"{each}_{_MIDDLES[name]}" for each in ("left", "right")]
        else:
            pair = [f"{side}_{end}" if end else "nose"] * 2
        result.append([COCO17.index(joint) for joint in pair])
    return np.array(result)


def detect_outer_joints(
    block: DetectionBlock, context: Context, outer: OuterTruth, where: tuple[Integers, Integers, Integers]
) -> OuterDetections:
    """Return the outer joints of detections.

    Args:
        block: detections as they are delivered.
        context: what the detector may read.
        outer: true outer joints, E of them.
        where: frame, view and slot of the n detections, (n,) each.
    """
    frame, view, slot = where
    person, anchors = block.number[where], anchors_of(outer.skeleton)
    people = np.flatnonzero(np.isin(block.origin[where], _OF_PEOPLE))
    shape = len(frame), len(anchors)
    result = OuterDetections(np.full((*shape, 2), np.nan), np.zeros(shape))
    for who in np.unique(person[people]):
        rows = people[person[people] == who]
        t, v, s = frame[rows], view[rows], slot[rows]
        taken = np.maximum(context.views.source[t, v], 0)  # the frame of the picture
        error, scores = block.error[t, v, s][:, anchors], block.scores[t, v, s][:, anchors]
        place = _places(block.keypoints[t, v, s][:, anchors], error, context, outer, anchors, (t, v, int(who)))
        scatter, dropped = _drawn(context, outer, anchors, int(who))
        box = context.views.boxes[t, v, who]
        area = np.sqrt(BOX_SHARE * box[:, 2] * box[:, 3])
        place += (area[:, None] * _sigmas(outer.skeleton))[..., None] * scatter[taken, v]
        occlusion = occlusion_classes(outer.views.visibility[t, v, who])
        found = (scores > 0).all(axis=-1) & (occlusion != OUTSIDE) & ~dropped[taken, v] & np.isfinite(place[..., 0])
        hidden = np.where(occlusion == VISIBLE, 1.0, context.config.scores.hidden.good)
        result.keypoints[rows] = np.where(found[..., None], place, np.nan)
        result.scores[rows] = np.where(found, scores.mean(axis=-1) * hidden, 0.0)
    return result


def _places(
    anchor: Floats,
    error: Integers,
    context: Context,
    outer: OuterTruth,
    anchors: Integers,
    where: tuple[Integers, Integers, int],
) -> Floats:
    """Return where the outer joints of n detections of a person are found but for their scatter, (n, E, 2) pixels.

    Args:
        anchor: detected anchors, (n, E, 2, 2) pixels.
        error: their error classes, (n, E, 2).
        context: what the detector may read.
        outer: true outer joints.
        anchors: anchors of the outer joints, (E, 2).
        where: frame and view of the detections, (n,) each, and the person.
    """
    t, v, who = where
    pixels = outer.views.pixels[t, v]  # (n, P, E, 2)
    target = context.views.pixels[t, v]
    if context.config.bias != BiasSection():
        target = target + pixel_offsets(context.sequence.joints, context.config.bias, context.rig)[t, v]
    target = target[:, :, anchors]  # (n, P, E, 2, 2)
    away = np.where(np.isin(error, _DISPLACED)[..., None], anchor - target[:, who], 0.0).mean(axis=-2)
    place = pixels[:, who] + away
    inverted = (error == KeypointError.INVERSION).any(axis=-1)
    place = np.where(inverted[..., None], pixels[:, who][:, _mirror(outer.skeleton)], place)
    swapped = (error == KeypointError.SWAP).any(axis=-1)
    if swapped.any():
        distance = np.linalg.norm(target - anchor[:, None], axis=-1).mean(axis=-1)  # (n, P, E)
        distance[:, who] = np.inf
        other = np.where(np.isfinite(distance), distance, np.inf).argmin(axis=1)
        there = np.take_along_axis(pixels, other[:, None, :, None], axis=1)[:, 0]
        place = np.where(swapped[..., None], there, place)
    return place


def _drawn(context: Context, outer: OuterTruth, anchors: Integers, who: int) -> tuple[Floats, Bools]:
    """Return the scatter (T, V, E, 2), units, of a person's outer joints, and which are dropped, (T, V, E)."""
    config, correlation = context.config.keypoints, context.config.correlation
    occlusion = occlusion_classes(outer.views.visibility[:, :, who])
    axes = image_axes(context.sequence.joints.mean(axis=2), context.rig)[:, :, who]
    scatter = Scatter(config, correlation, context.draws).of_joints(
        f"outer joints {who}", anchors[:, 0], occlusion, axes
    )
    by_occlusion = config.drop.visible, config.drop.self_occluded, config.drop.occluded
    table = np.array([shares.by_joint() for shares in by_occlusion])[:, anchors[:, 0]]
    share = table[np.where(occlusion == OUTSIDE, VISIBLE, occlusion), np.arange(len(anchors))]
    dropped = np.zeros(share.shape, bool)
    for limb in np.unique(anchors[:, 0]):
        joints = np.flatnonzero(anchors[:, 0] == limb)
        if share[..., joints].any():
            key = ("outer joints", "drop", who, COCO17.joints[limb])
            state = context.draws.states(*key, life=correlation.life, shared=correlation.views)
            dropped[..., joints] = state[..., None] < ndtri(share[..., joints])
    return scatter, dropped


def _sigmas(skeleton: Skeleton) -> Floats:
    return np.array(skeleton.sigmas)[rows_of(skeleton)[1]]


def _mirror(skeleton: Skeleton) -> Integers:
    """Return the left-right counterpart of each joint beyond COCO17, as an index among them, (E,)."""
    _, others = rows_of(skeleton)
    return np.array([int(np.flatnonzero(others == skeleton.mirror[row])[0]) for row in others])
