"""Figures from sums: the dials of the simulated detector at which it would err as the measured one does.

Every function takes sums of R resamples, arrays (R, ...), and gives figures (R,), NaN where nothing is known. The
figures are named as the keys of ``[detector]`` are.
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit, logit, ndtr

from mvpose.arrays import Floats
from simharness.detector.conditions import OCCLUDED, SELF_OCCLUDED
from simharness.reality.detector_fit.bias_fit import solve
from simharness.reality.detector_fit.frame_sums import LOGITS, SCORED, TERCILES, Sums, lags
from simharness.reality.detector_fit.joint_labels import CLASSES
from simharness.reality.detector_fit.occlusion import CONFUSION
from simharness.reality.detector_fit.tetrachoric import correlation, life, together
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS
from simharness.types.truth import GOOD_BELOW

LIMB_KINDS = tuple(sorted({KIND_OF_JOINT[joint] for joint in range(5, 17)}))
"""The kinds of joint whose truth is known."""

_WIDEST = 3.0  # units: a scatter as wide is flat within 1.14, and wider ones look the same
_LEAST = 200  # errors, from which on it can be told what they have to do with each other
_ROUNDS = 4
_TOLD_APART = 1.0  # deviations between the scores of hits and misses from which one can be taken for the other


def figures(sums: Sums, *, step: float) -> dict[str, Floats]:
    """All figures, by key; each (R,).

    Args:
        sums: of :func:`simharness.reality.detector_fit.frame_sums.count`, over the frames of R resamples.
        step: seconds from one frame to the next.
    """
    result: dict[str, Floats] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        n, k = ({key: sums[f"{name}.{key}"] for key in CLASSES} for name in ("n", "k"))
        share = {key: np.clip(k[key].sum(axis=1) / n[key].sum(axis=1), 0.0, 1.0) for key in CLASSES}
        for key in CLASSES:
            _spread(result, f"share.{key}", share[key])
        for key in ("swap", "inversion"):
            _spread(result, f"keypoints.{key}", share[key])
        dropped = _by_sight(n["drop"], k["drop"])
        for index, sight in enumerate(("visible", "self_occluded", "occluded")):
            _spread(result, f"keypoints.drop.{sight}", dropped[:, index])
        reported = _reported(dropped)
        result |= _harder(n, k, share, reported)
        _spread(result, "keypoints.scatter", _sigma(sums["scatter.square"] / sums["scatter.n"]))
        offset = solve(sums["bias.A"], sums["bias.b"])
        for index, way in enumerate(("forward", "outward", "up")):
            _spread(result, f"bias.{way}", np.where(sums["scatter.n"] > 0, offset[..., index], np.nan))
        beyond = sums["miss.beyond"] / sums["miss.n"]
        box, box_beyond = sums["miss.box"] / sums["miss.n"], sums["miss.box_beyond"] / sums["miss.n"]
        result["keypoints.stray"] = np.clip(beyond / (box_beyond + beyond * (1 - box)), 0.0, 1.0)
        result |= _dependence(sums, step)
        result |= _confidence(sums, 1 - reported[:, :, 0, 0])
        result |= _persons(sums, step)
        for index, third in enumerate(TERCILES):
            result[f"size.{third}.drop"] = sums["size.drop.k"][:, index] / sums["size.drop.n"][:, index]
            result[f"size.{third}.wrong"] = sums["size.k"][:, index] / sums["size.n"][:, index]
    return result


def _spread(result: dict[str, Floats], key: str, values: Floats) -> None:
    """Figures of each kind of joint, (R, 9), each under its own key."""
    for index, kind in enumerate(KINDS):
        result[f"{key}.{kind}"] = values[:, index]


def _by_sight(n: Floats, k: Floats, told_apart: Floats = CONFUSION) -> Floats:
    """Shares (R, 3, 9) of joints that truly are visible, hidden by their own body and hidden.

    Args:
        n: how many joints there were, by what skeletons tell, (R, 3, 9).
        k: how many of them were taken. Where nobody was in a class, the share of all is taken.
        told_apart: shares of what those joints truly are, (..., 9, 3, 3).
    """
    told = np.where(n > 0, k / n, (k.sum(axis=1) / n.sum(axis=1))[:, None])
    return np.clip(np.einsum("...kct,...tk->...ck", np.linalg.inv(told_apart), told), 0.0, 1.0)


def _reported(dropped: Floats) -> Floats:
    """CONFUSION among the joints that are reported, (R, 9, 3, 3): more of them are visible than of all.

    Args:
        dropped: shares that are not reported, (R, 3, 9).
    """
    left = CONFUSION * (1 - np.clip(dropped, 0.0, 0.95)).transpose(0, 2, 1)[:, :, None]
    return np.asarray(left / left.sum(axis=-1, keepdims=True))


def _harder(n: dict[str, Floats], k: dict[str, Floats], share: dict[str, Floats], left: Floats) -> dict[str, Floats]:
    """How much oftener hidden joints are missed or off, and the shares of visible ones from which that counts."""
    seen, expected, truly = np.zeros(()), np.zeros(()), {}
    for key in ("miss", "jitter"):
        wrong = _by_sight(n[key], k[key], left)
        truly[key] = np.einsum("rkec,rek->rck", left, n[key])
        seen = seen + np.nan_to_num(truly[key] * wrong).sum(axis=2)
        expected = expected + np.nan_to_num(truly[key] * wrong[:, :1]).sum(axis=2)
    factor = seen / expected  # (R, 3), 1 of visible ones
    result: dict[str, Floats] = {}
    for key in ("miss", "jitter"):
        mean = np.einsum("rc,rck->rk", np.where(np.isfinite(factor), factor, 1.0), truly[key]) / truly[key].sum(axis=1)
        _spread(result, f"keypoints.{key}", share[key] / mean)
    return result | {"keypoints.self_occluded": factor[:, SELF_OCCLUDED], "keypoints.occluded": factor[:, OCCLUDED]}


def _sigma(square: Floats) -> Floats:
    """The deviation, each way, of a Gaussian cut at 1.14 from the mean square of what is left (maximum likelihood)."""
    sigma = np.linspace(0.05, _WIDEST, 600)
    a = (GOOD_BELOW / sigma) ** 2 / 2
    left = 2 * sigma**2 * (1 - a / np.expm1(a))
    return np.where(np.isfinite(square), np.interp(square, np.append(0.0, left), np.append(0.0, sigma)), np.nan)


def _dependence(sums: Sums, step: float) -> dict[str, Floats]:
    enough = sum(sums[f"k.{key}"].sum(axis=(1, 2)) for key in CLASSES) >= _LEAST
    scatter = sums["scatter.later"] / sums["scatter.later_square"]
    return {
        "correlation.life": np.where(
            enough, life(lags(step), step, sums["time.excess"] / sums["time.weight"], sums["time.weight"]), np.nan
        ),
        "correlation.views": np.where(enough, correlation(sums["views.k"], sums["views.expected"]), np.nan),
        "correlation.limb": np.where(enough, correlation(sums["limb.k"], sums["limb.expected"]), np.nan),
        "correlation.scatter_life": life(lags(step), step, scatter, sums["scatter.later_square"]),
        "correlation.scatter_views": np.clip(
            sums["scatter.across"].sum(axis=1) / sums["scatter.space"].sum(axis=1), 0.0, 1.0
        ),
    }


def _confidence(sums: Sums, unseen: Floats) -> dict[str, Floats]:
    """Scores: usual ones by class, how they spread, and how many are taken from the wrong class.

    Args:
        sums: of R resamples.
        unseen: share of the joints taken for visible that are not, (R, 9): the lowest scores of those.
    """
    shown, whole = sums["scores"][:, 0], sums["scores"].sum(axis=1)  # (R, 6, 9, B), of visible joints and of all
    limbs = list(LIMB_KINDS)
    rows = {name: SCORED.index(name) for name in SCORED}
    good, miss = shown[:, rows["good"]], whole[:, rows["miss"]]
    many = shown[:, rows["good"]].sum(axis=-1)
    every = expit(_quantile(shown.sum(axis=1), 0.5))
    under = over = np.zeros(len(shown))
    for _ in range(_ROUNDS):
        # Of good ones, those with the score of a miss are the lowest, so that the median of the rest is higher up.
        lower = np.clip(under[:, None] + unseen, 0.0, 0.9)
        usual = expit(_quantile(good, (1 + lower) / 2))
        # Of the face, whose classes nobody knows, as much above the median of all as good limb joints are.
        usual = np.where(many > 0, usual, every * _averaged(usual / every, many)[:, None])
        top = np.nanmax(usual[:, limbs], axis=1)
        joint = usual / top[:, None]
        missed = _averaged(expit(_quantile(miss, ((1 - over) / 2)[:, None])) / joint, miss.sum(axis=-1))
        upper = _quantile(good, (3 + lower) / 4) - _quantile(good, (1 + lower) / 2)
        deviation = _averaged(upper / 0.6745, many)
        high, low = logit(usual), logit(np.clip(missed[:, None] * joint, 1e-6, 1 - 1e-6))
        middle = (high + low) / 2
        apart = _averaged(high - low, many) / deviation
        tail = ndtr(-apart / 2)
        under = _mixed(_averaged(_below(good, middle), many), tail, apart)
        over = _mixed(1 - _averaged(_below(miss, middle), miss.sum(axis=-1)), tail, apart)
    behind = sums["scores"][:, 1, rows["good"]]
    hidden = np.minimum(_averaged(expit(_quantile(behind, 0.5)) / usual, behind.sum(axis=-1)), 1.0)
    factor = np.stack([np.ones_like(hidden), hidden], axis=1)[..., None] * joint[:, None]  # (R, 2, 9)

    def usual_of(name: str, share: Floats) -> Floats:
        """Usual score of a class, from the quantile ``share`` (R,) of what it has by sight and kind."""
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
    _spread(result, "scores.joint", joint)
    return result


def _mixed(seen: Floats, tail: Floats, apart: Floats) -> Floats:
    """Share of a mixture that comes from the other class, of what lies on the other's side of the middle."""
    share = np.clip((seen - tail) / (1 - 2 * tail), 0.0, 1.0)
    return np.where(apart > _TOLD_APART, share, 0.0)


