"""Sums of each frame from which all parameters are estimated: a bootstrap resample costs one matrix product."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from simharness.detector.conditions import OCCLUDED, SELF_OCCLUDED, VISIBLE
from simharness.detector.draws import LIMB_OF_JOINT
from simharness.reality.detector_fit.joint_labels import CLASSES, LabelledJoints
from simharness.reality.detector_fit.sample import LIMB_JOINTS
from simharness.reality.detector_fit.tetrachoric import correlation_grid, joint_probability
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS, Keypoints
from simharness.types.truth import MISS_FROM, KeypointError

FrameSums = dict[str, Floats]

REACH = 1.15 * float(Keypoints().reach)
"""Distance, in units, from which a miss is a stray: the reach of misses and 15 % for errors of the unit."""

LOGITS = np.linspace(-5.0, 5.0, 101)
"""Edges of the histograms of scores, on the logit scale."""

SCORED = ("good", "jitter", "miss", "inversion", "swap", "unknown")
"""Classes with histograms of scores: those of KeypointError, and joints whose truth is unknown."""

OCCLUSIONS = (VISIBLE, SELF_OCCLUDED, OCCLUDED)

TERCILES = ("small", "medium", "large")

_OF_KIND = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
_LONGEST = 1.0  # seconds, longest lag: beyond it, differences between people dominate
_LAGS = 8
_CELLS = 12  # in each direction, of the grid on a person's box


def lags(step: float) -> NDArray[np.int64]:
    """Return the lags of autocorrelations, (L,) frames: from 1 to one second, geometrically spaced."""
    return np.unique(np.geomspace(1, max(1.0, round(_LONGEST / step)), _LAGS).round().astype(np.int64))


def frame_sums(labels: LabelledJoints) -> FrameSums:
    """Return the sums of each frame, by name; the first axis of every array is T."""
    sums = {
        **_shares(labels),
        **_sizes(labels),
        **_misses(labels),
        **_scatter(labels),
        **_dependence(labels),
        **_scores(labels),
        **_people(labels),
    }
    sums["bias.A"], sums["bias.b"] = labels.normal
    return sums


def _by_kind(values: NDArray) -> Floats:
    """Return sums (T, 9) by kind of joint of values (T, V, P, 17)."""
    return values.sum(axis=(1, 2), dtype=float) @ _OF_KIND


def _by_occlusion(values: Bools, labels: LabelledJoints) -> Floats:
    """Return sums by occlusion class and kind of joint, (T, 3, 9)."""
    return np.stack([_by_kind(values & (labels.occlusion == occlusion)) for occlusion in OCCLUSIONS], axis=1)


def _shares(labels: LabelledJoints) -> FrameSums:
    """Return the joints each class could have taken (``n.``) and took (``k.``), by occlusion class, (T, 3, 9).

    The number of misses that look like inversions and swaps by chance is subtracted from these and added to misses.
    """
    n = {key: _by_occlusion(labels.risk[key], labels) for key in CLASSES}
    k = {key: _by_occlusion(labels.taken[key], labels) for key in CLASSES}
    for key, chance in labels.chance.items():
        by_chance = _by_occlusion(chance, labels)
        k[key] -= by_chance
        n["miss"] += by_chance
        k["miss"] += by_chance
    return {f"n.{key}": n[key] for key in CLASSES} | {f"k.{key}": k[key] for key in CLASSES}


def _sizes(labels: LabelledJoints) -> FrameSums:
    """Return limb joints that are reported and not good, and dropped ones, by tercile of the person's size, (T, 3)."""
    size = np.sqrt(labels.boxes[..., 2] * labels.boxes[..., 3])
    present = labels.association.detected
    third = (
        np.digitize(size, np.quantile(size[present], [1 / 3, 2 / 3])) if present.any() else np.zeros(size.shape, int)
    )
    reported, wrong = labels.risk["swap"] | labels.risk["miss"] | labels.risk["jitter"], _wrong(labels)
    result: dict[str, list[Floats]] = {"size.n": [], "size.k": [], "size.drop.n": [], "size.drop.k": []}
    for index in range(len(TERCILES)):
        in_third = (third == index)[..., None]
        for key, what in (
            ("size.n", reported),
            ("size.k", wrong),
            ("size.drop.n", labels.risk["drop"]),
            ("size.drop.k", labels.taken["drop"]),
        ):
            result[key].append((what & in_third)[..., LIMB_JOINTS].sum(axis=(1, 2, 3)))
    return {key: np.stack(each, axis=1).astype(float) for key, each in result.items()}


def _wrong(labels: LabelledJoints) -> Bools:
    """Return the joints that are reported and not good, (T, V, P, 17)."""
    return labels.taken["swap"] | labels.taken["inversion"] | labels.taken["miss"] | labels.taken["jitter"]


