"""Parameters of the simulated detector at which it errs as the measured one, estimated from sums.

Every function takes sums of R resamples, arrays (R, ...), and returns parameters (R,), NaN where they are unknown. The
parameters are named as the keys of ``[detector]``.
"""

import numpy as np
from scipy.special import expit, logit

from mvpose.arrays import Floats
from simharness.detector.viewing_conditions import OCCLUDED, SELF_OCCLUDED
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.detector_sums import FrameSums, Trials
from simharness.reality.detector_fit.frame_sums import APART, BORDER, DEPTHS, TERCILES, lags
from simharness.reality.detector_fit.joint_labels import CLASSES
from simharness.reality.detector_fit.score_parameters import (
    LIMB_KINDS,
    averaged,
    guess_scores,
    quantile,
    score_parameters,
)
from simharness.reality.detector_fit.tetrachoric import (
    fit_life,
    fit_noisy_life,
    joint_probability,
    tetrachoric_correlation,
)
from simharness.scenario.sections.detector_section import KINDS
from simharness.types.truth import GOOD_BELOW

UNCOVERED = 0.08
"""Factor on swaps and inversions of joints that nothing else hides, where few say nothing of it: in an operating room
(MVOR), hidden joints are grossly wrong 11 to 14 times as often as visible ones."""

STATES = ("visible", "self_occluded", "occluded")
"""States of a joint, in the order of the sums."""

SHARES = (*(f"share.wrong.{state}" for state in STATES), "share.gross")
"""Keys, before the kind of joint, of the shares of misses and jitters by state, and of misses among them."""

_WIDEST = 3.0  # units: such a scatter is flat within 1.14, and wider ones are indistinguishable from it
_MIN_ERRORS = 200  # errors needed to estimate their correlations
_ROUNDS = 4
_PRIOR = 20.0  # joints
_PRIOR_ERRORS = 3.0
_PRIOR_FACTOR = 1.0  # errors of a kind of hidden joint needed to say something about their factor, and added to them
_LEAST_FACTOR = 0.1  # hidden joints may err less than visible ones by chance
_MIN_HIDDEN = 20  # joints of a kind needed to say something about the kind
_MIN_INVERTED = 20.0  # inversions needed to see how far left and right are apart
_REACHES = np.geomspace(0.02, 3.0, 60)  # heights; beyond, inversions are as frequent at all distances
_MIN_OUTSIDE = 50  # joints outside of the image needed to see how far the detector reports them
_HIDDEN = ((SELF_OCCLUDED, "self_occluded"), (OCCLUDED, "occluded"))
_STEEP = 5.0  # largest step towards the growth of drops with depth, a metre


