"""Assessment of one variant on one recording: scores, and tables by frame and by person.

Average precision (AP) is that of Panoptic (Tu et al., VoxelPose, ECCV 2020): the estimates of all frames are sorted by
descending score, and each is assigned to the nearest person of its frame. An estimate is correct if the mean joint
distance is under the threshold and no estimate with a higher score is correct for the same person. AP is the area under
the precision-recall curve, with each precision replaced by the highest precision at the same or a higher recall.
Differences from the evaluation released with VoxelPose: estimates with equal scores are added together, so that their
order does not matter; ghosts in frames without people count, while VoxelPose skips such frames; distances are over the
joints that both have; and no epsilon is added to denominators.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from mvpose import COCO17, Estimate
from mvpose.arrays import Floats, Integers
from mvpose.json_values import json_value
from simharness.scoring.catalogue import AP_MM, PCK_MM
from simharness.scoring.feet_and_hands import WholeBodyInput, whole_body_scores
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.joint_errors import joint_errors, pck, pck_area
from simharness.scoring.matching import GroupCounts, PairCounts, count_groups, count_pairs, count_violations
from simharness.scoring.pairing import mean_where_shared, placed_joints
from simharness.scoring.pcp import Part
from simharness.scoring.score_registry import ScoreInput, compute_scores, in_percent, statistic
from simharness.scoring.score_summary import STAGES, VariantScores
from simharness.types.recording import Recording
from simharness.types.views import Visibility

Scores = dict[str, float | None]
_PAIR_COLUMNS = ("pairs_correct", "pairs_wrong", "pairs_lost")
_SEEN_OR_SELF_OCCLUDED = (Visibility.VISIBLE, Visibility.SELF_OCCLUDED)


@dataclass(frozen=True)
class Assessment:
    """Scores and tables of one variant on one recording."""

    scores: Scores
    """All of :data:`simharness.scoring.catalogue.SCORES` except those of failures, in that order; None where a score
    does not apply."""
    frames: pl.DataFrame
    """a row for each frame: ``frame``, ``time`` (s); ``people``, ``estimates``, ``found``, ``missed``, ``ghosts``;
    ``pcp`` (percent), ``mpjpe_mm``; ``pairs_correct``, ``pairs_wrong``, ``pairs_lost``, ``violations``, ``merged``,
    ``split``; ``phantoms`` and the number of them that were ``admitted``; and ``time_affinity_ms``,
    ``time_matching_ms``, ``time_reconstruction_ms``, ``time_ms``. Null, never NaN, where a column does not apply."""
    people: pl.DataFrame
    """a row for each frame and true person present in it: ``frame``, ``person``; ``found``, ``error_mm`` (mean over
    joints), ``pcp`` (percent); ``worst_joint``, the name of the estimated joint with the largest error, and that error,
    ``worst_mm``; ``visible_views``, the number of views in which at least half of the joints are visible or
    self-occluded. Errors are null where the person is missed."""
    errors: Floats
    """Errors of all joints of all true people, (T, P, 17), metres: infinite where the estimate is missing, NaN where
    the truth is. Input of :func:`simharness.scoring.joint_errors.pck`."""
    variant_scores: VariantScores
    """Scores of every frame, for summaries."""


def assess(recording: Recording, estimates: Sequence[Estimate], *, whole: WholeBodyInput | None = None) -> Assessment:
    """Score one variant on a recording, with the true joints at the times of the estimates where they have times.

    Args:
        recording: the input of the variant, and the truth.
        estimates: estimates of the variant, one for each frame.
        whole: true and estimated people with feet and hands, where there are any.

    Raises:
        ValueError: another number of estimates than frames, or labels that do not fit the frame's detections.
    """
    if len(estimates) != len(recording):
        raise ValueError(f"a recording of {len(recording)} frames needs as many estimates, got {len(estimates)}")
    recording = recording.at_times_of(estimates)
    variant = score_variant(recording, estimates)
    summary = variant.summary()
    groups = _groups(recording, estimates)
    truth = np.stack([true.joints for true in recording.truth])
    partner = variant.frames.partner
    placed = np.stack([placed_joints(row, each.joints) for row, each in zip(partner, estimates, strict=True)])
    errors = joint_errors(truth, placed)
    scores = (
        _people_scores(summary)
        | _joint_scores(errors)
        | _precision_scores(truth, estimates)
        | _pck_scores(errors)
        | compute_scores(ScoreInput(recording, tuple(estimates), truth, placed, partner))
        | whole_body_scores(whole, partner)
        | _picture_scores(recording, placed)
        | _matching_scores(summary, groups)
        | _time_scores(summary)
    )
    return Assessment(
        scores, _frame_table(recording, variant, groups), _people_table(recording, variant, errors), errors, variant
    )


def score_variant(recording: Recording, estimates: Sequence[Estimate]) -> VariantScores:
    """Score every frame; ``summary.json`` is made from the result."""
    truth = np.stack([true.joints for true in recording.truth])
    frames = score_frames(truth, [each.joints for each in estimates], matching=_pairs(recording, estimates))
    return VariantScores(frames, tuple(estimate.timings for estimate in estimates))


def reprojection_errors(recording: Recording, placed: Floats) -> tuple[Floats, Floats]:
    """Return the distances of reprojected estimates and of detections from the true pixels.

    Dong et al. (CVPR 2019, section 4.4) report that estimates projected back into the views are much more accurate than
    the detections. Both are compared with the true pixel at the same joints: every detected keypoint of a person with
    an estimate, where the joint is visible. If a person is detected twice in a view, both detections are compared.

    True pixels are projected with the true rig, and estimates with the believed rig: a wrong calibration is part of
    their error, as it is in an overlay on the pictures.

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


