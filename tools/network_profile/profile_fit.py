"""Fit of a detector profile to a network on rendered scenes, whose truth is exact.

The sums and the parameters are those of a fit to a recording. Their values are where a simulated detector in the same
scenes is measured as the network is (:mod:`simharness.reality.detector_fit.inference`): a share of
errors among hidden joints, for example, follows from guesses, whose errors depend on the pose.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from simharness.detector.score_distance import USUAL
from simharness.detector.viewing_conditions import BOX_SHARE, VISIBLE, Conditions
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.detector_measurement import (
    MeasuredDetector,
    MeasuredValue,
    label_estimates,
    measure_labels,
)
from simharness.reality.detector_fit.inference import SCALES, Scales, infer
from simharness.reality.detector_fit.joint_labels import LabelledJoints
from simharness.reality.detector_fit.profile import as_toml, settings
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS, DetectorSection
from simharness.types.random_streams import stream
from simharness.types.truth import MISS_FROM, KeypointError
from tools.network_profile.error_curves import error_curves, neighbour_distance
from tools.network_profile.exact_labels import Results, decoy_hits, kind_of, label_scenes, measure_bias, shared_scatter
from tools.network_profile.profiled_scenes import ProfiledScene

ROUNDS = 6
"""Simulations of all scenes before slopes are found, and after."""

_FEWEST = 60  # joints or people behind a value that is calibrated
_RESAMPLES = 200
_PRIOR = 100.0  # joints of each bearing that count as usual
_WITHIN = 0.9  # share of misses that are not stray
_SMALL = 64.0  # pixels, sqrt(area) of a person, as in the error model
_SCALES: Scales = {
    "logit": (
        *(*SCALES["logit"], "keypoints.drop", "correlation.views", "correlation.gross_views", "correlation.limb"),
        *("correlation.scatter_near", "correlation.scatter_views", "boxes.missed", "boxes.duplicates", "boxes.score"),
        *("decoys.share", "decoys.consistent"),
    ),
    "log": (
        *(*SCALES["log"], "boxes.jitter", "phantoms.life", "keypoints.truncated", "keypoints.small", "scores.slope"),
        *("keypoints.guess.scatter", "keypoints.inversion_bearing", "keypoints.swap_reach"),
    ),
}
"""Inferred parameters; correlations are measured without a consensus, and are shares."""

SIMULATIONS = 2 * ROUNDS + sum(map(len, _SCALES.values()))
"""Simulations of all scenes, about."""


@dataclass(frozen=True)
class NetworkProfile:
    """Fitted profile of a network."""

    name: str
    """Name of the profile."""
    scenes: tuple[ProfiledScene, ...]
    """The scenes that it is fitted to."""
    bias: Floats
    """Offset of the network's joints by kind, (9, 3) metres."""
    measured: MeasuredDetector
    """Measurement of the network."""
    labels: LabelledJoints
    """Labels of the network."""
    simulated: LabelledJoints
    """Labels of a simulated detector with the profile, in the same scenes."""
    detector: DetectorSection
    """The profile."""
    text: str
    """The profile as a file."""

    @property
    def kind(self) -> DetectorKind:
        """Kind of the network."""
        return self.measured.kind


