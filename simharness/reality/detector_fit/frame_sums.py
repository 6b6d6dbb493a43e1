"""Sums of each frame from which all parameters are estimated: a bootstrap resample costs one matrix product."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from simharness.detector.conditions import OCCLUDED, SELF_OCCLUDED, VISIBLE
from simharness.detector.draws import GROSS, LIMB_OF_JOINT
from simharness.detector.error_classes import MIRROR
from simharness.reality.detector_fit.joint_labels import CLASSES, LabelledJoints
from simharness.reality.detector_fit.tetrachoric import correlation_grid, joint_probability
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS, KeypointsSection
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError

FrameSums = dict[str, Floats]

REACH = 1.15 * float(KeypointsSection().reach)
"""Distance, in units, from which a miss is a stray: the reach of misses and 15 % for errors of the unit."""

LOGITS = np.linspace(-5.0, 5.0, 101)
"""Edges of the histograms of scores, on the logit scale."""

SCORED = ("good", "jitter", "miss", "inversion", "swap", "unknown")
"""Classes with histograms of scores: those of KeypointError, and joints whose truth is unknown."""

OCCLUSIONS = (VISIBLE, SELF_OCCLUDED, OCCLUDED)

TERCILES = ("small", "medium", "large")

_OF_KIND = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
_LONGEST = 2.0  # seconds, longest lag: beyond it, differences between people dominate
_LAGS = 8
BONES = ((5, 7), (6, 8), (7, 9), (8, 10), (11, 13), (12, 14), (13, 15), (14, 16))
"""Limb bones whose length does not change, as pairs of joints."""

NEAR = (*BONES, (5, 11), (6, 12))
"""Limb joints that are one bone apart along the skeleton."""

BORDER = np.linspace(0.0, 6.0, 25)
"""Edges of the histogram of distances from the border of the image, units."""

_OUTLYING = 3.5  # deviations of a bone's length from which a joint is wrong
_CELLS = 12  # in each direction, of the grid on a person's box


def lags(step: float) -> NDArray[np.int64]:
    """Return the lags of autocorrelations, (L,) frames: from 1 to one second, geometrically spaced."""
    return np.unique(np.geomspace(1, max(1.0, round(_LONGEST / step)), _LAGS).round().astype(np.int64))


def frame_sums(labels: LabelledJoints) -> FrameSums:
    """Return the sums of each frame, by name; the first axis of every array is T."""
    sums = {
        **_shares(labels),
        **_face(labels),
        **_sizes(labels),
        **_misses(labels),
        **_scatter(labels),
        **_jitters(labels),
        **_dependence(labels),
        **_scores(labels),
        **_people(labels),
        **_bones(labels),
        **_border(labels),
    }
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


def _face(labels: LabelledJoints) -> FrameSums:
    """Return joints of the face that nobody else hides, and those not reported, by kind and bearing, (T, 3, 12).

    Bearings count towards the side of the joint, so that left and right joints are alike.
    """
    seen, dropped = labels.risk["drop"] & (labels.occlusion != OCCLUDED), labels.taken["drop"]
    result = {key: np.zeros((len(seen), 3, len(BEARINGS))) for key in ("face.n", "face.k")}
    for joint in range(LIMB_JOINTS[0]):
        towards = labels.bearing if MIRROR[joint] >= joint else -labels.bearing % len(BEARINGS)
        at = towards[..., None] == np.arange(len(BEARINGS))
        for key, which in (("face.n", seen), ("face.k", seen & dropped)):
            result[key][:, KIND_OF_JOINT[joint]] += (at & which[..., joint, None]).sum(axis=(1, 2))
    return result


def _bones(labels: LabelledJoints) -> FrameSums:
    """Return sums of limb lengths on which three views or more agree, for each person and bone, (T, P, B), in metres.

    ``bones.n``, ``bones.length`` and ``bones.square`` of the lengths, ``bones.noise`` of the variance expected from
    errors of one unit in each view, ``bones.scale`` of the squared size of a unit at the joints.
    """
    joints, agree = labels.consensus.joints, labels.consensus.agrees.sum(axis=1)
    one, other = np.array(BONES).T
    length = np.linalg.norm(joints[:, :, one] - joints[:, :, other], axis=-1)
    known = (agree[:, :, one] >= 3) & (agree[:, :, other] >= 3) & labels.known[..., None]
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # bones on which three views never agree
        usual = np.nanmedian(np.where(known, length, np.nan), axis=0)
        spread = 1.4826 * np.nanmedian(np.abs(np.where(known, length, np.nan) - usual), axis=0)
        known &= np.abs(length - usual) < _OUTLYING * spread
    away = np.where(known, length - np.nan_to_num(usual), 0.0)
    variance = labels.consensus.variance
    noise = np.where(known, variance[:, :, one] + variance[:, :, other], 0.0)
    scale = np.where(known, labels.consensus.scale[:, :, one] + labels.consensus.scale[:, :, other], 0.0)
    return {
        "bones.n": known.astype(float),
        "bones.length": away,
        "bones.square": away**2,
        "bones.noise": noise.sum(axis=(1, 2)),
        "bones.scale": scale.sum(axis=(1, 2)),
    }


def _sizes(labels: LabelledJoints) -> FrameSums:
    """Return limb joints that are reported and not good, and dropped ones, by tercile of the person's size, (T, 3)."""
    size = np.sqrt(labels.boxes[..., 2] * labels.boxes[..., 3])
    present = labels.association.detected & labels.known[:, None]
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
    """Return misses of limbs, those beyond REACH, and the shares of the boxes beyond 2.35 and beyond REACH, (T,)."""
    miss = labels.taken["miss"].copy()
    miss[..., : LIMB_JOINTS[0]] = False
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
    later = [_later(offset, good, lag, labels) for lag in steps]
    one, other = np.array(NEAR).T
    both = good[..., one] & good[..., other]
    first, second = offset[..., one, :], offset[..., other, :]
    product = np.where(both, (first * second).sum(axis=-1), 0.0)
    mean_square = np.where(both, (first**2 + second**2).sum(axis=-1) / 2, 0.0)
    return {
        "scatter.n": n,
        "scatter.square": k,
        "scatter.later": np.stack([product for product, _ in later], axis=1),
        "scatter.later_square": np.stack([square for _, square in later], axis=1),
        "scatter.near": product.sum(axis=(1, 2, 3)),
        "scatter.near_n": mean_square.sum(axis=(1, 2, 3)),
        "scatter.hidden_n": _by_kind(good & (labels.occlusion != VISIBLE)),
        "scatter.hidden_square": _by_kind(square * (labels.occlusion != VISIBLE)),
    }