def _misses(labels: LabelledJoints) -> FrameSums:
    """Return misses, those beyond REACH, and the shares of the boxes beyond 2.35 and beyond REACH, (T,)."""
    miss = labels.taken["miss"]
    far = np.where(miss, np.hypot(labels.residual[..., 0], labels.residual[..., 1]), 0.0)
    frame, view, person, _ = np.nonzero(miss)
    box, target, unit = labels.boxes[frame, view, person], labels.target[miss], labels.unit[miss]
    at = (np.arange(_CELLS) + 0.5) / _CELLS
    x, y = box[:, :1] + at * box[:, 2:3], box[:, 1:2] + at * box[:, 3:]
    away = np.hypot((x - target[:, :1])[:, :, None], (y - target[:, 1:])[:, None]) / unit[:, None, None]
    result = {"miss.n": miss.sum(axis=(1, 2, 3)), "miss.beyond": (far >= REACH).sum(axis=(1, 2, 3))}
    for key, limit in (("miss.box", MISS_FROM), ("miss.box_beyond", REACH)):
        result[key] = np.bincount(frame, (away >= limit).mean(axis=(1, 2)), len(miss))
    return {key: each.astype(float) for key, each in result.items()}


def _scatter(labels: LabelledJoints) -> FrameSums:
    """Return sums of good keypoints: squares by kind, products with later frames, products of two views in space."""
    good = labels.risk["jitter"] & (labels.error == KeypointError.GOOD)
    square = np.where(good, (labels.residual**2).sum(axis=-1), 0.0)
    n, k = _by_kind(good), _by_kind(square)
    with np.errstate(invalid="ignore", divide="ignore"):
        usual = np.sqrt(k.sum(axis=0) / n.sum(axis=0) / 2)[list(KIND_OF_JOINT)]
        offset = np.where(good[..., None], labels.residual / usual[:, None], 0.0)
    steps = lags(labels.step)
    later = [_later(offset, good, lag) for lag in steps]
    axes = np.where(np.isfinite(labels.axes), labels.axes, 0.0)
    across, space = np.zeros(n.shape), np.zeros(n.shape)
    for v, w in _pairs(good.shape[1]):
        shared = np.einsum("tpac,tpbc->tpab", axes[:, v], axes[:, w])
        both = good[:, v] & good[:, w]
        product = np.einsum("tpja,tpjb,tpab->tpj", offset[:, v], offset[:, w], shared)
        across += (product * both).sum(axis=1) @ _OF_KIND
        space += (both * (shared**2).sum(axis=(-1, -2))[..., None]).sum(axis=1) @ _OF_KIND
    return {
        "scatter.n": n,
        "scatter.square": k,
        "scatter.later": np.stack([product for product, _ in later], axis=1),
        "scatter.later_square": np.stack([square for _, square in later], axis=1),
        "scatter.across": across,
        "scatter.space": space,
    }


def _later(offset: Floats, good: Bools, lag: int) -> tuple[Floats, Floats]:
    """Return products of offsets ``lag`` frames apart and the mean of both squares, where both are good, (T,)."""
    product, square = np.zeros(len(good)), np.zeros(len(good))
    if lag < len(good):
        both = good[:-lag] & good[lag:]
        now, then = offset[:-lag], offset[lag:]
        product[:-lag] = ((now * then).sum(axis=-1) * both).sum(axis=(1, 2, 3))
        square[:-lag] = (((now**2 + then**2).sum(axis=-1) / 2) * both).sum(axis=(1, 2, 3))
    return product, square


def _dependence(labels: LabelledJoints) -> FrameSums:
    """Return observed and expected pairs of joints taken by the same class, and their products over time, (T, ...).

    ``views.k``, ``limb.k`` (T,): pairs of joints that a class took, over views and within limbs. ``views.expected``,
    ``limb.expected`` (T, G): expected pairs for each correlation of :func:`correlation_grid`. ``time.excess``,
    ``time.weight`` (T, L): products of the deviations from the expectation a lag apart, and their value at full
    correlation. The expectation is the rate for the kind of joint and its occlusion class.
    """
    steps = lags(labels.step)
    frames, states = len(labels.occlusion), len(OCCLUSIONS) * len(KINDS)
    state = labels.occlusion * len(KINDS) + np.array(KIND_OF_JOINT)  # occlusion class and kind of joint
    member = state[..., None] == np.arange(states)  # (T, V, P, 17, 27)
    limbs = np.array([limb == LIMB_OF_JOINT for limb in range(LIMB_OF_JOINT.max() + 1)])
    one, other = np.triu_indices(states)
    same = one == other
    result = {"views.k": np.zeros(frames), "limb.k": np.zeros(frames)}
    result |= {key: np.zeros((frames, len(correlation_grid()))) for key in ("views.expected", "limb.expected")}
    result |= {key: np.zeros((frames, len(steps))) for key in ("time.excess", "time.weight")}
    for key in CLASSES:
        risk, taken = labels.risk[key], labels.taken[key]
        at_risk = member & risk[..., None]
        n, k = at_risk.sum(axis=(0, 1, 2, 3)), (at_risk & taken[..., None]).sum(axis=(0, 1, 2, 3))
        chance = k / np.maximum(n, 1)
        curves = joint_probability(chance[one], chance[other])

        def pairs(count: Floats) -> Floats:
            """Return the number of pairs of states (..., 378), from the number of joints in each state, (..., 27)."""
            return count[..., one] * (count[..., other] - same) / (1 + same)

        # Over views: the same joint of a person, so only states of one kind form pairs.
        by_joint = at_risk.sum(axis=1, dtype=np.float32).reshape(frames, -1, states)
        by_limb = np.einsum("tvpjs,lj->tvpls", at_risk.astype(np.float32), limbs.astype(np.float32))
        for name, count, whole in (
            ("views", by_joint, taken.sum(axis=1, dtype=float).reshape(frames, -1)),
            (
                "limb",
                by_limb.reshape(frames, -1, states),
                np.einsum("tvpj,lj->tvpl", taken.astype(float), limbs).reshape(frames, -1),
            ),
        ):
            # One frame at a time: all pairs of all frames would take a gigabyte.
            met = np.stack([pairs(each).sum(axis=0) for each in count])
            result[f"{name}.expected"] += met @ curves
            result[f"{name}.k"] += (whole * (whole - 1) / 2).sum(axis=1)

        expected = np.where(risk, chance[state], 0.0)
        beyond = np.where(risk, taken - expected, 0.0)
        spread = np.sqrt(expected * (1 - expected))
        for index, lag in enumerate(steps):
            result["time.excess"][:-lag, index] += (beyond[:-lag] * beyond[lag:]).sum(axis=(1, 2, 3))
            result["time.weight"][:-lag, index] += (spread[:-lag] * spread[lag:]).sum(axis=(1, 2, 3))
    return result