def _averaged(values: Floats, counts: Floats) -> Floats:
    """Mean over kinds (R, 9), as often as each was seen."""
    known = np.isfinite(values) & (counts > 0)
    return (np.where(known, values, 0.0) * counts).sum(axis=1) / np.where(known, counts, 0.0).sum(axis=1)


def _quantile(counts: Floats, share: Floats | float) -> Floats:
    """Quantiles (...) of histograms (..., B) over LOGITS; NaN of an empty one."""
    total = counts.sum(axis=-1)
    below = np.concatenate([np.zeros((*total.shape, 1)), np.cumsum(counts, axis=-1)], axis=-1)
    wanted = np.broadcast_to(share, total.shape) * total
    index = np.clip((below[..., 1:] < wanted[..., None]).sum(axis=-1), 0, counts.shape[-1] - 1)[..., None]
    start = np.take_along_axis(below, index, axis=-1)[..., 0]
    inside = np.take_along_axis(counts, index, axis=-1)[..., 0]
    at = LOGITS[index[..., 0]] + (LOGITS[1] - LOGITS[0]) * (wanted - start) / inside
    return np.where(total > 0, at, np.nan)


def _below(counts: Floats, level: Floats) -> Floats:
    """Share of histograms (..., B) over LOGITS below levels (...)."""
    filled = np.clip((level[..., None] - LOGITS[:-1]) / (LOGITS[1] - LOGITS[0]), 0.0, 1.0)
    return np.asarray((counts * filled).sum(axis=-1) / counts.sum(axis=-1))