def estimate_parameters(sums: FrameSums, *, step: float, kind: DetectorKind) -> dict[str, Floats]:
    """Return all parameters by key, (R,) each.

    Args:
        sums: sums of :func:`simharness.reality.detector_fit.frame_sums.frame_sums` over the frames of R resamples.
        step: seconds between consecutive frames.
        kind: kind of the detector. A top-down one guesses the joints that it cannot see: their gross errors are
            guesses, and joints outside of the image are reported at its border.
    """
    result: dict[str, Floats] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        n, k = ({key: getattr(sums.classes[key], name) for key in CLASSES} for name in ("n", "k"))
        share = {key: np.clip(k[key].sum(axis=1) / n[key].sum(axis=1), 0.0, 1.0) for key in CLASSES}
        for key in CLASSES:
            _put_by_kind(result, f"share.{key}", share[key])
        for key in ("swap", "inversion"):
            uncovered = Trials(n[key][:, :2].sum(axis=1), k[key][:, :2].sum(axis=1))
            factor = _factor_of(n[key].sum(axis=1), k[key].sum(axis=1), uncovered)
            result[f"keypoints.{key}_uncovered"] = factor
            as_covered = n[key][:, 2] + np.nan_to_num(factor, nan=UNCOVERED)[:, None] * uncovered.n
            _put_by_kind(result, f"keypoints.{key}", np.clip(k[key].sum(axis=1) / as_covered, 0.0, 1.0))
        n_drop, k_drop = n["drop"].copy(), k["drop"]
        edge = _factor_of(n_drop[:, 1:], k_drop[:, 1:], sums.edge)
        for index, (_, name) in enumerate(_HIDDEN):
            result[f"keypoints.drop.edge.{name}"] = edge[:, index]
        result["keypoints.drop.depth"] = _depth(sums.depth)
        n_drop[:, 1:] -= np.nan_to_num(1 - edge)[..., None] * sums.edge.n
        dropped = np.where(n_drop > 0, k_drop / n_drop, (k_drop.sum(axis=1) / n_drop.sum(axis=1))[:, None])
        for index, occlusion in enumerate(STATES):
            _put_by_kind(result, f"keypoints.drop.{occlusion}", np.clip(dropped[:, index], 0.0, 1.0))
        seen = {key: np.clip(k[key][:, 0] / n[key][:, 0], 0.0, 1.0) for key in ("miss", "jitter")}
        for key, shown in seen.items():
            _put_by_kind(result, f"keypoints.{key}", shown)
        if kind == "top-down":
            result |= _guesses(n, k, sums)
        else:
            wrong = k["miss"] + k["jitter"]
            expected = sum(n[key] * np.nan_to_num(shown)[:, None] for key, shown in seen.items())
            for index, name in _HIDDEN:
                _put_by_kind(result, f"keypoints.{name}", _factors(wrong[:, index], expected[:, index]))
            shares = *np.moveaxis(wrong / n["miss"], 1, 0), k["miss"].sum(axis=1) / wrong.sum(axis=1)
            for key, values in zip(SHARES, shares, strict=True):
                _put_by_kind(result, key, np.clip(values, 0.0, 1.0))
            result["keypoints.border"] = _border(sums)
        result["keypoints.inversion_reach"] = _inversion_reach(sums)
        scatter = sums.scatter
        shown, square = scatter.n - scatter.hidden_n, scatter.square - scatter.hidden_square
        _put_by_kind(result, "keypoints.scatter", _sigma(square / shown))
        _put_by_kind(result, "keypoints.scatter_hidden", _hidden_scatter(sums))
        _put_by_kind(result, "keypoints.jitter_mean", _jitter_mean(sums))
        result |= _face(sums)
        miss = sums.miss
        beyond, box, box_beyond = miss.beyond / miss.n, miss.box / miss.n, miss.box_beyond / miss.n
        stray = np.clip(beyond / (box_beyond + beyond * (1 - box)), 0.0, 1.0)
        for index in LIMB_KINDS:  # too few misses of each kind; misses of the face stay near it
            result[f"keypoints.stray.{KINDS[index]}"] = stray
        result |= _dependence(sums, step)
        result |= score_parameters(sums)
        if kind == "top-down":
            result |= guess_scores(sums)
        result |= _people_parameters(sums, step)
        for index, third in enumerate(TERCILES):
            result[f"size.{third}.drop"] = sums.size_drop.k[:, index] / sums.size_drop.n[:, index]
            result[f"size.{third}.wrong"] = sums.size.k[:, index] / sums.size.n[:, index]
    return result


def _put_by_kind(result: dict[str, Floats], key: str, values: Floats) -> None:
    """Store the values of each kind of joint, (R, 9), under one key for each kind."""
    for index, kind in enumerate(KINDS):
        result[f"{key}.{kind}"] = values[:, index]


def _factors(observed: Floats, expected: Floats) -> Floats:
    """Return by which factors errors are more frequent than expected, by kind of joint, (..., 9).

    Kinds with few errors take from the others: each counts as _PRIOR_ERRORS more, at the factor of all.

    Args:
        observed: errors of joints in some state, (..., 9).
        expected: errors that there would be, were those joints visible, (..., 9).
    """
    pooled = observed.sum(axis=-1, keepdims=True) / expected.sum(axis=-1, keepdims=True)
    pooled = np.where(np.isfinite(pooled), np.maximum(pooled, _LEAST_FACTOR), 1.0)
    return np.asarray(np.maximum((observed + _PRIOR_ERRORS) / (expected + _PRIOR_ERRORS / pooled), _LEAST_FACTOR))


