"""Distances of jitters: between the bounds, with the asked mean, uniform where it is a half."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.detector.error_classes import jitter_distance
from simharness.types.truth import GOOD_BELOW, MISS_FROM

SHARES = (np.arange(20_000) + 0.5) / 20_000  # the mean over them is the integral


def way(share, mean):
    """Return the distances as shares of the way from 1.14 to 2.35."""
    distance = jitter_distance(np.asarray(share, float), np.full(np.shape(share), mean))
    return (distance - GOOD_BELOW) / (MISS_FROM - GOOD_BELOW)


@given(mean=st.floats(0.03, 0.97))
def test_the_mean_is_as_asked(mean):
    assert way(SHARES, mean).mean() == pytest.approx(mean, abs=2e-3)


@given(mean=st.floats(0.0, 1.0))
def test_distances_grow_with_the_share_within_the_bounds(mean):
    found = way([0.0, 1e-6, 0.2, 0.5, 0.8, 1 - 1e-6, 1.0], mean)
    assert (np.diff(found) > 0).all()
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    assert found[-1] == pytest.approx(1.0, abs=1e-9)


@given(mean=st.floats(0.03, 0.48), share=st.floats(0.0, 1.0))
def test_a_mean_beyond_the_middle_is_the_mirror_image(mean, share):
    assert way([share], mean) == pytest.approx(1 - way([1 - share], 1 - mean), abs=1e-6)


def test_a_half_is_uniform():
    np.testing.assert_array_equal(
        jitter_distance(SHARES, np.full(len(SHARES), 0.5)), GOOD_BELOW + (MISS_FROM - GOOD_BELOW) * SHARES
    )


def test_each_joint_has_its_own_mean():
    mean = np.array([0.2, 0.5, 0.8, 0.2])
    found = jitter_distance(np.full(4, 0.5), mean)
    assert found[0] == found[3] < found[1] < found[2]


@given(mean=st.floats(0.05, 0.95), farthest=st.floats(4.0, 20.0))
def test_misses_have_their_mean_on_the_way_to_their_reach(mean, farthest):
    found = jitter_distance(SHARES, np.full(len(SHARES), mean), nearest=MISS_FROM, farthest=farthest)
    assert MISS_FROM <= found.min() < found.max() <= farthest
    assert (found.mean() - MISS_FROM) / (farthest - MISS_FROM) == pytest.approx(mean, abs=2e-3)
