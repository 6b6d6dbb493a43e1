"""Inference of parameters from measured values, of simulations whose measurement is known in closed form."""

from functools import partial

import numpy as np
import pytest
from scipy.special import expit, logit

from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.reality.detector_fit.inference import ROUNDS, infer
from simharness.scenario.sections.detector_section import KINDS

LIMBS = KINDS[3:]
SCATTER = {f"keypoints.scatter.{kind}": 0.2 + 0.05 * index for index, kind in enumerate(LIMBS)}
JITTER = {f"keypoints.jitter.{kind}": 0.03 + 0.01 * index for index, kind in enumerate(LIMBS)}
TRUE = {**SCATTER, **JITTER, "correlation.limb": 0.4, "phantoms.rate": 0.5}
PRIOR = {**dict.fromkeys(SCATTER, 0.4), **dict.fromkeys(JITTER, 0.04), "correlation.limb": 0.3, "phantoms.rate": 0.3}
NOISE = {"keypoints.scatter": 0.04, "keypoints.jitter": 0.1, "correlation.limb": 0.05, "phantoms.rate": 0.1}


def measure(values, rng):
    """Return measured values: scatter is measured too small, jitters are in part those of scatter, limb at half."""

    def noisy(key):
        scale = next(each for start, each in NOISE.items() if key.startswith(start))
        return scale * rng.standard_normal()

    result = {}
    for kind in LIMBS:
        sigma, share = values[f"keypoints.scatter.{kind}"], values[f"keypoints.jitter.{kind}"]
        key, other = f"keypoints.scatter.{kind}", f"keypoints.jitter.{kind}"
        result[key] = 0.7 * sigma**0.8 * np.exp(noisy(key))
        result[other] = (0.5 * share + 0.05 * sigma) * np.exp(noisy(other))
    result["correlation.limb"] = 0.5 * values["correlation.limb"] - 0.1 + noisy("correlation.limb")
    result["phantoms.rate"] = values["phantoms.rate"] * np.exp(noisy("phantoms.rate"))
    return result


def recording(seed):
    """Return the measured values of a recording, with intervals of their noise."""
    found = {}
    for key, value in measure(TRUE, np.random.default_rng([7, seed])).items():
        reach = 1.96 * next(each for start, each in NOISE.items() if key.startswith(start))
        ends = (value - reach, value + reach) if key == "correlation.limb" else value * np.exp([-reach, reach])
        found[key] = MeasuredValue(value, float(ends[0]), float(ends[1]), 100_000)
    return found


def simulate(values, draw, seed=0):
    return measure(values, np.random.default_rng([11, seed, draw]))


@pytest.fixture(scope="module")
def inferred():
    return [infer(recording(seed), partial(simulate, seed=seed), PRIOR) for seed in range(40)]


def test_bias_of_the_measurement_is_removed(inferred):
    for key, true in TRUE.items():
        found = np.array([each[key].value for each in inferred])
        raw = np.mean([recording(seed)[key].value for seed in range(40)])
        error, before = abs(found.mean() / true - 1), abs(raw / true - 1)
        assert error < max(0.1, 0.5 * before), (key, error, before)
    scatter = np.array([[each[key].value / true for key, true in SCATTER.items()] for each in inferred])
    np.testing.assert_allclose(scatter.mean(axis=0), 1.0, atol=0.05)


def test_intervals_hold_the_truth_as_often_as_they_say(inferred):
    inside = [[each[key].low <= true <= each[key].high for key, true in TRUE.items()] for each in inferred]
    assert 0.9 < np.mean(inside) < 0.995
    widths = [np.log(each["keypoints.scatter.hips"].high / each["keypoints.scatter.hips"].low) for each in inferred]
    # The noise of the recording over the slope of 0.8, and a little of that of the simulations.
    assert np.mean(widths) == pytest.approx(2 * 1.96 * 0.04 / 0.8, rel=0.35)