def _jitters(labels: LabelledJoints) -> FrameSums:
    """Return the number of jitters, and the sum of their distances as shares of the way from 1.14 to 2.35, (T, 9)."""
    jitter = labels.taken["jitter"]
    away = np.where(jitter, np.hypot(labels.residual[..., 0], labels.residual[..., 1]), GOOD_BELOW)
    way = np.clip((away - GOOD_BELOW) / (MISS_FROM - GOOD_BELOW), 0.0, 1.0)
    return {"jitter.n": _by_kind(jitter), "jitter.way": _by_kind(way)}


def _later(offset: Floats, good: Bools, lag: int, labels: LabelledJoints) -> tuple[Floats, Floats]:
    """Return products of offsets ``lag`` frames apart and the mean of both squares, where both are good, (T,)."""
    product, square = np.zeros(len(good)), np.zeros(len(good))
    if lag < len(good):
        both = good[:-lag] & good[lag:] & _consecutive(labels, lag)[:, None, None, None]
        now, then = offset[:-lag], offset[lag:]
        product[:-lag] = ((now * then).sum(axis=-1) * both).sum(axis=(1, 2, 3))
        square[:-lag] = (((now**2 + then**2).sum(axis=-1) / 2) * both).sum(axis=(1, 2, 3))
    return product, square


def _consecutive(labels: LabelledJoints, lag: int) -> Bools:
    """Return which frames have no gap to the frame ``lag`` frames later, (T - lag,)."""
    return np.asarray(labels.time[lag:] - labels.time[:-lag] < (lag + 0.5) * labels.step)


def _dependence(labels: LabelledJoints) -> FrameSums:
    """Return observed and expected pairs of joints taken by the same class, and their products over time, (T, ...).

    ``views.k``, ``gross_views.k``, ``limb.k`` (T,): pairs of joints that a class took, over views (GROSS classes apart)
    and within limbs. ``views.expected``, ``gross_views.expected``, ``limb.expected`` (T, G): expected pairs for each
    correlation of :func:`correlation_grid`. ``time.excess``, ``time.weight`` (T, L): products of the deviations from
    the expectation a lag apart, and their value at full correlation. The expectation is the rate for the kind of joint
    and its occlusion class.
    """
    steps = lags(labels.step)
    frames, states = len(labels.occlusion), len(OCCLUSIONS) * len(KINDS)
    state = labels.occlusion * len(KINDS) + np.array(KIND_OF_JOINT)  # occlusion class and kind of joint
    member = state[..., None] == np.arange(states)  # (T, V, P, 17, 27)
    limbs = np.array([limb == LIMB_OF_JOINT for limb in range(LIMB_OF_JOINT.max() + 1)])
    one, other = np.triu_indices(states)
    same = one == other
    result = {key: np.zeros(frames) for key in ("views.k", "gross_views.k", "limb.k")}
    result |= {
        f"{key.removesuffix('.k')}.expected": np.zeros((frames, len(correlation_grid()))) for key in list(result)
    }
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
            ("gross_views" if key in GROSS else "views", by_joint, taken.sum(axis=1, dtype=float).reshape(frames, -1)),
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
            if lag >= frames:
                continue
            whole = _consecutive(labels, lag)
            result["time.excess"][:-lag, index] += whole * (beyond[:-lag] * beyond[lag:]).sum(axis=(1, 2, 3))
            result["time.weight"][:-lag, index] += whole * (spread[:-lag] * spread[lag:]).sum(axis=(1, 2, 3))
    return result


