"""Parameters of the scores of a detector, estimated from the histograms of sums of R resamples, (R,) each."""

import numpy as np
from scipy.special import expit, logit, ndtr

from mvpose.arrays import Floats
from simharness.reality.detector_fit.detector_sums import FrameSums
from simharness.reality.detector_fit.frame_sums import LOGITS, SCORED
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS

LIMB_KINDS = tuple(sorted({KIND_OF_JOINT[joint] for joint in range(5, 17)}))
"""Kinds of joint whose truth is known."""

_ROUNDS = 4
_MIN_HIDDEN = 20  # joints of a kind needed to say something about the kind
_SEPARATED = 1.0  # deviations between scores of good keypoints and misses from which mixtures can be separated


def score_parameters(sums: FrameSums) -> dict[str, Floats]:
    """Return the parameters of scores: usual scores by class, deviation, shares of over- and underconfident ones.

    Args:
        sums: sums of R resamples.
    """
    shown, whole = sums.scores.shown[:, 0], sums.scores.shown.sum(axis=1)  # (R, 6, 9, B), of visible joints and of all
    limbs = list(LIMB_KINDS)
    rows = {name: SCORED.index(name) for name in SCORED}
    good, miss = shown[:, rows["good"]], whole[:, rows["miss"]]
    many = shown[:, rows["good"]].sum(axis=-1)
    every = expit(quantile(shown.sum(axis=1), 0.5))
    under = over = np.zeros(len(shown))
    for _ in range(_ROUNDS):
        # Good keypoints with the score of a miss have the lowest scores: the median of the others is a higher quantile.
        lower = np.clip(under[:, None] + np.zeros(good.shape[:2]), 0.0, 0.9)
        usual = expit(quantile(good, (1 + lower) / 2))
        # The classes of the face are unknown: its usual score is above its median as for good limb joints.
        usual = np.where(many > 0, usual, every * averaged(usual / every, many)[:, None])
        top = averaged(usual[:, limbs], many[:, limbs])
        joint = usual / top[:, None]
        missed = averaged(expit(quantile(miss, ((1 - over) / 2)[:, None])) / joint, miss.sum(axis=-1))
        upper = quantile(good, (3 + lower) / 4) - quantile(good, (1 + lower) / 2)
        deviation = averaged(upper / 0.6745, many)
        high, low = logit(usual), logit(np.clip(missed[:, None] * joint, 1e-6, 1 - 1e-6))
        middle = (high + low) / 2
        separation = averaged(high - low, many) / deviation
        tail = ndtr(-separation / 2)
        under = _other_share(averaged(_below(good, middle), many), tail, separation)
        over = _other_share(1 - averaged(_below(miss, middle), miss.sum(axis=-1)), tail, separation)
    behind = sums.scores.shown[:, 1, rows["good"]]
    hidden = np.minimum(averaged(expit(quantile(behind, 0.5)) / usual, behind.sum(axis=-1)), 1.0)

    def usual_of(name: str, share: Floats, visibility: int) -> Floats:
        """Return the usual score of a class, from the quantile ``share`` (R,) of its scores by kind."""
        row = sums.scores.shown[:, visibility, rows[name]]
        level = expit(quantile(row, share[:, None])) / joint
        return averaged(level, np.where(np.isfinite(level), row.sum(axis=-1), 0.0))

    result = {
        "scores.good": top,
        "scores.hidden.good": hidden,
        "scores.deviation": deviation,
        "scores.overconfident": over,
        "scores.underconfident": under,
    }
    middle_rank = np.full(len(top), 0.5)
    ranks = {"miss": (1 - over) / 2, "jitter": middle_rank, "inversion": middle_rank, "swap": middle_rank}
    for name, share in ranks.items():
        level, behind_level = usual_of(name, share, 0), usual_of(name, share, 1)
        level = np.where(np.isfinite(level), level, behind_level)
        result[f"scores.{name}"] = np.minimum(level, 1.0)
        lower = np.where(np.isfinite(behind_level), behind_level / level, hidden)
        result[f"scores.hidden.{name}"] = np.clip(lower, 0.0, 1.0)
    result |= {f"scores.joint.{kind}": joint[:, index] for index, kind in enumerate(KINDS)}
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


def averaged(values: Floats, counts: Floats) -> Floats:
    """Return the mean (R,) of values over kinds (R, 9), weighted by their counts (R, 9)."""
    known = np.isfinite(values) & (counts > 0)
    return (np.where(known, values, 0.0) * counts).sum(axis=1) / np.where(known, counts, 0.0).sum(axis=1)


def quantile(counts: Floats, share: Floats | float) -> Floats:
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


def guess_scores(sums: FrameSums) -> dict[str, Floats]:
    """Return the usual scores of guesses by kind, NaN of few, and the factor of those outside of the image."""
    wrong = sums.scores.shown[:, 1, SCORED.index("miss")]
    pooled = expit(quantile(wrong.sum(axis=1), 0.5))[:, None]
    level = np.where(wrong.sum(axis=-1) >= _MIN_HIDDEN, expit(quantile(wrong, 0.5)), np.nan)
    outside = expit(quantile(sums.scores.outside, 0.5))
    result = {"scores.outside": np.minimum(outside / pooled[:, 0], 1.0)}
    result |= {f"scores.guess.{kind}": level[:, index] for index, kind in enumerate(KINDS)}
    return result
