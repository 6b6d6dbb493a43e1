"""Parts of scatter: what joints and views share, and what is new in every frame."""

import numpy as np
import pytest
from worlds import RATE, find, standing, world

from simharness.detector.viewing_conditions import Conditions
from simharness.types.truth import GOOD_BELOW
from simharness.types.views import Visibility


def offsets(where, **correlation):
    """Return the scatter in units, (T, V, P, 17, 2)."""
    found = find(where, scatter=0.3, correlation=correlation)
    return (found.pixels - where.views.pixels) / Conditions.of_views(where.views).unit[..., None]


def correlated(one, other):
    return np.corrcoef(one.ravel(), other.ravel())[0, 1]


PARTS = [
    {"scatter_near": 0.4},
    {"scatter_near": 0.5, "scatter_views": 0.5},
    {"scatter_noise": 0.3, "scatter_life": 0.2},
    {"scatter_near": 0.3, "scatter_views": 0.2, "scatter_noise": 0.2, "scatter_life": 0.2},
]


@pytest.mark.parametrize("parts", PARTS, ids="-".join)
def test_the_distribution_of_scatter_is_the_same(parts):
    off = np.linalg.norm(offsets(world(frames=2000, views=2), **parts), axis=-1)
    assert off.max() < GOOD_BELOW
    # Rayleigh with 0.3, of which exp(-7.2) is beyond 1.14.
    for quantile in (0.1, 0.5, 0.9):
        expected = 0.3 * np.sqrt(-2 * np.log1p(-quantile * -np.expm1(-0.5 * (GOOD_BELOW / 0.3) ** 2)))
        assert np.quantile(off, quantile) == pytest.approx(expected, rel=0.04)


def test_scatter_is_correlated_along_the_skeleton():
    off = offsets(world(frames=3000, views=2), scatter_near=0.5)
    # Truncation at 1.14 changes correlations by less than the tolerance.
    for one, other, bones in ((9, 7, 1), (9, 5, 2), (15, 11, 2), (9, 15, 5), (5, 6, 1), (9, 10, 5)):
        assert correlated(off[..., one, :], off[..., other, :]) == pytest.approx(0.5**bones, abs=0.03)
    assert correlated(off[:, 0], off[:, 1]) == pytest.approx(0.0, abs=0.02)
    assert correlated(off[:, :, 0], off[:, :, 1]) == pytest.approx(0.0, abs=0.02)


def test_a_share_is_new_in_every_frame():
    off = offsets(world(frames=3000, views=2, people=1), scatter_noise=0.3, scatter_life=0.5)
    for lag in (1, 3, 8):
        expected = 0.7 * np.exp(-lag / RATE / 0.5)
        assert correlated(off[lag:], off[:-lag]) == pytest.approx(expected, abs=0.03)


def test_parts_together_keep_their_shares():
    where = world(frames=4000, views=2, people=1)
    off = offsets(where, scatter_near=0.5, scatter_views=0.4, scatter_noise=0.2, scatter_life=1.0)
    assert correlated(off[..., 9, :], off[..., 7, :]) == pytest.approx(0.6 * 0.5, abs=0.05)
    # The cameras stand side by side: down is the same in both pictures.
    assert correlated(off[:, 0, ..., 1], off[:, 1, ..., 1]) == pytest.approx(0.4, abs=0.05)


def test_hidden_joints_have_their_own_scatter():
    seen = np.where(np.arange(17) < 9, Visibility.VISIBLE, Visibility.SELF_OCCLUDED)
    where = standing(2000, visibility=seen)
    plain, more = (find(where, scatter=0.2, scatter_hidden=factor) for factor in (1.0, 2.0))
    unit = Conditions.of_views(where.views).unit[..., None]
    off = (more.pixels - where.views.pixels) / unit
    assert off[..., 9:, :].std() == pytest.approx(0.4, rel=0.05)
    np.testing.assert_array_equal(more.pixels[..., :9, :], plain.pixels[..., :9, :])
    exact = find(where, scatter=0.2, scatter_hidden=0.0)
    np.testing.assert_allclose(exact.pixels[..., 9:, :], where.views.pixels[..., 9:, :], atol=1e-6)


def test_hidden_joints_of_each_kind_have_their_scatter():
    where = standing(2000, visibility=np.full(17, Visibility.SELF_OCCLUDED))
    unit = Conditions.of_views(where.views).unit[..., None]
    found, usual = (find(where, scatter=0.2, scatter_hidden=hidden) for hidden in ({"hips": 2.0}, {}))
    off, plain = ((each.pixels - where.views.pixels) / unit for each in (found, usual))
    hips = [11, 12]
    assert off[..., hips, :].std() / plain[..., hips, :].std() == pytest.approx(2.0, rel=0.05)
    np.testing.assert_array_equal(np.delete(off, hips, axis=-2), np.delete(plain, hips, axis=-2))