def fit_network(
    scenes: Sequence[ProfiledScene],
    *,
    name: str,
    command: str = "",
    rounds: int = ROUNDS,
    progress: Callable[[int], None] = lambda simulations: None,
) -> NetworkProfile:
    """Fit a profile to what a network finds in scenes.

    Args:
        scenes: the scenes.
        name: name of the profile.
        command: command that made the profile, to be written into its file.
        rounds: simulations before slopes are found, and after.
        progress: called with 1 after each simulation.

    Raises:
        ValueError: the network finds nobody, or the scenes have different numbers of cameras.
    """
    found = [scene.found for scene in scenes]
    kind = kind_of(scenes)
    bias = measure_bias(scenes, found)
    labels = label_scenes(scenes, found, kind=kind, bias=bias)
    if not labels.association.detected.any():
        raise ValueError(f"{name}: finds nobody in {labels.boxes[..., 0, 0].size} pictures; is it a network of poses?")
    weights = _resampled_scenes(labels.time, [len(each) for each in found])
    measured = measure_labels(labels, name=name, weights=weights, independent=len(scenes))
    more = {
        key: MeasuredValue(*each[:1], np.nan, np.nan, each[1]) for key, each in _more(scenes, found, labels).items()
    }
    measured = replace(measured, values={**measured.values, **more})

    def measure(values: Mapping[str, float], draw: int) -> dict[str, float]:
        detector = DetectorSection.model_validate(settings(measured.with_values(values), name=name, bias=bias))
        found = _simulated_values(scenes, detector, draw, kind=kind, bias=bias)
        progress(1)
        return found

    known = {key: each for key, each in measured.values.items() if each.count >= _FEWEST}
    rare = {key: each for key, each in measured.values.items() if key not in known}
    others = {key: each.value for key, each in rare.items()}
    # The truth is exact: what is measured is near the parameter.
    fitted = infer(
        known,
        lambda values, draw: measure({**values, **others}, draw),
        {key: each.value for key, each in known.items()},
        rounds=rounds,
        scales=_SCALES,
    )
    calibrated = replace(measured, values={**fitted, **rare})
    detector = DetectorSection.model_validate(settings(calibrated, name=name, bias=bias))
    text = as_toml(calibrated, name=name, bias=bias, command=command, notes="network", of="people whose truth is exact")
    simulated = label_scenes(scenes, [scene.simulated(detector) for scene in scenes], kind=kind, bias=bias)
    return NetworkProfile(name, tuple(scenes), bias, measured, labels, simulated, detector, text)


def _simulated_values(
    scenes: Sequence[ProfiledScene], detector: DetectorSection, draw: int, *, kind: DetectorKind, bias: Floats
) -> dict[str, float]:
    """Return the measured values of a simulated detector in the scenes."""
    results = [scene.simulated(detector, draw=draw) for scene in scenes]
    labels = label_scenes(scenes, results, kind=kind, bias=bias)
    return {**label_estimates(labels), **{key: each[0] for key, each in _more(scenes, results, labels).items()}}


def _resampled_scenes(time: Floats, frames: Sequence[int]) -> Floats:
    """Return how many times each resample of whole scenes contains each frame, (R, T)."""
    chosen = stream(0, "profile scenes").integers(len(frames), size=(_RESAMPLES, len(frames)))
    counts = np.stack([np.bincount(row, minlength=len(frames)) for row in chosen])
    weights = np.repeat(counts, frames, axis=1).astype(float)
    assert weights.shape[1] == len(time)
    return weights