def _factor_of(n: Floats, k: Floats, some: Trials) -> Floats:
    """Return by which factors some of the joints err less often than the others, (...), 1 at most.

    The estimate of Mantel and Haenszel (1959), which kinds of joint with other shares do not bias; _PRIOR_ERRORS count
    as half as often. NaN with few errors.

    Args:
        n: joints that may err, (..., 9) by kind.
        k: those that do, (..., 9).
        some: both of some of them, (..., 9).
    """
    these = (some.k * (n - some.n) / np.maximum(n, 1)).sum(axis=-1)
    others = ((k - some.k) * some.n / np.maximum(n, 1)).sum(axis=-1)
    ratio = (these + _PRIOR_ERRORS / 2) / (others + _PRIOR_ERRORS)
    return np.where(k.sum(axis=-1) >= _MIN_HIDDEN, np.clip(ratio, 0.0, 1.0), np.nan)


def _depth(drops: Trials) -> Floats:
    """Return by how much the logit of drops of self-occluded limb joints grows with their depth, (R,) a metre.

    By logistic regression in which each kind of joint has its own share. NaN with few drops.

    Args:
        drops: joints that may be dropped, and those dropped, by kind and depth, (R, 9, B).
    """
    n, k = drops
    depth, slope = (DEPTHS[1:] + DEPTHS[:-1]) / 2, np.zeros((len(n), 1, 1))
    level = logit((k.sum(axis=-1, keepdims=True) + 0.5) / (n.sum(axis=-1, keepdims=True) + 1))
    for _ in range(2 * _ROUNDS):  # of Newton's method
        share = expit(level + slope * depth)
        weight, rest = n * share * (1 - share) + 1e-9, k - n * share
        away = depth - (weight @ depth / weight.sum(axis=-1))[..., None]
        step = (rest * away).sum(axis=(1, 2)) / (weight * away**2).sum(axis=(1, 2))
        slope = slope + np.clip(step, -_STEEP, _STEEP)[:, None, None]
        level = level + np.clip(rest.sum(axis=-1) / weight.sum(axis=-1), -1, 1)[..., None]
    return np.where(k.sum(axis=(1, 2)) >= _MIN_HIDDEN, np.maximum(slope[:, 0, 0], 0.0), np.nan)


def _guesses(n: dict[str, Floats], k: dict[str, Floats], sums: FrameSums) -> dict[str, Floats]:
    """Return the parameters of a detector that guesses: shares that are guessed, and factors on jitter.

    The share guessed begins as the share of gross errors among the joints in that state; calibration raises it, because
    many guesses are right. Kinds of which few are hidden in this way are unknown: values that they took from the others
    would count more than once in the inference, whose prior has what kinds have in common.

    Args:
        n: joints that each class could have taken, (R, 3, 9) by class.
        k: joints that each class took, (R, 3, 9) by class.
        sums: all sums.
    """
    result: dict[str, Floats] = {}
    usual = np.nan_to_num(k["jitter"][:, 0] / n["jitter"][:, 0])
    for index, name in _HIDDEN:
        wrong, reported = k["miss"][:, index], n["miss"][:, index]
        share = np.where(reported >= _MIN_HIDDEN, wrong / reported, np.nan)
        _put_by_kind(result, f"keypoints.guess.{name}", np.clip(share, 0.0, 1.0))
        expected = n["jitter"][:, index] * usual
        factor = (k["jitter"][:, index] + _PRIOR_FACTOR) / (expected + _PRIOR_FACTOR)
        _put_by_kind(result, f"keypoints.{name}", np.where(expected >= _PRIOR_FACTOR, factor, np.nan))
    outside = sums.outside.n.sum(axis=1, keepdims=True)
    share = np.broadcast_to(sums.outside.k.sum(axis=1, keepdims=True) / outside, sums.outside.n.shape)
    _put_by_kind(result, "keypoints.guess.outside", np.where(outside >= _MIN_HIDDEN, share, np.nan))
    return result