def _labels(recording: Recording, estimates: Sequence[Estimate]) -> list[Integers] | None:
    """Return the labels of every frame; None if the method gives no labels for the detections of some frame."""
    counts = list(map(len, recording.detections))
    matchings = [estimate.matching for estimate in estimates]
    if not all(matching.covers(count) for matching, count in zip(matchings, counts, strict=True)):
        return None
    return [matching.labels_of(count) for matching, count in zip(matchings, counts, strict=True)]


def _pairs(recording: Recording, estimates: Sequence[Estimate]) -> list[PairCounts] | None:
    """Count the pairs of detections of every frame; None if there are no labels."""
    labels = _labels(recording, estimates)
    if labels is None:
        return None
    frames = zip(recording.detections, labels, recording.truth, strict=True)
    return [count_pairs(detections.view, label, truth.person) for detections, label, truth in frames]


def _groups(recording: Recording, estimates: Sequence[Estimate]) -> tuple[list[GroupCounts], list[int]] | None:
    """Count the groups and the violations of every frame; None if there are no labels."""
    labels = _labels(recording, estimates)
    if labels is None:
        return None
    views = [detections.view for detections in recording.detections]
    people = [true.person for true in recording.truth]
    return list(map(count_groups, views, labels, people)), list(map(count_violations, views, labels))


def _people_scores(summary: Mapping[str, Any]) -> Scores:
    return {
        "pcp": summary["pcp"],
        **{f"pcp_{group}": value for group, value in summary["pcp_parts"].items()},
        "recall": in_percent(summary["recall"]),
        "precision": in_percent(summary["precision"]),
        "ghosts": summary["ghosts_per_frame"],
        "missed": summary["missed_per_frame"],
        "mpjpe_mm": summary["mpjpe_mm"]["mean"],
        "mpjpe_median_mm": summary["mpjpe_mm"]["median"],
    }


def _joint_scores(errors: Floats) -> Scores:
    return {
        f"mpjpe_{joint}_mm": statistic(np.mean, 1000.0 * errors[..., index])
        for index, joint in enumerate(COCO17.joints)
    }


def _precision_scores(truth: Floats, estimates: Sequence[Estimate]) -> Scores:
    frame = np.repeat(np.arange(len(estimates)), [len(estimate) for estimate in estimates])
    joints = np.concatenate([estimate.joints for estimate in estimates])
    score = np.concatenate([estimate.scores.mean(axis=1) for estimate in estimates])
    person, distance = nearest_people(truth, joints, frame)
    people = int(np.isfinite(truth).all(axis=-1).any(axis=-1).sum())
    found = {
        f"ap{limit}": average_precision(person, distance, score, people=people, threshold=limit / 1000.0)
        for limit in AP_MM
    }
    return {**found, "map": statistic(np.mean, np.array(list(found.values()), float))}


def _pck_scores(errors: Floats) -> Scores:
    curve = pck(errors, np.array(PCK_MM) / 1000.0)
    shares = {f"pck{limit}": share for limit, share in zip(PCK_MM, curve.tolist(), strict=True)}
    return json_value({**shares, "pck_auc": pck_area(errors, PCK_MM[-1] / 1000.0)})


def _picture_scores(recording: Recording, placed: Floats) -> Scores:
    # Medians, because a single joint close to a lens has an error that dominates the mean.
    estimate, detection = reprojection_errors(recording, placed)
    return {"reprojection_px": statistic(np.median, estimate), "detection_px": statistic(np.median, detection)}


def _matching_scores(summary: Mapping[str, Any], counted: tuple[list[GroupCounts], list[int]] | None) -> Scores:
    pairs = {f"match_{key}": in_percent(share) for key, share in summary["matching"].items()}
    if counted is None:
        return pairs | dict.fromkeys(("violations", "merged", "split", "phantoms_admitted", "phantoms_pruned"))
    groups, violations = counted
    phantoms, admitted = (sum(getattr(each, key) for each in groups) for key in ("phantoms", "admitted"))
    return {
        **pairs,
        "violations": sum(violations) / len(groups),
        "merged": sum(each.merged for each in groups) / len(groups),
        "split": sum(each.split for each in groups) / len(groups),
        "phantoms_admitted": 100.0 * admitted / phantoms if phantoms else None,
        "phantoms_pruned": 100.0 - 100.0 * admitted / phantoms if phantoms else None,
    }


