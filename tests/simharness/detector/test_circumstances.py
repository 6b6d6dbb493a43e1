"""Inversions by bearing, and swaps by distance."""

import numpy as np
import pytest
from worlds import find, standing, within, world

from simharness.detector.viewing_conditions import distance_factors, inversion_factors
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility

LEGS = slice(13, 17)  # knees and ankles: left and right are apart from all sides


def test_inversions_are_as_frequent_as_the_factor_of_the_bearing_says():
    """Of a person who faces camera 0, with camera 1 at 90 degrees to the left and camera 2 behind."""
    where = standing(3000, cameras=(0.0, np.pi / 2, np.pi))
    factors = [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0]
    np.testing.assert_allclose(inversion_factors(where.sequence.joints, where.rig, tuple(factors))[0, :, 0], [0, 1, 2])
    found = find(where, inversion=0.1, inversion_bearing=factors)
    inverted = (found.error[:, :, 0, LEGS] == KeypointError.INVERSION).sum(axis=(0, 2))
    assert inverted[0] == 0
    assert within(inverted[2], 4 * 3000, 0.2)


def test_factors_of_one_change_no_draw():
    where = standing(200, cameras=(0.0, 2.0))
    usual, same = (find(where, inversion=0.2, miss=0.1, **more) for more in ({}, {"inversion_bearing": [1.0] * 7}))
    np.testing.assert_array_equal(usual.pixels, same.pixels)
    assert (usual.error == KeypointError.INVERSION).any()


@pytest.mark.parametrize(
    ("error", "visibility", "factor"),
    [
        (error, *each)
        for error in ("inversion", "swap")
        for each in (
            (Visibility.VISIBLE, 0.25),
            (Visibility.SELF_OCCLUDED, 0.25),
            (Visibility.OCCLUDED_BY_PERSON, 1.0),
            (Visibility.OCCLUDED_BY_CLUTTER, 1.0),
        )
    ],
)
def test_joints_that_nothing_else_hides_are_taken_for_others_less_often(error, visibility, factor):
    """Joints that are taken with the factor are a part of those that are taken without it."""
    where = world(frames=1500, views=2, together=True, visibility=visibility)
    wrong = {"inversion": KeypointError.INVERSION, "swap": KeypointError.SWAP}[error]
    usual, rarer = (find(where, **{error: 0.4, f"{error}_uncovered": each}).error == wrong for each in (1.0, 0.25))
    assert (rarer & ~usual).sum() == 0
    assert rarer.sum() == pytest.approx(factor * usual.sum(), rel=0.08)
    assert usual.sum() > 1000


@pytest.mark.parametrize("reach", [0.1, 0.4])
def test_swaps_are_as_frequent_as_their_distance_says(reach):
    where = world(frames=1000, views=2, together=True)
    target, neighbour = where.views.pixels[:, :, 0], where.views.pixels[:, :, 1]
    share = 0.5 * distance_factors(target, neighbour, where.views.boxes[:, :, 0, 3], reach)
    far = np.linalg.norm(target - neighbour, axis=-1) / 300.0
    np.testing.assert_allclose(share, 0.5 * np.exp(-far / reach))
    near, usual = (find(where, swap=0.5, swap_reach=each).error[:, :, 0] == KeypointError.SWAP for each in (reach, 0.0))
    possible = far > 0.3  # nearer ones may be no misses from the person's own joint
    assert (near & ~usual).sum() == 0
    assert near[possible].sum() == pytest.approx(share[possible].sum(), rel=0.1)
    assert near[possible].sum() > 100
