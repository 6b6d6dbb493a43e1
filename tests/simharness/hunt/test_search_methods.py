"""Search methods: points of the unit cube that follow from the seed, spread as each method promises."""

import numpy as np
import pytest

from simharness.hunt.hunted_trial import NOISES, HuntFinding
from simharness.hunt.search_methods import BATCH, search_method

NAMES = ("missed", "merged")
ELITE = np.array([0.9, 0.1, 0.2])


def methods():
    pytest.importorskip("ribs")
    return ("random", "lhs", "map-elites")


def made(name, seed=3, trials=None):
    return search_method(name, 3, seed, properties=NAMES, trials=trials)


def failing(point):
    """Fail near one corner alone, in a cell that depends on the place."""
    if np.linalg.norm(point - ELITE) > 0.3:
        return ()
    return (HuntFinding("merged", 0, 0, NOISES, "detection", 2 + 10 * point[0] % 4, 5 * point[1], 0.0, 0.0),)


def searched(name, batches, seed=3):
    method, points = made(name, seed), []
    for _ in range(batches):
        points.append(method.ask())
        method.tell(points[-1], [failing(point) for point in points[-1]])
    return np.concatenate(points)


@pytest.mark.parametrize("name", methods())
def test_points_follow_from_the_seed_and_stay_in_the_cube(name):
    points = searched(name, 6)
    assert points.shape == (6 * BATCH, 3)
    assert points.min() >= 0
    assert points.max() <= 1
    np.testing.assert_array_equal(points, searched(name, 6))
    assert not np.array_equal(points, searched(name, 6, seed=4))


def test_each_layer_of_a_hypercube_has_one_point():
    method = made("lhs", trials=2 * BATCH)
    points = np.concatenate([method.ask(), method.ask()])
    assert (np.sort((points * 2 * BATCH).astype(int), axis=0) == np.arange(2 * BATCH)[:, None]).all()


def test_map_elites_returns_to_what_failed():
    pytest.importorskip("ribs")
    shares = {}
    for name in ("random", "map-elites"):
        points = searched(name, 20)
        shares[name] = np.mean([bool(failing(point)) for point in points])
    assert shares["map-elites"] > 4 * shares["random"] > 0


def test_unknown_method():
    with pytest.raises(ValueError, match="expected map-elites, lhs or random"):
        made("luck")