def _time_scores(summary: Mapping[str, Any]) -> Scores:
    timings = summary["timings_ms"]
    medians = {_time_column(stage): timings[stage]["median"] for stage in STAGES}
    return {**medians, "time_p99_ms": timings["total"]["p99"]}


def _time_column(stage: str) -> str:
    return "time_ms" if stage == "total" else f"time_{stage}_ms"


def _frame_table(
    recording: Recording, variant: VariantScores, counted: tuple[list[GroupCounts], list[int]] | None
) -> pl.DataFrame:
    columns = variant.frames.columns()
    del columns["errors_mm"], columns["parts"]  # they are in the table of people
    nothing: list[None] = [None] * len(recording)
    groups, violations = counted or (nothing, nothing)
    columns = {"frame": list(range(len(recording))), "time": recording.time.tolist(), **columns}
    columns["violations"] = list(violations)
    for key in ("merged", "split", "phantoms", "admitted"):
        columns[key] = [getattr(group, key, None) for group in groups]
    for stage in STAGES:
        columns[_time_column(stage)] = [1000.0 * each[stage] if stage in each else None for each in variant.timings]
    types: dict[str, Any] = dict.fromkeys(("pcp", "mpjpe_mm", *map(_time_column, STAGES)), pl.Float64)
    types |= dict.fromkeys((*_PAIR_COLUMNS, "violations", "merged", "split", "phantoms", "admitted"), pl.Int64)
    return pl.DataFrame(columns, schema_overrides=types)


def _people_table(recording: Recording, variant: VariantScores, errors: Floats) -> pl.DataFrame:
    scored = variant.frames
    frame, person = np.nonzero(scored.present)
    parts = scored.parts[frame, person]
    counted = (parts != Part.UNDEFINED).sum(axis=1)
    error = errors[frame, person]
    finite = np.where(np.isfinite(error), error, -1.0)
    worst = finite.argmax(axis=1)
    known = finite.max(axis=1) >= 0
    visibility = np.stack([truth.visibility for truth in recording.truth])
    half_visible = np.isin(visibility, _SEEN_OR_SELF_OCCLUDED).mean(axis=-1) >= 0.5
    columns: dict[str, Any] = {
        "frame": frame,
        "person": person,
        "found": scored.found[frame, person],
        "error_mm": 1000.0 * scored.error[frame, person],
        "pcp": np.where(counted > 0, 100.0 * (parts == Part.CORRECT).sum(axis=1) / np.maximum(counted, 1), np.nan),
        "worst_joint": np.where(known, worst, -1),
        "worst_mm": np.where(known, 1000.0 * finite.max(axis=1), np.nan),
        "visible_views": half_visible.sum(axis=1)[frame, person],
    }
    names: Mapping[int, str] = dict(enumerate(COCO17.joints))
    return pl.DataFrame(columns).with_columns(
        pl.col("error_mm", "pcp", "worst_mm").fill_nan(None),
        pl.col("worst_joint").replace_strict(names, default=None, return_dtype=pl.String),
    )


def nearest_people(truth: Floats, estimate: Floats, frame: Integers) -> tuple[Integers, Floats]:
    """Find the true person nearest to each estimate.

    Args:
        truth: true joints, (T, P, J, 3), metres; NaN where undefined.
        estimate: joints of the estimates of all frames, (k, J, 3), metres; NaN where missing.
        frame: frame of each estimate, (k,).

    Returns:
        Index of the person among the T x P people of all frames, (k,), and mean distance over the joints that both
        have, (k,), metres. If no person shares a joint, the distance is infinite and the index arbitrary.
    """
    people = truth.shape[1]
    if not people:
        return np.zeros(len(frame), np.int64), np.full(len(frame), np.inf)
    distance = mean_where_shared(np.linalg.norm(truth[frame] - estimate[:, None], axis=-1))  # (k, P)
    nearest = distance.argmin(axis=1)
    return frame * people + nearest, distance[np.arange(len(frame)), nearest]


def average_precision(
    person: ArrayLike, distance: ArrayLike, score: ArrayLike, *, people: int, threshold: float
) -> float | None:
    """Return AP at one threshold, percent; None without true people.

    Args:
        person: person nearest to each estimate, (k,), an index that is unique over all frames.
        distance: distance from that person, (k,).
        score: confidence of each estimate, (k,).
        people: number of true people in all frames.
        threshold: distance under which an estimate can be correct, in the unit of the distances.
    """
    if not people:
        return None
    person, distance, score = np.asarray(person), np.asarray(distance), np.asarray(score)
    order = np.argsort(-score)
    near = order[distance[order] < threshold]
    correct = np.zeros(len(order), bool)
    correct[near[np.unique(person[near], return_index=True)[1]]] = True
    true_positives = np.cumsum(correct[order])
    last = np.flatnonzero(np.diff(score[order], append=np.inf))  # last of each run of equal scores
    precision = np.maximum.accumulate((true_positives[last] / (last + 1))[::-1])[::-1]
    recall_gain = np.diff(true_positives[last], prepend=0) / people
    return 100.0 * float((recall_gain * precision).sum())
