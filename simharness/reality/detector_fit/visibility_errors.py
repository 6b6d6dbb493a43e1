"""Misses and jitters of joints that are visible, self-occluded, or behind others.

A detector misses a share m of the visible joints, jitters a share j, and has a factor f on both for hidden joints: of
the joints in a state, w = 1 - (1 - m f) (1 - j f) are wrong. What a recording says of them is a table of counts, misses
and jitters in each state. Joints of different states are different joints, and given how many are wrong in each, how
many of these are misses says nothing more about the states. So the likelihood is the product of four, each with one
unknown: the share of wrong joints in each of the three states, and the share of misses among the wrong.

A factor as such is a ratio of two of these shares, with the errors of both: where visible joints hardly ever err, it
hardly says how often hidden ones do. Their share does.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.special import expit, logit

from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.reality.detector_fit.parameters import SHARES
from simharness.scenario.sections.detector_section import KINDS, LARGEST_MULTIPLE

PARAMETERS = ("keypoints.miss", "keypoints.jitter", "keypoints.self_occluded", "keypoints.occluded")
"""Keys of the parameters at which a detector has the shares of SHARES."""

HIDDEN_ODDS = 20.0
"""Odds of errors of hidden joints over those of visible ones: of gross errors of OpenPose in an operating room (MVOR),
.02 and .28 of the shoulders, .04 and .44 of the elbows, .04 and .48 of the wrists: 19, 19 and 22 times the odds."""


def independent(values: Mapping[str, MeasuredValue]) -> dict[str, MeasuredValue]:
    """Return measured values without the parameters of the kinds of joint whose four shares are among them.

    Shares of other kinds, whose parameters are measured as such, are left out.
    """
    whole = {kind for kind, keys in _keys(SHARES) if all(key in values for key in keys)}
    left_out = {key for kind, keys in _keys(PARAMETERS) if kind in whole for key in keys}
    left_out |= {key for kind, keys in _keys(SHARES) if kind not in whole for key in keys}
    return {key: each for key, each in values.items() if key not in left_out}


def with_parameters(values: Mapping[str, float]) -> dict[str, float]:
    """Return values with the parameters at which a detector has their shares, where these are known."""
    result = dict(values)
    for (_, shares), (_, keys) in zip(_keys(SHARES), _keys(PARAMETERS), strict=True):
        visible, *hidden, gross = (values.get(key, np.nan) for key in shares)
        visible = max(visible, *(2 * wrong / LARGEST_MULTIPLE for wrong in hidden))  # the largest factor reaches them
        miss = visible * gross
        if miss > 0:
            jitter = (visible - miss) / (1 - miss)
            whole, product = miss + jitter, miss * jitter
            # The smaller root of 1 - (1 - m f) (1 - j f) = w.
            factors = (2 * wrong / (whole + np.sqrt(max(whole**2 - 4 * product * wrong, 0.0))) for wrong in hidden)
            result |= dict(zip(keys, map(float, (miss, jitter, *factors)), strict=True))
    return result


def measured_parameters(inferred: Mapping[str, MeasuredValue]) -> dict[str, MeasuredValue]:
    """Return the parameters at which a detector has inferred shares, with 95 % intervals as of independent shares.

    Args:
        inferred: values by key, shares and parameters.
    """
    result = {}
    for (_, shares), (_, keys) in zip(_keys(SHARES), _keys(PARAMETERS), strict=True):
        if not all(key in inferred for key in (*shares, *keys)):
            continue
        at = {key: inferred[key].value for key in shares}
        found = with_parameters(at)
        ends = [with_parameters({**at, key: end}) for key in shares for end in (inferred[key].low, inferred[key].high)]
        for key, share in zip(keys, np.roll(shares, 1), strict=True):  # the share that says most of each parameter
            away = np.log([each[key] / found[key] for each in ends])
            low, high = (found[key] * np.exp(side * np.linalg.norm(np.fmax(side * away, 0.0))) for side in (-1, 1))
            result[key] = MeasuredValue(
                found[key], float(low), float(high), inferred[key].count, inferred[share].by_prior
            )
    return result


def prior_shares(prior: Mapping[str, float]) -> dict[str, float]:
    """Return a prior with the shares of a detector whose hidden joints err by :data:`HIDDEN_ODDS` more often."""
    result: dict[str, float] = {}
    for (_, shares), (_, (miss, jitter, *_rest)) in zip(_keys(SHARES), _keys(PARAMETERS), strict=True):
        m, j = prior.get(miss, 0.0), prior.get(jitter, 0.0)
        visible = m + j - m * j
        if 0 < visible < 1 and m > 0:
            hidden = float(expit(logit(visible) + np.log(HIDDEN_ODDS)))
            result |= dict(zip(shares, (visible, hidden, hidden, m / visible), strict=True))
    return {**result, **prior}


def _keys(groups: tuple[str, ...]) -> Iterator[tuple[str, list[str]]]:
    """Yield each kind of joint and the keys of some groups of it."""
    for kind in KINDS:
        yield kind, [f"{group}.{kind}" for group in groups]
