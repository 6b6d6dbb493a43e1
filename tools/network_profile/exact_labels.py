"""Labels of all joints of rendered scenes, against their exact truth: the input of the same sums as of a recording.

The scenes follow one another as the frames of one sample, with long gaps between them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17
from simharness.detector.detect import Detected
from simharness.detector.error_classes import classify
from simharness.detector.false_positives import MIN_JOINTS
from simharness.detector.reported import beyond_border, last_pixels
from simharness.detector.viewing_conditions import (
    OUTSIDE,
    VISIBLE,
    Conditions,
    image_axes,
    overlaps,
    pixel_offsets,
    trunk_depths,
)
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.association import Association
from simharness.reality.detector_fit.consensus import Consensus
from simharness.reality.detector_fit.joint_labels import LabelledJoints, bearing_bins, error_classes, expected_people
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS, BiasSection
from simharness.types.sequence import Sequence as PoseSequence
from simharness.types.truth import GOOD_BELOW, KeypointError
from simharness.types.views import Visibility
from tools.network_profile.profiled_scenes import ProfiledScene

_GAP = 1000.0  # seconds between scenes
_ON_DECOY = 0.3  # intersection over union of the boxes of a detection and of the decoy that it shows
_REACHES = (3.0, 2.0, *(3 * (GOOD_BELOW,)))  # units: keypoints beyond say nothing about the bias, by round
_ALWAYS = 0.9  # share of the joints in the picture that a detector of whole people reports
_JOINTS = len(COCO17)

Results = Sequence[Sequence[Detected]]
"""Detections of each scene in each of its frames."""


def label_scenes(
    scenes: Sequence[ProfiledScene], results: Results, *, kind: DetectorKind, bias: Floats
) -> LabelledJoints:
    """Label the joints of all people in scenes of the same number of cameras.

    Args:
        scenes: the scenes.
        results: the detections in each of them.
        kind: kind of the detector.
        bias: offset of its joints by kind, (9, 3) metres.

    Raises:
        ValueError: scenes of different numbers of cameras.
    """
    counts = sorted({len(scene.rig) for scene in scenes})
    if len(counts) != 1:
        raise ValueError(f"scenes of a profile need the same number of cameras, got {counts[0]} and {counts[-1]}")
    people = max(scene.views.pixels.shape[2] for scene in scenes)
    section, parts, start = bias_section(bias), [], 0.0
    for scene, frames in zip(scenes, results, strict=True):
        part = _labels(_padded(scene, people), frames, kind=kind, bias=section)
        parts.append(replace(part, time=part.time - part.time[0] + start))
        start = float(parts[-1].time[-1]) + _GAP
    joined: LabelledJoints = _joined(parts)
    return joined


def bias_section(bias: Floats) -> BiasSection:
    """Return the section of offsets by kind of joint, (9, 3) metres."""
    return BiasSection.model_validate({kind: row.tolist() for kind, row in zip(KINDS, bias, strict=True)})


def kind_of(scenes: Sequence[ProfiledScene]) -> DetectorKind:
    """Return the kind of a network: top-down where it reports nearly all joints of the people that it finds."""
    labels = label_scenes(scenes, [each.found for each in scenes], kind="top-down", bias=np.zeros((len(KINDS), 3)))
    n, k = labels.risk["drop"].sum(), labels.taken["drop"].sum()
    return "top-down" if k <= (1 - _ALWAYS) * n else "bottom-up"


def measure_bias(scenes: Sequence[ProfiledScene], results: Results) -> Floats:
    """Return the offset of the detector's joints from the anatomical ones by kind, (9, 3) metres, by least squares.

    The offsets are forward, outward and up in the body's frame; of good keypoints of visible
    joints.
    """
    bias, of_kind = np.zeros((len(KINDS), 3)), np.eye(len(KINDS))[list(KIND_OF_JOINT)]
    step = 0.01
    moves = [bias_section(np.tile(step * row, (len(KINDS), 1))) for row in np.eye(3)]
    slopes = [
        np.stack([pixel_offsets(scene.sequence.joints, move, scene.rig) / step for move in moves], axis=-1)
        for scene in scenes
    ]
    for reach in _REACHES:
        square, product = np.zeros((len(KINDS), 3, 3)), np.zeros((len(KINDS), 3))
        for scene, frames, slope in zip(scenes, results, slopes, strict=True):
            labels = _labels(scene, frames, kind="top-down", bias=bias_section(bias))
            with np.errstate(invalid="ignore", divide="ignore"):
                used = (labels.occlusion == VISIBLE) & ((labels.residual**2).sum(axis=-1) < reach**2)
                row = np.where(used[..., None, None], slope / labels.unit[..., None, None], 0.0)
            away = np.where(used[..., None], labels.residual, 0.0)
            square += np.einsum("tvpjax,tvpjay,jk->kxy", row, row, of_kind)
            product += np.einsum("tvpjax,tvpja,jk->kx", row, away, of_kind)
        bias = bias + np.linalg.solve(square + 1e-3 * np.eye(3), product[..., None])[..., 0]
    return bias


def shared_scatter(labels: LabelledJoints) -> float:
    """Return the share of the variance of good keypoints that is one displacement in space, the same for all views.

    The expected product of the displacements in two views is that share of the variance, times the products of their
    axes.
    """
    good = labels.risk["jitter"] & (labels.error == KeypointError.GOOD)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = np.where(good, (labels.residual**2).sum(axis=-1), 0.0).sum(axis=(0, 1, 2))
        usual = np.sqrt(square / good.sum(axis=(0, 1, 2)) / 2)
        away = np.where(good[..., None], labels.residual / usual[:, None], 0.0)
    observed = expected = 0.0
    for one in range(away.shape[1]):
        for other in range(one):
            turn = labels.axes[:, one] @ np.swapaxes(labels.axes[:, other], -1, -2)  # (T, P, 2, 2)
            turn = np.nan_to_num(turn)
            both = (good[:, one] & good[:, other])[..., None]
            product = np.einsum("tpjx,tpxy,tpjy->tpj", away[:, one], turn, away[:, other])
            observed += float(np.where(both[..., 0], product, 0.0).sum())
            expected += float((both[..., 0] * (turn**2).sum(axis=(-1, -2))[..., None]).sum())
    return float(np.clip(observed / expected, 0.0, 1.0)) if expected > 0 and np.isfinite(observed) else 0.0


def decoy_hits(scene: ProfiledScene, frames: Sequence[Detected]) -> tuple[Bools, Bools, list[Bools]]:
    """Return the decoys that could be detected, those that are, (T, V, D) each, and which detections show one, T."""
    decoys = scene.views.lookalikes
    possible = decoys.visible.sum(axis=-1) >= MIN_JOINTS
    seen = np.where(decoys.visible[..., None], decoys.pixels, np.nan)
    hits, shows = np.zeros_like(possible), []
    for t, each in enumerate(frames):
        false = each.truth.person < 0
        on = np.zeros(len(false), bool)
        for row in np.flatnonzero(false):
            view = int(each.detections.view[row])
            for decoy in np.flatnonzero(possible[t, view]):
                boxes = np.stack([_box(each.detections.keypoints[row]), _box(seen[t, view, decoy])])
                if overlaps(boxes)[0, 1] > _ON_DECOY:
                    hits[t, view, decoy] = on[row] = True
        shows.append(on)
    return possible, hits, shows


def _box(points: Floats) -> Floats:
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    return np.concatenate([low, high - low])


def _labels(
    scene: ProfiledScene, frames: Sequence[Detected], *, kind: DetectorKind, bias: BiasSection
) -> LabelledJoints:
    """Label the joints of one scene."""
    views, rig, sequence = scene.views, scene.rig, scene.sequence
    conditions = Conditions.of_views(views)
    association = _associated(scene, frames)
    target = views.pixels + (0.0 if bias == BiasSection() else pixel_offsets(sequence.joints, bias, rig))
    frame, view, _ = np.indices(conditions.neighbour.shape)
    neighbour = np.where(
        ((conditions.neighbour >= 0)[..., None] & (conditions.occlusion[frame, view, conditions.neighbour] != OUTSIDE))[
            ..., None
        ],
        target[frame, view, conditions.neighbour],
        np.nan,
    )
    known, inside = sequence.present, conditions.occlusion != OUTSIDE
    error = classify(association.keypoints, target, conditions.unit, other=neighbour)
    found = association.detected[..., None] & known[:, None, :, None] & inside
    classes = error_classes(
        error,
        association.keypoints,
        target,
        neighbour,
        conditions.unit,
        found=found,
        scores=association.scores,
        kind=kind,
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = (association.keypoints - target) / conditions.unit[..., None]
    nothing = np.zeros(known.shape + (_JOINTS,))
    time = sequence.time
    return LabelledJoints(
        time=time,
        step=float(np.diff(time).min(initial=np.inf)) if len(time) > 1 else 1.0,
        kind=kind,
        known=known,
        association=association,
        consensus=Consensus(
            sequence.joints, np.zeros(target.shape[:-1], bool), target, np.zeros(target.shape[:-1]), nothing, nothing
        ),
        boxes=views.boxes,
        unit=conditions.unit,
        target=target,
        occlusion=np.where(inside, conditions.occlusion, np.int8(VISIBLE)),
        bearing=bearing_bins(sequence.joints, rig),
        depth=trunk_depths(sequence.joints, rig),
        inside=inside & known[:, None, :, None],
        beyond=beyond_border(views.pixels, conditions.unit, last_pixels(rig)[:, None]),
        expected=expected_people(known, inside),
        error=error,
        risk=classes.risk,
        taken=classes.taken,
        chance=classes.chance,
        residual=np.where(classes.labelled[..., None], residual, np.nan),
        axes=image_axes(sequence.joints.mean(axis=2), rig),
    )


def _associated(scene: ProfiledScene, frames: Sequence[Detected]) -> Association:
    """Return the detection of each person, by their truth: the first of several, which has the highest score."""
    shape = scene.views.boxes.shape[:3]
    keypoints, scores = np.full((*shape, _JOINTS, 2), np.nan), np.zeros((*shape, _JOINTS))
    duplicates, false = np.zeros(shape, np.int64), np.zeros(shape[:2], np.int64)
    _, _, on_decoys = decoy_hits(scene, frames)
    false_scores: list[list[Floats]] = []
    for t, each in enumerate(frames):
        found, person = each.detections, each.truth.person
        for row in np.flatnonzero(person >= 0):
            where = t, int(found.view[row]), int(person[row])
            if (scores[where] > 0).any():
                duplicates[where] += 1
            else:
                keypoints[where], scores[where] = found.keypoints[row], found.scores[row]
        wrong = (person < 0) & ~on_decoys[t]
        np.add.at(false[t], found.view[wrong], 1)
        false_scores.append([found.scores[wrong & (found.view == view)] for view in range(shape[1])])
    most = int(false.max(initial=0))
    padded = np.zeros((*shape[:2], most, _JOINTS))
    for t, by_view in enumerate(false_scores):
        for view, values in enumerate(by_view):
            padded[t, view, : len(values)] = values
    nobody = np.zeros((shape[0], 0, _JOINTS, 3))
    return Association(
        keypoints, scores, duplicates, scene.sequence.joints, nobody, np.zeros_like(false), false, padded
    )


def _padded(scene: ProfiledScene, people: int) -> ProfiledScene:
    """Return the scene with absent people beside its own, ``people`` in all."""
    views, sequence = scene.views, scene.sequence
    more = people - len(sequence.ids)
    if more <= 0:
        return scene

    def pad(array: NDArray, axis: int, value: float) -> NDArray:
        width = [(0, more if each == axis else 0) for each in range(array.ndim)]
        return np.pad(array, width, constant_values=value)

    return replace(
        scene,
        sequence=PoseSequence(
            pad(sequence.landmarks, 1, 0.0), np.arange(people), sequence.time, pad(sequence.present, 1, False)
        ),
        views=replace(
            views,
            pixels=pad(views.pixels, 2, np.nan),
            visibility=pad(views.visibility, 2, Visibility.OUTSIDE),
            boxes=pad(views.boxes, 2, 0.0),
            area_visible=pad(views.area_visible, 2, 0),
        ),
    )


def _joined(parts: Sequence[Any]) -> Any:
    """Return labels, or parts of them, of several scenes as one, frame after frame."""
    first = parts[0]
    if isinstance(first, np.ndarray):
        most = np.max([each.shape for each in parts], axis=0)[1:]  # false detections are the only unequal axis
        return np.concatenate(
            [np.pad(a, [(0, 0), *((0, m - n) for m, n in zip(most, a.shape[1:], strict=True))]) for a in parts]
        )
    if isinstance(first, Mapping):
        return {key: _joined([each[key] for each in parts]) for key in first}
    if is_dataclass(first) and not isinstance(first, type):
        return replace(first, **{f.name: _joined([getattr(each, f.name) for each in parts]) for f in fields(first)})
    return first
