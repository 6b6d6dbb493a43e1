from dataclasses import replace

import numpy as np
import pytest
from walkers import space

from simharness.scenario.sections.room_section import ClutterSection
from simharness.world.scene.placement.clutter import place_clutter
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH, LIMB


@pytest.fixture(scope="module", params=[(seed, reach) for seed in range(4) for reach in (0.1, 3.0)])
def rolling(request):
    """One cart among eight people, some with arms close to the body and some with arms stretched out."""
    seed, reach = request.param
    free = space(8, duration=12.0, seed=seed, area=3.2)
    pelvises = free.pelvises[:, :, None]
    free = replace(free, joints=pelvises + (free.joints - pelvises) * [reach, reach, 1.0])
    (cart,) = place_clutter(seed, ClutterSection(carts=1), free)
    return free, cart


def test_a_cart_moves_smoothly_on_the_floor(rolling):
    free, cart = rolling
    pose = cart.trajectory.at(free.time)
    velocity = np.gradient(pose[:, :2], free.time, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    assert 0.2 < speed.max() < 0.75
    assert np.ptp(pose[:, :2], axis=0).max() > 0.4
    assert np.abs(np.gradient(velocity, free.time, axis=0)).max() < 1.5  # m/s2
    np.testing.assert_array_equal(pose[:, 2], 0.0)
    yaw = 2 * np.arctan2(pose[:, 6], pose[:, 3])
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw)])
    rolls = speed > 0.1
    aslant = np.abs(velocity[:, 0] * ahead[:, 1] - velocity[:, 1] * ahead[:, 0])[rolls] / speed[rolls]
    assert aslant.max() < 0.02  # wheels roll, they do not slide


def test_a_cart_keeps_its_distance_from_people(rolling):
    free, cart = rolling
    for frame, moment in enumerate(free.time):
        hull = cart.hull_at(moment)
        assert hull.distance_on_floor(free.pelvises[frame]).min() >= BODY_HALF_WIDTH - 1e-9
        assert hull.distance_on_floor(free.joints[frame]).min() >= LIMB - 1e-9
        assert cart.hull.distance(hull.corners).max() < 1e-5  # the hull covers the whole trajectory


def test_the_path_does_not_depend_on_the_duration():
    short, long = space(1, duration=4.0, area=0.7), space(1, duration=9.0, area=0.7)
    one, two = (place_clutter(2, ClutterSection(carts=1), free)[0] for free in (short, long))
    moments = np.linspace(0, 4, 33)
    np.testing.assert_allclose(one.trajectory.at(moments), two.trajectory.at(moments), atol=1e-9)