def test_what_cannot_be_seen_is_the_prior(inferred):
    key = "phantoms.rate"

    def without(values, draw):
        return {**simulate(values, draw), key: 0.8 + 0.1 * np.random.default_rng([13, draw]).random()}

    found = infer(recording(0), without, PRIOR)[key]
    assert found.by_prior
    assert found.value == pytest.approx(PRIOR[key], rel=0.35)
    assert found.low < 0.5 * PRIOR[key] < 2 * PRIOR[key] < found.high
    assert not inferred[0][key].by_prior


def test_unknown_values_are_the_priors_and_others_stay():
    measured = recording(0)
    measured["phantoms.rate"] = MeasuredValue(np.nan, np.nan, np.nan, 0)
    measured["scores.inversion"] = MeasuredValue(np.nan, np.nan, np.nan, 0)  # neither known nor in the prior
    measured["boxes.duplicates"] = MeasuredValue(0.1, 0.05, 0.2, 50)  # not inferred
    found = infer(measured, simulate, PRIOR)
    assert found["phantoms.rate"].value == pytest.approx(PRIOR["phantoms.rate"])
    assert found["phantoms.rate"].by_prior
    assert found["boxes.duplicates"] == measured["boxes.duplicates"]
    assert not found["scores.inversion"].known


def test_events_that_never_happened_are_rare():
    """No event in a thousand trials, where the prior expects forty."""
    key = "keypoints.jitter.hips"
    never = {key: MeasuredValue(0.0, 0.0, 0.003, 1000)}

    def count(values, draw):
        return {key: np.random.default_rng([17, draw]).binomial(1000, values[key]) / 1000}

    found = infer(never, count, {key: 0.04})[key]
    assert 0 < found.value < 0.006
    assert found.high < 0.02


def test_without_rounds_nothing_changes():
    measured = recording(0)
    assert infer(measured, simulate, PRIOR, rounds=0) == measured


def test_inversions_at_no_distance_are_extrapolated_with_their_uncertainty():
    """A recording tells how frequent inversions are at some distance; the reach is only the prior's."""
    key, reach, scale = "keypoints.inversion.knees", "keypoints.inversion_reach", 0.2
    measured = {key: MeasuredValue(0.02, 0.018, 0.022, 100_000), reach: MeasuredValue(np.nan, np.nan, np.nan, 0)}

    def seen(values, draw):
        return {key: values[key] * np.exp(-scale / values[reach]), reach: np.nan}

    found = infer(measured, seen, {key: 0.01, reach: 0.3})
    assert found[reach].by_prior
    assert found[reach].value == pytest.approx(0.3)
    assert found[key].value == pytest.approx(0.02 * np.exp(scale / 0.3), rel=0.1)
    ends = [0.02 * np.exp(scale / found[reach].value * (1 + 0.7 * side * 1.96)) for side in (-1, 1)]
    assert [found[key].low, found[key].high] == pytest.approx(ends, rel=0.2)


def test_one_value_of_several_kinds_counts_once():
    """Strays of all kinds of joint are one measured value: its error is the error of each parameter."""
    keys = [f"keypoints.stray.{kind}" for kind in LIMBS]
    measured = dict.fromkeys(keys, MeasuredValue(0.3, 0.25, 0.35, 200))
    prior = dict.fromkeys(keys, 0.3)
    found = infer(measured, lambda values, draw: dict.fromkeys(keys, np.mean([values[key] for key in keys])), prior)
    alone = infer({keys[0]: measured[keys[0]]}, lambda values, draw: values, {keys[0]: 0.3})[keys[0]]
    assert found[keys[0]].high - found[keys[0]].low > alone.high - alone.low
    counts = {key: MeasuredValue(0.3, 0.25, 0.35, 200 + index) for index, key in enumerate(keys)}
    counted = infer(counts, lambda values, draw: dict.fromkeys(keys, np.mean([values[key] for key in keys])), prior)
    assert counted[keys[0]].high - counted[keys[0]].low > 0.95 * (found[keys[0]].high - found[keys[0]].low)