def _persons(sums: Sums, step: float) -> dict[str, Floats]:
    p = (sums["people.k"] / sums["people.n"])[:, None]
    weight = sums["people.time.n"] * p * (1 - p)
    rate = sums["false.n"] / sums["false.pairs"][:, :1]  # of each view, (R, V)
    spread = sums["false.products"] / sums["false.pairs"][:, None] - rate[..., None] ** 2
    spread = spread.sum(axis=1)
    row = sums["scores.false"]
    return {
        "boxes.missed": p[:, 0],
        "boxes.missed_views": correlation(
            sums["people.views.k"], sums["people.views.n"][:, None] * together(p, p)[:, 0]
        ),
        "boxes.life": life(lags(step), step, (sums["people.time.k"] - sums["people.time.n"] * p**2) / weight, weight),
        "boxes.duplicates": sums["people.repeated"] / sums["people.found"],
        "size.fragments": sums["fragments.n"] / sums["false.pairs"][:, 0] / sums["false.n"].shape[1],
        "phantoms.rate": rate.mean(axis=1),
        "phantoms.life": life(lags(step), step, spread[:, 1:] / spread[:, :1], np.ones_like(spread[:, 1:])),
        "phantoms.score": expit(_quantile(row, 0.5)),
        "phantoms.deviation": (_quantile(row, 0.75) - _quantile(row, 0.25)) / 1.349,
    }