def _sigma(square: Floats) -> Floats:
    """Return the deviation per axis of a Gaussian truncated at 1.14, from its mean square (maximum likelihood)."""
    sigma = np.linspace(0.05, _WIDEST, 600)
    a = (GOOD_BELOW / sigma) ** 2 / 2
    left = 2 * sigma**2 * (1 - a / np.expm1(a))
    return np.where(np.isfinite(square), np.interp(square, np.append(0.0, left), np.append(0.0, sigma)), np.nan)


def _hidden_scatter(sums: FrameSums) -> Floats:
    """Return the factor of the scatter of good keypoints whose joint is not visible, by kind, (R, 9).

    Kinds of which too few are hidden have that of the others.
    """
    hidden_n, hidden = sums.scatter.hidden_n, sums.scatter.hidden_square
    shown = (sums.scatter.square - hidden) / (sums.scatter.n - hidden_n)
    ratio = _sigma(hidden / hidden_n) / _sigma(shown)
    pooled = averaged(ratio, np.where(np.isfinite(ratio), hidden_n, 0.0))[:, None]
    return np.where(np.isfinite(ratio) & (hidden_n >= _MIN_HIDDEN), ratio, pooled)


def _jitter_mean(sums: FrameSums) -> Floats:
    """Return the mean distance of jitters as a share of the way from 1.14 to 2.35, by kind, (R, 9).

    Kinds with few jitters take from the others: each counts as _PRIOR joints more, at the mean of all.
    """
    n, way = sums.jitter.n, sums.jitter.way
    pooled = way.sum(axis=1, keepdims=True) / n.sum(axis=1, keepdims=True)
    return np.asarray((way + _PRIOR * np.nan_to_num(pooled, nan=0.5)) / (n + _PRIOR))


def _border(sums: FrameSums) -> Floats:
    """Return the distance outside of the image, units, that best parts the reported joints from the others, (R,)."""
    n, k = sums.border.n, sums.border.k
    wrong = np.concatenate([np.zeros((len(n), 1)), np.cumsum(n - 2 * k, axis=-1)], axis=-1)
    return np.where(n.sum(axis=-1) >= _MIN_OUTSIDE, BORDER[wrong.argmin(axis=-1)], np.nan)


def _inversion_reach(sums: FrameSums) -> Floats:
    """Return the distance of the counterpart at which inversions are 1 / e as frequent, from their mean distance."""
    n, k = sums.apart.n, sums.apart.k
    far = (APART[1:] + APART[:-1]) / 2
    weight = np.exp(-far / _REACHES[:, None])
    means = (n @ (weight * far).T) / (n @ weight.T)  # rising with the reach, (R, 60)
    mean = (k @ far) / k.sum(axis=1)
    reach = np.array([np.interp(each, row, _REACHES) for each, row in zip(mean, means, strict=True)])
    return np.where(k.sum(axis=1) >= _MIN_INVERTED, reach, np.nan)


def _face(sums: FrameSums) -> dict[str, Floats]:
    """Return the shares of joints of the face that are not reported, by kind and bearing (R, 24).

    Bins with few joints take from their neighbours: each counts as _PRIOR_ERRORS joints more, at the rate beside.
    """
    n, k = sums.face.n, sums.face.k
    around_n, around_k = (np.roll(each, 1, axis=-1) + np.roll(each, -1, axis=-1) + 1e-9 for each in (n, k))
    rate = (k + _PRIOR_ERRORS * around_k / around_n) / (n + _PRIOR_ERRORS)
    rate = np.where(n.sum(axis=-1, keepdims=True) > 0, rate, np.nan)
    return {f"keypoints.face.{KINDS[kind]}.{at}": rate[:, kind, at] for kind, at in np.ndindex(rate.shape[1:])}