def _scores(labels: LabelledJoints) -> FrameSums:
    """Return histograms of scores on the logit scale by visibility, class and kind, (T, 2, 6, 9, B).

    Also those of false detections, and of joints outside of the image, (T, B) each.
    """
    scores, error = labels.association.scores, labels.error
    frames, bins = len(scores), len(LOGITS) - 1
    row = np.where(error == KeypointError.ABSENT, len(SCORED) - 1, error)
    known = np.isfinite(labels.target[..., 0])
    shown = (labels.association.detected & labels.known[:, None])[..., None] & (scores > 0)
    used = shown & labels.inside & ((error != KeypointError.ABSENT) | ~known)
    frame, *_, joint = np.nonzero(used)
    hidden = (labels.occlusion[used] != VISIBLE).astype(int)
    place = (frame, hidden, row[used], np.array(KIND_OF_JOINT)[joint], _bin(scores[used]))
    shape = (frames, 2, len(SCORED), len(KINDS), bins)
    whole = np.bincount(np.ravel_multi_index(place, shape), minlength=int(np.prod(shape))).reshape(shape)
    false = labels.association.false_scores
    flat = np.bincount(np.nonzero(false > 0)[0] * bins + _bin(false[false > 0]), minlength=frames * bins)
    outside = shown & ~labels.inside
    beyond = np.bincount(np.nonzero(outside)[0] * bins + _bin(scores[outside]), minlength=frames * bins)
    return {
        "scores": whole.astype(float),
        "scores.false": flat.reshape(frames, bins).astype(float),
        "scores.outside": beyond.reshape(frames, bins).astype(float),
    }


def _bin(scores: Floats) -> NDArray[np.int64]:
    """Return the bins (...) of scores (...) in the histograms over LOGITS."""
    logit = np.log(np.clip(scores, 1e-9, 1 - 1e-9) / np.clip(1 - scores, 1e-9, 1))
    return np.clip(np.digitize(logit, LOGITS) - 1, 0, len(LOGITS) - 2)


def _missed_by_hidden_share(labels: LabelledJoints, expected: Bools, missed: Bools) -> FrameSums:
    """Return people expected and missed by the share of their limb joints that others or the border hide, (T, 5)."""
    hidden = ((labels.occlusion == OCCLUDED) | ~labels.inside)[..., LIMB_JOINTS].mean(axis=-1)
    nearest = np.round(4 * hidden).astype(int)[..., None] == np.arange(5)
    return {
        f"people.hidden.{key}": (nearest & which[..., None]).sum(axis=(1, 2)).astype(float)
        for key, which in (("n", expected), ("k", missed))
    }


def _border(labels: LabelledJoints) -> FrameSums:
    """Return limb joints outside of the images by their distance from the border, (T, B), and those reported, (T,)."""
    outside = (labels.association.detected & labels.known[:, None])[..., None] & ~labels.inside
    outside[..., : LIMB_JOINTS[0]] = False
    bins = np.digitize(labels.beyond, BORDER[1:-1])[..., None] == np.arange(len(BORDER) - 1)
    return {
        "border.n": (bins & outside[..., None]).sum(axis=(1, 2, 3)).astype(float),
        "border.k": (outside & (labels.association.scores > 0)).sum(axis=(1, 2, 3)).astype(float),
        "outside.n": _by_kind(outside),
        "outside.k": _by_kind(outside & (labels.association.scores > 0)),
    }


def _people(labels: LabelledJoints) -> FrameSums:
    """Return sums of people missed, detected and duplicated, and of false detections."""
    expected, detected = labels.expected, labels.association.detected & labels.known[:, None]
    missed = expected & ~detected
    false = labels.association.false.astype(float)
    fragments = labels.association.fragments.sum(axis=1)
    steps = lags(labels.step)
    result = {
        **_missed_by_hidden_share(labels, expected, missed),
        "people.n": expected.sum(axis=(1, 2)),
        "people.k": missed.sum(axis=(1, 2)),
        "people.detected": detected.sum(axis=(1, 2)),
        "people.duplicates": (labels.association.duplicates * labels.known[:, None]).sum(axis=(1, 2)),
        "false.n": false,
        "fragments.n": fragments,
    }
    for name, what in (("n", expected), ("k", missed)):
        many = what.sum(axis=1, dtype=float)
        result[f"people.views.{name}"] = ((many**2 - many) / 2).sum(axis=1)
        time = np.zeros((len(what), len(steps)))
        for index, lag in enumerate(steps):
            if lag < len(what):
                whole = _consecutive(labels, lag)
                time[:-lag, index] = whole * (what[:-lag] & what[lag:]).sum(axis=(1, 2))
        result[f"people.time.{name}"] = time
    products, pairs = np.zeros((*false.shape, len(steps) + 1)), np.zeros((len(false), len(steps) + 1))
    products[..., 0], pairs[:, 0] = false**2, 1
    for index, lag in enumerate(steps, start=1):
        if lag < len(false):
            whole = _consecutive(labels, lag)
            products[:-lag, :, index], pairs[:-lag, index] = whole[:, None] * false[:-lag] * false[lag:], whole
    result["false.products"], result["false.pairs"] = products, pairs
    return {key: np.asarray(each, float) for key, each in result.items()}
