"""Searches that hunts are compared by."""

import numpy as np
import pytest

from benchmarks.hunt.__main__ import SCENARIO, anywhere, latin_hypercube, table
from simharness.hunt.hunt_run import BATCH
from simharness.scenario.load import read_plan

ELITES, WEIGHTS = np.full((1, 4), 0.9), np.ones(1)


def test_a_hypercube_has_one_point_in_each_slice_of_each_key():
    batches = [latin_hypercube(ELITES, WEIGHTS, 4, 3, batch, trials=5 * BATCH) for batch in range(5)]
    points = np.concatenate([points for points, _ in batches])
    slices = np.sort((points * len(points)).astype(int), axis=0)
    np.testing.assert_array_equal(slices, np.arange(5 * BATCH)[:, None].repeat(4, axis=1))
    assert {int(kept) for _, scenes in batches for kept in scenes} == {-1}


def test_independent_points_do_not_depend_on_what_was_found():
    points, scenes = anywhere(ELITES, WEIGHTS, 4, 3, 1)
    np.testing.assert_array_equal(points, anywhere(ELITES[:0], WEIGHTS[:0], 4, 3, 1)[0])
    assert (scenes == -1).all()


def test_ratios_are_of_the_same_seed():
    text = table({"map-elites": [20, 40], "random": [10, 10]})
    assert "| map-elites | 20, 40 | 30.0 | 2.83 (" in text
    assert "), 2.00 to 4.00 |" in text
    assert "| random | 10, 10 | 10.0 | 1.00, 1.00 to 1.00 |" in text


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_all_corners_of_the_scenario_can_be_built(share):
    plan = read_plan(SCENARIO)
    values = dict(pair for axis in plan.search.axes for pair in axis.at(share))
    assert plan.at(values, 5).people.count == values["people.count"]