def test_other_parameters_are_told_apart_by_what_they_do():
    """Scatter and jitters both raise the measured share of jitters; scatter is also measured by itself."""
    prior = {**dict.fromkeys(SCATTER, 0.4), **dict.fromkeys(JITTER, 0.04)}
    near = {**{key: 0.9 * TRUE[key] for key in SCATTER}, **{key: TRUE[key] for key in JITTER}}

    def seen(values, draw):
        result = {}
        for kind in LIMBS:
            scatter, jitter = f"keypoints.scatter.{kind}", f"keypoints.jitter.{kind}"
            result[scatter] = 0.9 * values[scatter]
            result[jitter] = 0.5 * values[jitter] + 0.3 * values[scatter] ** 2
        return result

    exact = {key: MeasuredValue(each, 0.95 * each, 1.05 * each, 100_000) for key, each in seen(near, 0).items()}
    found = infer(exact, seen, prior)
    for key, true in near.items():
        assert found[key].value == pytest.approx(true, rel=0.12), key


def test_people_who_are_seen_less_hidden_than_they_are():
    """In half of the cases the film shows people less hidden than the recording: measured shares are mixtures."""
    true = [0.01, 0.05, 0.2, 0.6, 0.9]

    def mixed(values, rng):
        shares = np.array([values[f"boxes.missed_hidden.{index}"] for index in range(5)])
        seen = (shares + np.append(shares[1:], 1.0)) / 2
        return {f"boxes.missed_hidden.{index}": rng.binomial(2000, each) / 2000 for index, each in enumerate(seen)}

    real = mixed({f"boxes.missed_hidden.{index}": each for index, each in enumerate(true)}, np.random.default_rng(5))
    reach = {key: 1.96 * np.sqrt(value * (1 - value) / 2000) for key, value in real.items()}
    measured = {key: MeasuredValue(each, each - reach[key], each + reach[key], 2000) for key, each in real.items()}
    prior = {key: each for key, each in zip(real, [0.02, 0.1, 0.3, 0.5, 0.8], strict=True)}
    found = infer(measured, lambda values, draw: mixed(values, np.random.default_rng([6, draw])), prior)
    for key, each in zip(real, true, strict=True):
        assert abs(found[key].value - each) < 0.4 * max(abs(real[key] - each), 0.02), (key, found[key], real[key])


def test_uncovered_joints_are_inferred_with_a_factor_that_few_hidden_ones_tell():
    """Of 10,000 joints 20 are behind others: the share of uncovered ones is known, their factor is the prior's."""
    key, factor, share = "keypoints.swap.knees", "keypoints.swap_uncovered", "share.swap.knees"
    covered, whole = 20, 10_000

    def seen(values, draw):
        hidden = values[key] * covered
        return {share: (hidden + values[key] * values[factor] * (whole - covered)) / whole, key: 0.5, factor: np.nan}

    real = seen({key: 0.02, factor: 1.0}, 0)
    measured = {
        share: MeasuredValue(real[share], 0.018, 0.022, whole),
        key: MeasuredValue(0.02, 0.0, 1.0, whole),
        factor: MeasuredValue(np.nan, np.nan, np.nan, 0),
    }
    found = infer(measured, seen, {key: 0.02, factor: 0.08})
    assert found[key].value * found[factor].value == pytest.approx(0.02, rel=0.15)
    assert found[factor].by_prior
    assert found[key].by_prior  # as far as the factor is
    assert found[factor].low < 0.02
    assert found[factor].high == 1.0
    assert found[key].low < 0.02
    assert found[key].high > 0.3


def test_what_changes_drops_is_unknown_where_nothing_is_dropped():
    depth, share = "keypoints.drop.depth", "keypoints.drop.occluded.knees"
    unknown = MeasuredValue(np.nan, np.nan, np.nan, 0)
    prior = {depth: 10.0, share: 0.1}
    for dropped in (0.0, 0.1):
        measured = {depth: unknown, share: MeasuredValue(dropped, dropped, dropped + 0.01, 1000)}
        found = infer(measured, lambda values, draw: {share: values[share], depth: np.nan}, prior)
        assert found[depth].known == (dropped > 0)