def _more(scenes: Sequence[ProfiledScene], results: Results, labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return values beside those of a recording, and the number of joints, people or decoys behind each."""
    return {
        "correlation.scatter_views": (shared_scatter(labels), int(labels.risk["jitter"].sum())),
        **_guess_scatter(labels),
        **_inversion_bearing(labels),
        **_swap_reach(labels),
        **_score_slope(labels),
        **_class_scores(labels),
        **_miss_reach(labels),
        **_size_and_border(scenes, labels),
        **_boxes(scenes, results),
        **_decoys(scenes, results),
    }


def _guess_scatter(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return by how much hidden joints that are misses are beyond 2.35 units, the median of each kind.

    Kinds of which few are hidden have that of all. With the share of misses it tells how many hidden joints are guessed
    from how far off guesses are.
    """
    hidden = labels.taken["miss"] & (labels.occlusion != VISIBLE)
    beyond = np.linalg.norm(labels.residual, axis=-1) - MISS_FROM
    kinds = np.broadcast_to(np.array(KIND_OF_JOINT), hidden.shape)
    pooled = float(np.median(beyond[hidden])) if hidden.any() else np.nan
    result = {}
    for index, kind in enumerate(KINDS):
        of_kind = beyond[hidden & (kinds == index)]
        value = float(np.median(of_kind)) if len(of_kind) >= _FEWEST else pooled
        result[f"keypoints.guess.scatter.{kind}"] = value, max(len(of_kind), min(int(hidden.sum()), _FEWEST))
    return result


def _inversion_bearing(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return by how much more frequent inversions of limbs are at each bearing than on average."""
    curve = error_curves(labels)["inversion by bearing"].counts
    side = np.minimum(np.arange(len(BEARINGS)), len(BEARINGS) - np.arange(len(BEARINGS)))
    fine = np.array([np.bincount(side, each) for each in curve])
    n, k = fine[:, ::2] + (np.pad(fine[:, 1::2], ((0, 0), (1, 0))) + np.pad(fine[:, 1::2], ((0, 0), (0, 1)))) / 2
    usual = k.sum() / max(n.sum(), 1.0)
    share = (k + _PRIOR * usual) / (n + _PRIOR)
    factor = share * n.sum() / max((share * n).sum(), 1e-9) if usual else np.ones(len(n))
    return {
        f"keypoints.inversion_bearing.{index}": (float(each), int(count))
        for index, (each, count) in enumerate(zip(factor, n, strict=True))
    }


def _swap_reach(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return the distance of the neighbour's joint at which swaps are 1 / e as frequent, from their mean distance."""
    risk, taken = labels.risk["swap"], labels.taken["swap"]
    near = neighbour_distance(labels)
    known = risk & np.isfinite(near)
    if (taken & known).sum() < _FEWEST:
        return {}
    # The mean distance of swaps rises with the reach, from near joints alone to that of all joints.
    far, mean = near[known], float(near[taken & known].mean())
    reaches = np.geomspace(0.02, 5.0, 80)
    means = [float(np.average(far, weights=np.exp(-far / reach))) for reach in reaches]
    return {"keypoints.swap_reach": (float(np.interp(mean, means, reaches)), int(known.sum()))}


def _score_slope(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return the fall of the logits of scores with ln(1 + distance) within class, kind and visibility of joints."""
    used = np.isin(labels.error, tuple(USUAL)) & np.isfinite(labels.residual[..., 0])
    used[..., : LIMB_JOINTS[0]] = False
    kinds = np.broadcast_to(np.array(KIND_OF_JOINT), used.shape)[used]
    cell = (labels.error[used] * 4 + labels.occlusion[used]) * len(KINDS) + kinds
    score = np.clip(labels.association.scores[used], 1e-3, 1 - 1e-3)
    values = np.stack([np.log(score / (1 - score)), np.log1p(np.linalg.norm(labels.residual[used], axis=-1))])
    count = np.maximum(np.bincount(cell), 1)
    logit, far = (each - (np.bincount(cell, each) / count)[cell] for each in values)
    square = float((far**2).sum())
    return {"scores.slope": (max(float(-(far * logit).sum() / square), 0.0) if square else np.nan, int(used.sum()))}


def _class_scores(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return the median scores of visible limb joints by class, and the factors of those that are not visible.

    Misses with the scores of good keypoints are distinguished from others by the slope, not by a share.
    """
    error, seen = labels.error[..., LIMB_JOINTS], (labels.occlusion == VISIBLE)[..., LIMB_JOINTS]
    known = np.isfinite(labels.residual[..., LIMB_JOINTS, 0])
    scores = labels.association.scores[..., LIMB_JOINTS]
    result = {"scores.overconfident": (0.0, 0), "scores.underconfident": (0.0, 0)}
    for kind in KeypointError:
        shown, hidden = (scores[known & (error == kind) & where] for where in (seen, ~seen))
        if kind != KeypointError.ABSENT and len(shown):
            name, usual = kind.name.lower(), float(np.median(shown))
            result[f"scores.{name}"] = usual, len(shown)
            if len(hidden):
                factor = min(float(np.median(hidden)) / max(usual, 1e-6), 1.0)
                result[f"scores.hidden.{name}"] = factor, len(hidden)
    return result


def _miss_reach(labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return the distance within which most misses of visible limbs are, units, and their mean on the way by kind."""
    miss = labels.taken["miss"] & (labels.occlusion == VISIBLE)
    far = np.linalg.norm(labels.residual[miss], axis=-1)
    kinds = np.broadcast_to(np.array(KIND_OF_JOINT), miss.shape)[miss]
    limbs = far[kinds >= KIND_OF_JOINT[LIMB_JOINTS[0]]]
    if len(limbs) < _FEWEST:
        return {}
    reach = float(np.clip(np.quantile(limbs, _WITHIN), 1.5 * MISS_FROM, 20.0))
    result = {"keypoints.reach": (reach, len(far))}
    way = np.clip((far - MISS_FROM) / (reach - MISS_FROM), 0.0, 1.0)
    usual = float(way.mean())
    for index in np.unique(kinds):
        of_kind = way[kinds == index]
        value = (of_kind.sum() + _FEWEST * usual) / (len(of_kind) + _FEWEST)
        result[f"keypoints.miss_mean.{KINDS[index]}"] = float(value), len(of_kind) + _FEWEST
    return result


def _size_and_border(scenes: Sequence[ProfiledScene], labels: LabelledJoints) -> dict[str, tuple[float, int]]:
    """Return by how much wrong joints are more frequent where the border cuts a person, and where people are small."""
    seen = labels.risk["miss"] & (labels.occlusion == VISIBLE)
    seen[..., : LIMB_JOINTS[0]] = False
    wrong = seen & (labels.taken["miss"] | labels.taken["jitter"])
    size = np.sqrt(np.maximum(BOX_SHARE * labels.boxes[..., 2] * labels.boxes[..., 3], 1.0))
    cut = np.zeros(size.shape, bool)
    start = 0
    for scene in scenes:
        here = Conditions.of_views(scene.views).cut
        cut[start : start + len(here), :, : here.shape[2]] = here
        start += len(here)
    small = size < _SMALL

    def share(where: Any) -> tuple[float, int]:
        n = int(seen[where].sum())
        return (float(wrong[where].sum() / n) if n else np.nan), n

    whole, of_cut, of_small = share(~cut & ~small), share(cut & ~small), share(~cut & small)
    usual = whole[0] or np.nan
    exponent = np.nan
    if of_small[0] > 0:
        exponent = float(np.log(of_small[0] / usual) / np.mean(np.log(_SMALL / size[small & ~cut])))
    return {
        "keypoints.truncated": (of_cut[0] / usual, of_cut[1]),
        "keypoints.small": (float(np.clip(exponent, 0.0, 5.0)), of_small[1]),
    }


def _boxes(scenes: Sequence[ProfiledScene], results: Results) -> dict[str, tuple[float, int]]:
    """Return the noise and the scores of the boxes of wholly visible people."""
    sides, scores = [np.zeros((0, 4))], [np.zeros(0)]
    for _, frames in zip(scenes, results, strict=True):
        for each in frames:
            truth, found = each.truth, each.detections
            shown = np.flatnonzero(truth.person >= 0)
            view, person = found.view[shown], truth.person[shown]
            rows = (truth.visibility[view, person] <= 1).all(axis=-1)
            shown, box = shown[rows], truth.boxes[view[rows], person[rows]]
            low, size = found.boxes[shown, :2], found.boxes[shown, 2:]
            away = np.concatenate([low - box[:, :2], low + size - box[:, :2] - box[:, 2:]], axis=1)
            sides.append(away / np.tile(np.maximum(box[:, 2:], 1.0), 2))
            scores.append(found.box_scores[shown])
    side, score = np.concatenate(sides), np.clip(np.concatenate(scores), 1e-3, 1 - 1e-3)
    if not len(score):
        return {}
    logit = np.log(score / (1 - score))
    return {
        "boxes.jitter": (float(np.clip(np.median(np.abs(side)) / 0.6745, 0.0, 0.4)), len(score)),
        "boxes.score": (float(1 / (1 + np.exp(-np.median(logit)))), len(score)),
        "boxes.deviation": (float(np.subtract(*np.quantile(logit, [0.75, 0.25])) / 1.349), len(score)),
    }


def _decoys(scenes: Sequence[ProfiledScene], results: Results) -> dict[str, tuple[float, int]]:
    """Return the share of decoys that are detected, how long that lasts, and the scores of their keypoints."""
    n = k = again = steps = 0
    scores = [np.zeros(0)]
    step = np.inf
    for scene, frames in zip(scenes, results, strict=True):
        if not scene.views.lookalikes.names:
            continue
        possible, hits, shows = decoy_hits(scene, frames)
        n, k = n + int(possible.sum()), k + int(hits.sum())
        for one, other in pairwise(range(len(hits))):
            both = hits[one] & possible[other]
            again, steps = again + int((both & hits[other]).sum()), steps + int(both.sum())
        scores += [each.detections.scores[on].ravel() for each, on in zip(frames, shows, strict=True)]
        step = float(np.diff(scene.sequence.time).min(initial=np.inf))
    score = np.concatenate(scores)
    score = np.clip(score[score > 0], 1e-3, 1 - 1e-3)
    if not n or not k:
        return {"decoys.share": (0.0, n)} if n else {}
    logit, share = np.log(score / (1 - score)), k / n
    kept = np.clip((again / max(steps, 1) - share) / max(1 - share, 1e-9), 0.01, 0.99)
    return {
        "decoys.share": (share, n),
        "decoys.life": (float(-step / np.log(kept)), steps),
        "decoys.score": (float(1 / (1 + np.exp(-np.median(logit)))), k),
        "decoys.deviation": (float(np.subtract(*np.quantile(logit, [0.75, 0.25])) / 1.349), k),
    }