def _scores(labels: LabelledJoints) -> FrameSums:
    """Return histograms of scores on the logit scale by visibility, class and kind, (T, 2, 6, 9, B).

    Also those of false detections, (T, B).
    """
    scores, error = labels.association.scores, labels.error
    frames, bins = len(scores), len(LOGITS) - 1
    row = np.where(error == KeypointError.ABSENT, len(SCORED) - 1, error)
    known = np.isfinite(labels.target[..., 0])
    used = labels.association.detected[..., None] & (scores > 0) & ((error != KeypointError.ABSENT) | ~known)
    frame, *_, joint = np.nonzero(used)
    hidden = (labels.occlusion[used] != VISIBLE).astype(int)
    place = (frame, hidden, row[used], np.array(KIND_OF_JOINT)[joint], _bin(scores[used]))
    shape = (frames, 2, len(SCORED), len(KINDS), bins)
    whole = np.bincount(np.ravel_multi_index(place, shape), minlength=int(np.prod(shape))).reshape(shape)
    false = labels.association.false_scores
    flat = np.bincount(np.nonzero(false > 0)[0] * bins + _bin(false[false > 0]), minlength=frames * bins)
    return {"scores": whole.astype(float), "scores.false": flat.reshape(frames, bins).astype(float)}


def _bin(scores: Floats) -> NDArray[np.int64]:
    """Return the bins (...) of scores (...) in the histograms over LOGITS."""
    logit = np.log(np.clip(scores, 1e-9, 1 - 1e-9) / np.clip(1 - scores, 1e-9, 1))
    return np.clip(np.digitize(logit, LOGITS) - 1, 0, len(LOGITS) - 2)


def _people(labels: LabelledJoints) -> FrameSums:
    """Return sums of people missed, detected and duplicated, and of false detections."""
    expected, detected = labels.expected, labels.association.detected
    missed = expected & ~detected
    false = labels.association.false.astype(float)
    fragments = labels.association.fragments.sum(axis=1)
    steps = lags(labels.step)
    result = {
        "people.n": expected.sum(axis=(1, 2)),
        "people.k": missed.sum(axis=(1, 2)),
        "people.detected": detected.sum(axis=(1, 2)),
        "people.duplicates": labels.association.duplicates.sum(axis=(1, 2)),
        "false.n": false,
        "fragments.n": fragments,
    }
    for name, what in (("n", expected), ("k", missed)):
        many = what.sum(axis=1, dtype=float)
        result[f"people.views.{name}"] = ((many**2 - many) / 2).sum(axis=1)
        time = np.zeros((len(what), len(steps)))
        for index, lag in enumerate(steps):
            time[:-lag, index] = (what[:-lag] & what[lag:]).sum(axis=(1, 2))
        result[f"people.time.{name}"] = time
    products, pairs = np.zeros((*false.shape, len(steps) + 1)), np.zeros((len(false), len(steps) + 1))
    products[..., 0], pairs[:, 0] = false**2, 1
    for index, lag in enumerate(steps, start=1):
        products[:-lag, :, index], pairs[:-lag, index] = false[:-lag] * false[lag:], 1
    result["false.products"], result["false.pairs"] = products, pairs
    return {key: np.asarray(each, float) for key, each in result.items()}


def _pairs(count: int) -> Iterator[tuple[int, int]]:
    """Yield all pairs of ``count`` views."""
    for v in range(count):
        for w in range(v + 1, count):
            yield v, w