def test_intervals_of_values_that_are_not_inferred_are_as_wide_as_simulations():
    """Scores of joints vary three times as much as the bootstrap says, those of people as much."""
    joints = [f"scores.joint.{kind}" for kind in KINDS]
    key, drawn = "keypoints.jitter.knees", {**dict.fromkeys(joints, 0.03), "phantoms.life": 0.01}
    measured = {each: MeasuredValue(0.5, 0.5 - 1.96 * 0.01, 0.5 + 1.96 * 0.01, 500) for each in drawn}
    measured[key] = MeasuredValue(0.04, 0.03, 0.05, 1000)

    def seen(values, draw):
        rng = np.random.default_rng([19, draw])
        return {each: 0.5 + sigma * rng.standard_normal() for each, sigma in drawn.items()} | {key: values[key]}

    found = infer(measured, seen, {key: 0.04})
    assert found[joints[0]].high - found[joints[0]].low == pytest.approx(2 * 1.96 * 0.03, rel=0.35)
    assert found["phantoms.life"].high - found["phantoms.life"].low < 2 * 1.96 * 0.02
    assert {found[each].value for each in drawn} == {0.5}


def test_noise_of_a_value_says_little_of_other_parameters():
    """Scores vary six times as much between simulations as their intervals say, also with the same draws."""
    shares, noisy = [f"keypoints.stray.{kind}" for kind in LIMBS], [f"scores.guess.{kind}" for kind in LIMBS]
    measured = dict.fromkeys(noisy, MeasuredValue(0.4, 0.38, 0.42, 1000))
    measured |= dict.fromkeys(shares, MeasuredValue(np.nan, np.nan, np.nan, 0))
    away = []
    for seed in range(24):

        def seen(values, draw, seed=seed):
            rng = np.random.default_rng([23, seed, int(1e6 * sum(values.values())) + draw])
            return {key: values[key] + 0.12 * rng.standard_normal() for key in noisy}

        found = infer(measured, seen, {**dict.fromkeys(shares, 0.3), **dict.fromkeys(noisy, 0.4)})
        away.append(max(abs(found[key].value - 0.3) for key in shares))
    assert np.mean(away) < 0.09


def test_a_parameter_that_was_led_where_its_value_is_flat_comes_back():
    """The first simulations measure too much, so that the slope is found where there is none."""
    keys, true = list(SCATTER), 0.25

    def broadened(values, draw):
        rng = np.random.default_rng([37, draw])
        extra = 0.6 if draw < ROUNDS else 0.0
        return {key: float(np.hypot(values[key], 0.2) * np.exp(extra + 0.05 * rng.standard_normal())) for key in keys}

    values = broadened(dict.fromkeys(keys, true), 10**6)
    measured = {
        key: MeasuredValue(each, each * np.exp(-0.1), each * np.exp(0.1), 100_000) for key, each in values.items()
    }
    found = infer(measured, broadened, dict.fromkeys(keys, 0.8))
    assert all(found[key].value == pytest.approx(true, rel=0.3) for key in keys)


def test_an_effect_that_all_kinds_of_joint_share_is_told_where_that_on_each_is_not():
    """Scores tell shares that nothing else measures: their logit follows with a slope of 0.2."""
    shares, scores = [f"keypoints.stray.{kind}" for kind in LIMBS], [f"scores.guess.{kind}" for kind in LIMBS]
    prior = {**dict.fromkeys(shares, 0.3), **dict.fromkeys(scores, 0.5)}
    found = []
    measured = dict.fromkeys(shares, MeasuredValue(np.nan, np.nan, np.nan, 0))
    for index, key in enumerate(scores):  # values that are alike would count once
        low, value, high = expit(0.6 + 0.01 * index + np.array([-0.5, 0.0, 0.5]))
        measured[key] = MeasuredValue(float(value), float(low), float(high), 1000)
    for seed in range(8):

        def seen(values, draw, seed=seed):
            rng = np.random.default_rng([41, seed, int(1e6 * sum(values[key] for key in shares)) + draw])
            moved = {score: logit(values[share]) - logit(0.3) for share, score in zip(shares, scores, strict=True)}
            return {score: float(expit(0.2 * each + 0.03 * rng.standard_normal())) for score, each in moved.items()}

        inferred = infer(measured, seen, prior)
        found.append(np.mean([logit(inferred[key].value) for key in shares]))
    assert 1.0 < np.mean(found) - logit(0.3) < 3.0  # the prior holds back a part of the 3 that the scores say