def _dependence(sums: FrameSums, step: float) -> dict[str, Floats]:
    """Return the parameters of ``[detector.correlation]``."""
    enough = sum(sums.classes[key].k.sum(axis=(1, 2)) for key in CLASSES) >= _MIN_ERRORS
    scatter = sums.scatter.later / sums.scatter.later_square
    life, noise = fit_noisy_life(lags(step), step, scatter, sums.scatter.later_square)
    excess, weight = sums.dependence.excess, sums.dependence.weight
    result = {
        "correlation.life": np.where(enough, fit_life(lags(step), step, excess / weight, weight), np.nan),
        "correlation.scatter_life": life,
        "correlation.scatter_noise": noise,
        "correlation.scatter_near": np.clip(sums.scatter.near / sums.scatter.near_square, 0.0, 0.95),
        "correlation.scatter_views": _shared_scatter(sums),
    }
    for key in ("views", "gross_views", "limb"):
        pairs = getattr(sums.dependence, key)
        fitted = tetrachoric_correlation(pairs.k, pairs.expected)
        result[f"correlation.{key}"] = np.where(enough, fitted, np.nan)
    return result


def _shared_scatter(sums: FrameSums) -> Floats:
    """Return the share of the variance of scatter that all views have in common.

    The views agree on such an error, so that residuals do not show it; but it changes the lengths of bones. What the
    variance of the lengths over time has beyond the noise of single views is due to it; below 0 where it has less.
    """
    limbs = list(LIMB_KINDS)
    single = (sums.scatter.square[:, limbs].sum(axis=1) / sums.scatter.n[:, limbs].sum(axis=1)) / 2
    n = np.maximum(sums.bones.n, 1.0)
    spread = (sums.bones.square - sums.bones.length**2 / n).sum(axis=(1, 2))
    # Joints that a bone joins err alike, by which its length changes less.
    near = np.clip(sums.scatter.near / sums.scatter.near_square, 0.0, 0.95)
    shared = (spread - single * (1 - near) * sums.bones.noise) / sums.bones.scale
    return shared / (np.abs(shared) + single)


def _people_parameters(sums: FrameSums, step: float) -> dict[str, Floats]:
    """Return the parameters of boxes and phantoms."""
    p = (sums.people.all.k / sums.people.all.n)[:, None]
    hidden_n, hidden_k = sums.people.hidden.n, sums.people.hidden.k
    by_hidden = np.where(hidden_n > 0, hidden_k / hidden_n, np.nan)
    for index in range(1, 5):  # where nobody is hidden so much, as where people are hidden less
        by_hidden[:, index] = np.where(hidden_n[:, index] > 0, by_hidden[:, index], by_hidden[:, index - 1])
    because = np.clip(1 - (1 - by_hidden) / (1 - by_hidden[:, :1]), 0.0, 1.0)
    weight = sums.people.time.n * p * (1 - p)
    missed_again = sums.people.time.k - sums.people.time.n * p**2
    rate = sums.false.n / sums.false.pairs[:, :1]  # for each view, (R, V)
    spread = sums.false.products / sums.false.pairs[:, None] - rate[..., None] ** 2
    spread = spread.sum(axis=1)
    row = sums.scores.false
    return {
        "boxes.missed": by_hidden[:, 0],
        **{f"boxes.missed_hidden.{index}": because[:, index] for index in range(5)},
        "boxes.missed_views": tetrachoric_correlation(
            sums.people.views.k, sums.people.views.n[:, None] * joint_probability(p, p)[:, 0]
        ),
        "boxes.life": fit_life(lags(step), step, missed_again / weight, weight),
        "boxes.duplicates": sums.people.duplicates / sums.people.detected,
        "size.fragments": sums.false.fragments / sums.false.pairs[:, 0] / sums.false.n.shape[1],
        "phantoms.rate": rate.mean(axis=1),
        "phantoms.life": fit_life(lags(step), step, spread[:, 1:] / spread[:, :1], np.ones_like(spread[:, 1:])),
        "phantoms.score": expit(quantile(row, 0.5)),
        "phantoms.deviation": (quantile(row, 0.75) - quantile(row, 0.25)) / 1.349,
    }
