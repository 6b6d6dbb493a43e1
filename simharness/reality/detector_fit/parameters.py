"""Parameters of the simulated detector at which it errs as the measured one, estimated from sums.

Every function takes sums of R resamples, arrays (R, ...), and returns parameters (R,), NaN where they are unknown. The
parameters are named as the keys of ``[detector]``.
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit, logit, ndtr

from mvpose.arrays import Floats
from simharness.detector.conditions import OCCLUDED, SELF_OCCLUDED
from simharness.reality.detector_fit.bias_fit import solve
from simharness.reality.detector_fit.frame_sums import LOGITS, SCORED, TERCILES, FrameSums, lags
from simharness.reality.detector_fit.joint_labels import CLASSES
from simharness.reality.detector_fit.occlusion import CONFUSION
from simharness.reality.detector_fit.tetrachoric import fit_life, joint_probability, tetrachoric_correlation
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS
from simharness.types.truth import GOOD_BELOW

LIMB_KINDS = tuple(sorted({KIND_OF_JOINT[joint] for joint in range(5, 17)}))
"""Kinds of joint whose truth is known."""

_WIDEST = 3.0  # units: such a scatter is flat within 1.14, and wider ones are indistinguishable from it
_MIN_ERRORS = 200  # errors needed to estimate their correlations
_ROUNDS = 4
_SEPARATED = 1.0  # deviations between scores of good keypoints and misses from which mixtures can be separated


def estimate_parameters(sums: FrameSums, *, step: float) -> dict[str, Floats]:
    """Return all parameters by key, (R,) each.

    Args:
        sums: sums of :func:`simharness.reality.detector_fit.frame_sums.frame_sums` over the frames of R resamples.
        step: seconds between consecutive frames.
    """
    result: dict[str, Floats] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        n, k = ({key: sums[f"{name}.{key}"] for key in CLASSES} for name in ("n", "k"))
        share = {key: np.clip(k[key].sum(axis=1) / n[key].sum(axis=1), 0.0, 1.0) for key in CLASSES}
        for key in CLASSES:
            _put_by_kind(result, f"share.{key}", share[key])
        for key in ("swap", "inversion"):
            _put_by_kind(result, f"keypoints.{key}", share[key])
        dropped = _by_occlusion(n["drop"], k["drop"])
        for index, occlusion in enumerate(("visible", "self_occluded", "occluded")):
            _put_by_kind(result, f"keypoints.drop.{occlusion}", dropped[:, index])
        reported = _reported(dropped)
        result |= _occlusion_factors(n, k, share, reported)
        _put_by_kind(result, "keypoints.scatter", _sigma(sums["scatter.square"] / sums["scatter.n"]))
        offset = solve(sums["bias.A"], sums["bias.b"])
        for index, way in enumerate(("forward", "outward", "up")):
            _put_by_kind(result, f"bias.{way}", np.where(sums["scatter.n"] > 0, offset[..., index], np.nan))
        beyond = sums["miss.beyond"] / sums["miss.n"]
        box, box_beyond = sums["miss.box"] / sums["miss.n"], sums["miss.box_beyond"] / sums["miss.n"]
        result["keypoints.stray"] = np.clip(beyond / (box_beyond + beyond * (1 - box)), 0.0, 1.0)
        result |= _dependence(sums, step)
        result |= _score_parameters(sums, 1 - reported[:, :, 0, 0])
        result |= _people_parameters(sums, step)
        for index, third in enumerate(TERCILES):
            result[f"size.{third}.drop"] = sums["size.drop.k"][:, index] / sums["size.drop.n"][:, index]
            result[f"size.{third}.wrong"] = sums["size.k"][:, index] / sums["size.n"][:, index]
    return result


def _put_by_kind(result: dict[str, Floats], key: str, values: Floats) -> None:
    """Store the values of each kind of joint, (R, 9), under one key for each kind."""
    for index, kind in enumerate(KINDS):
        result[f"{key}.{kind}"] = values[:, index]


def _by_occlusion(n: Floats, k: Floats, confusion: Floats = CONFUSION) -> Floats:
    """Return shares (R, 3, 9) of joints that truly are visible, self-occluded and occluded.

    Args:
        n: number of joints by estimated occlusion class, (R, 3, 9).
        k: number of them that were taken. For a class without joints the share of all classes is used.
        confusion: shares of the true classes given the estimated one, (..., 9, 3, 3).
    """
    estimated = np.where(n > 0, k / n, (k.sum(axis=1) / n.sum(axis=1))[:, None])
    return np.clip(np.einsum("...kct,...tk->...ck", np.linalg.inv(confusion), estimated), 0.0, 1.0)


def _reported(dropped: Floats) -> Floats:
    """Return CONFUSION among reported joints, (R, 9, 3, 3): more of them are visible than of all joints.

    Args:
        dropped: shares of joints that are not reported, (R, 3, 9).
    """
    left = CONFUSION * (1 - np.clip(dropped, 0.0, 0.95)).transpose(0, 2, 1)[:, :, None]
    return np.asarray(left / left.sum(axis=-1, keepdims=True))


def _occlusion_factors(
    n: dict[str, Floats], k: dict[str, Floats], share: dict[str, Floats], confusion: Floats
) -> dict[str, Floats]:
    """Return the factors of misses and jitter for hidden joints, and the shares for visible joints.

    Args:
        n: joints that each class could have taken, by class.
        k: joints that each class took, by class.
        share: shares taken by each class, (R, 9), by class.
        confusion: confusion of occlusion classes among reported joints, (R, 9, 3, 3).
    """
    observed, expected, by_true = np.zeros(()), np.zeros(()), {}
    for key in ("miss", "jitter"):
        wrong = _by_occlusion(n[key], k[key], confusion)
        by_true[key] = np.einsum("rkec,rek->rck", confusion, n[key])
        observed = observed + np.nan_to_num(by_true[key] * wrong).sum(axis=2)
        expected = expected + np.nan_to_num(by_true[key] * wrong[:, :1]).sum(axis=2)
    factor = observed / expected  # (R, 3), 1 for visible joints
    result: dict[str, Floats] = {}
    for key in ("miss", "jitter"):
        known = np.where(np.isfinite(factor), factor, 1.0)
        mean = np.einsum("rc,rck->rk", known, by_true[key]) / by_true[key].sum(axis=1)
        _put_by_kind(result, f"keypoints.{key}", share[key] / mean)
    return result | {"keypoints.self_occluded": factor[:, SELF_OCCLUDED], "keypoints.occluded": factor[:, OCCLUDED]}


def _sigma(square: Floats) -> Floats:
    """Return the deviation per axis of a Gaussian truncated at 1.14, from its mean square (maximum likelihood)."""
    sigma = np.linspace(0.05, _WIDEST, 600)
    a = (GOOD_BELOW / sigma) ** 2 / 2
    left = 2 * sigma**2 * (1 - a / np.expm1(a))
    return np.where(np.isfinite(square), np.interp(square, np.append(0.0, left), np.append(0.0, sigma)), np.nan)


def _dependence(sums: FrameSums, step: float) -> dict[str, Floats]:
    """Return the parameters of ``[detector.correlation]``."""
    enough = sum(sums[f"k.{key}"].sum(axis=(1, 2)) for key in CLASSES) >= _MIN_ERRORS
    scatter = sums["scatter.later"] / sums["scatter.later_square"]
    return {
        "correlation.life": np.where(
            enough, fit_life(lags(step), step, sums["time.excess"] / sums["time.weight"], sums["time.weight"]), np.nan
        ),
        "correlation.views": np.where(enough, tetrachoric_correlation(sums["views.k"], sums["views.expected"]), np.nan),
        "correlation.limb": np.where(enough, tetrachoric_correlation(sums["limb.k"], sums["limb.expected"]), np.nan),
        "correlation.scatter_life": fit_life(lags(step), step, scatter, sums["scatter.later_square"]),
        "correlation.scatter_views": np.clip(
            sums["scatter.across"].sum(axis=1) / sums["scatter.space"].sum(axis=1), 0.0, 1.0
        ),
    }


def _score_parameters(sums: FrameSums, unseen: Floats) -> dict[str, Floats]:
    """Return the parameters of scores: usual scores by class, deviation, shares of over- and underconfident ones.

    Args:
        sums: sums of R resamples.
        unseen: share of hidden joints among those estimated as visible, (R, 9): they have the lowest scores.
    """
    shown, whole = sums["scores"][:, 0], sums["scores"].sum(axis=1)  # (R, 6, 9, B), of visible joints and of all
    limbs = list(LIMB_KINDS)
    rows = {name: SCORED.index(name) for name in SCORED}
    good, miss = shown[:, rows["good"]], whole[:, rows["miss"]]
    many = shown[:, rows["good"]].sum(axis=-1)
    every = expit(_quantile(shown.sum(axis=1), 0.5))
    under = over = np.zeros(len(shown))
    for _ in range(_ROUNDS):
        # Good keypoints with the score of a miss have the lowest scores: the median of the others is a higher quantile.
        lower = np.clip(under[:, None] + unseen, 0.0, 0.9)
        usual = expit(_quantile(good, (1 + lower) / 2))
        # The classes of the face are unknown: its usual score is above its median as for good limb joints.
        usual = np.where(many > 0, usual, every * _averaged(usual / every, many)[:, None])
        top = np.nanmax(usual[:, limbs], axis=1)
        joint = usual / top[:, None]
        missed = _averaged(expit(_quantile(miss, ((1 - over) / 2)[:, None])) / joint, miss.sum(axis=-1))
        upper = _quantile(good, (3 + lower) / 4) - _quantile(good, (1 + lower) / 2)
        deviation = _averaged(upper / 0.6745, many)
        high, low = logit(usual), logit(np.clip(missed[:, None] * joint, 1e-6, 1 - 1e-6))
        middle = (high + low) / 2
        separation = _averaged(high - low, many) / deviation
        tail = ndtr(-separation / 2)
        under = _other_share(_averaged(_below(good, middle), many), tail, separation)
        over = _other_share(1 - _averaged(_below(miss, middle), miss.sum(axis=-1)), tail, separation)
    behind = sums["scores"][:, 1, rows["good"]]
    hidden = np.minimum(_averaged(expit(_quantile(behind, 0.5)) / usual, behind.sum(axis=-1)), 1.0)
    factor = np.stack([np.ones_like(hidden), hidden], axis=1)[..., None] * joint[:, None]  # (R, 2, 9)

    def usual_of(name: str, share: Floats) -> Floats:
        """Return the usual score of a class, from the quantile ``share`` (R,) of its scores by visibility and kind."""
        row = sums["scores"][:, :, rows[name]]
        level = expit(_quantile(row, share[:, None, None])) / factor
        return _averaged(level.reshape(len(row), -1), row.sum(axis=-1).reshape(len(row), -1))

    result = {
        "scores.good": top,
        "scores.miss": usual_of("miss", (1 - over) / 2),
        "scores.hidden": hidden,
        "scores.deviation": deviation,
        "scores.overconfident": over,
        "scores.underconfident": under,
    }
    for name in ("jitter", "inversion", "swap"):
        result[f"scores.{name}"] = np.minimum(usual_of(name, np.full(len(top), 0.5)), 1.0)
    _put_by_kind(result, "scores.joint", joint)
    return result


def _other_share(beyond: Floats, tail: Floats, separation: Floats) -> Floats:
    """Return the share of a mixture that has the scores of the other class; 0 where both classes overlap too much.

    Args:
        beyond: share of the scores on the other class's side of the middle between both classes, (R,).
        tail: share expected there without any mixture, (R,).
        separation: distance of both classes in deviations, (R,).
    """
    share = np.clip((beyond - tail) / (1 - 2 * tail), 0.0, 1.0)
    return np.where(separation > _SEPARATED, share, 0.0)


def _averaged(values: Floats, counts: Floats) -> Floats:
    """Return the mean (R,) of values over kinds (R, 9), weighted by their counts (R, 9)."""
    known = np.isfinite(values) & (counts > 0)
    return (np.where(known, values, 0.0) * counts).sum(axis=1) / np.where(known, counts, 0.0).sum(axis=1)


def _quantile(counts: Floats, share: Floats | float) -> Floats:
    """Return quantiles (...) of histograms (..., B) over LOGITS; NaN for empty histograms."""
    total = counts.sum(axis=-1)
    below = np.concatenate([np.zeros((*total.shape, 1)), np.cumsum(counts, axis=-1)], axis=-1)
    rank = np.broadcast_to(share, total.shape) * total
    index = np.clip((below[..., 1:] < rank[..., None]).sum(axis=-1), 0, counts.shape[-1] - 1)[..., None]
    start = np.take_along_axis(below, index, axis=-1)[..., 0]
    inside = np.take_along_axis(counts, index, axis=-1)[..., 0]
    at = LOGITS[index[..., 0]] + (LOGITS[1] - LOGITS[0]) * (rank - start) / inside
    return np.where(total > 0, at, np.nan)


def _below(counts: Floats, level: Floats) -> Floats:
    """Return the share of histograms (..., B) over LOGITS below levels (...)."""
    filled = np.clip((level[..., None] - LOGITS[:-1]) / (LOGITS[1] - LOGITS[0]), 0.0, 1.0)
    return np.asarray((counts * filled).sum(axis=-1) / counts.sum(axis=-1))


def _people_parameters(sums: FrameSums, step: float) -> dict[str, Floats]:
    """Return the parameters of boxes and phantoms."""
    p = (sums["people.k"] / sums["people.n"])[:, None]
    weight = sums["people.time.n"] * p * (1 - p)
    missed_again = sums["people.time.k"] - sums["people.time.n"] * p**2
    rate = sums["false.n"] / sums["false.pairs"][:, :1]  # for each view, (R, V)
    spread = sums["false.products"] / sums["false.pairs"][:, None] - rate[..., None] ** 2
    spread = spread.sum(axis=1)
    row = sums["scores.false"]
    return {
        "boxes.missed": p[:, 0],
        "boxes.missed_views": tetrachoric_correlation(
            sums["people.views.k"], sums["people.views.n"][:, None] * joint_probability(p, p)[:, 0]
        ),
        "boxes.life": fit_life(lags(step), step, missed_again / weight, weight),
        "boxes.duplicates": sums["people.duplicates"] / sums["people.detected"],
        "size.fragments": sums["fragments.n"] / sums["false.pairs"][:, 0] / sums["false.n"].shape[1],
        "phantoms.rate": rate.mean(axis=1),
        "phantoms.life": fit_life(lags(step), step, spread[:, 1:] / spread[:, :1], np.ones_like(spread[:, 1:])),
        "phantoms.score": expit(_quantile(row, 0.5)),
        "phantoms.deviation": (_quantile(row, 0.75) - _quantile(row, 0.25)) / 1.349,
    }
