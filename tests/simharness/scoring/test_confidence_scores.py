"""Calibration of the confidence of estimates: coverage of ellipsoids, Brier score."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings import NO_PEOPLE, perfect_estimates, record, with_ghost
from scipy.spatial.transform import Rotation

from simharness.scoring.assessment import assess
from simharness.scoring.catalogue import SCORES
from simharness.scoring.joint_errors import brier, inside


def gaussian_estimates(recording, *, claimed=1.0, seed=0):
    """Return estimates with Gaussian errors of known, elongated covariance, and ``claimed`` times that covariance."""
    rng = np.random.default_rng(seed)
    estimates = []
    for estimate in perfect_estimates(recording):
        factors = 0.02 * Rotation.random(estimate.scores.size, rng=rng).as_matrix() * [1.0, 2.0, 0.5]
        factors = factors.reshape(*estimate.scores.shape, 3, 3)
        off = np.einsum("njrc,njc->njr", factors, rng.standard_normal(estimate.joints.shape))
        covariance = claimed * factors @ factors.swapaxes(-1, -2)
        estimates.append(replace(estimate, joints=estimate.joints + off, covariance=covariance))
    return estimates


def test_gaussian_errors_of_the_claimed_covariance_have_a_coverage_of_90():
    recording = record(60, 3)  # 3060 joints: a standard deviation of 0.54 points
    assert assess(recording, gaussian_estimates(recording)).scores["coverage_90"] == pytest.approx(90.0, abs=1.7)


def test_covariances_that_claim_too_much_or_too_little_miss_the_target():
    recording = record(60, 3)
    half, double = (
        assess(recording, gaussian_estimates(recording, claimed=c)).scores["coverage_90"] for c in (0.5, 2.0)
    )
    # P(chi-square with 3 degrees of freedom <= 6.25 / 2) = 0.627 and P(... <= 2 x 6.25) = 0.994
    assert half == pytest.approx(62.7, abs=2.8)
    assert double == pytest.approx(99.4, abs=0.5)
    assert SCORES["coverage_90"].target == 90.0


@given(st.integers(0, 999))
def test_an_ellipsoid_holds_what_lies_between_its_axes(seed):
    rng = np.random.default_rng(seed)
    axes, lengths = Rotation.random(rng=rng).as_matrix(), rng.uniform(0.01, 0.2, 3)
    ellipsoid = axes @ np.diag(lengths**2) @ axes.T
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    surface = axes @ (lengths * direction)
    assert inside(0.999 * surface, np.zeros(3), ellipsoid) == 1.0
    assert inside(1.001 * surface, np.zeros(3), ellipsoid) == 0.0


def test_unknown_and_singular_ellipsoids():
    truth, estimate = np.zeros((4, 3)), np.zeros((4, 3))
    truth[0], estimate[1] = np.nan, np.nan
    ellipsoid = np.tile(np.eye(3), (4, 1, 1))
    ellipsoid[2], ellipsoid[3] = np.nan, np.diag([1.0, 1.0, 0.0])
    np.testing.assert_array_equal(inside(truth, estimate, ellipsoid), [np.nan, np.nan, np.nan, 0.0])


def test_ghosts_do_not_count_for_coverage_and_a_method_without_covariance_has_none():
    recording = record()
    estimates = gaussian_estimates(recording)
    before = assess(recording, estimates).scores["coverage_90"]
    ghosts = []
    for estimate in estimates:
        ghost = with_ghost(replace(estimate, covariance=None))
        ghosts.append(replace(ghost, covariance=np.concatenate([estimate.covariance, estimate.covariance[:1]])))
    assert assess(recording, ghosts).scores["coverage_90"] == before
    assert assess(recording, perfect_estimates(recording)).scores["coverage_90"] is None


def test_the_brier_score_is_least_for_the_true_probability():
    rng = np.random.default_rng(0)
    happened = rng.random(20_000) < 0.7
    values = {claimed: brier(np.full(20_000, claimed), happened) for claimed in (0.5, 0.6, 0.7, 0.8, 0.9)}
    assert min(values, key=values.get) == 0.7
    assert values[0.7] == pytest.approx(0.7 * 0.3, abs=0.01)
    assert values[0.5] == 0.25
    assert brier([], np.zeros(0, bool)) is None


def test_the_brier_score_of_people_and_ghosts():
    recording = record()
    sure = [replace(each, scores=np.ones_like(each.scores)) for each in perfect_estimates(recording)]
    assert assess(recording, sure).scores["score_brier"] == 0.0
    halved = [replace(each, scores=each.scores / 2) for each in sure]
    assert assess(recording, halved).scores["score_brier"] == 0.25
    ghosts = [with_ghost(each, score=1.0) for each in sure]  # two people and a ghost
    assert assess(recording, ghosts).scores["score_brier"] == pytest.approx(1 / 3)
    displaced = [replace(each, joints=each.joints + [0.0, 0.0, 0.11]) for each in sure]
    assert assess(recording, displaced).scores["score_brier"] == 1.0
    assert assess(recording, [NO_PEOPLE] * len(recording)).scores["score_brier"] is None
