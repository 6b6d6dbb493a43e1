"""Combinations of a pairwise sweep: every pair of values occurs, in few settings."""

import itertools
import math

import hypothesis
import hypothesis.strategies as st
import pytest

from simharness.scenario.load import load_study
from simharness.scenario.pairwise import pairwise


def pairs(combinations):
    """Pairs of values of two axes, each value as axis and place."""
    return {pair for each in combinations for pair in itertools.combinations(enumerate(each), 2)}


@pytest.mark.slow
@hypothesis.settings(deadline=None, max_examples=30)
@hypothesis.given(st.lists(st.integers(1, 5), max_size=6).map(tuple))
def test_every_pair_of_values_occurs_in_no_more_settings_than_there_are_combinations(sizes):
    found, every = pairwise(sizes), list(itertools.product(*map(range, sizes)))
    assert pairs(found) == pairs(every)
    assert set(found) <= set(every)
    assert math.prod(sorted(sizes)[-2:]) <= len(found) == len(set(found)) <= len(every)
    for index, size in enumerate(sizes):
        assert {each[index] for each in found} == set(range(size))


@pytest.mark.parametrize(
    ("sizes", "most"), [((4,) * 8, 30), ((3,) * 13, 21), ((2,) * 10, 11), ((5, 4, 4, 3, 3, 2), 28)]
)
def test_settings_are_few(sizes, most):
    """Published sizes of AETG: 10 factors of 2 values take about 10 settings, 13 factors of 3 values about 17."""
    assert len(pairwise(sizes)) <= most


def test_a_study_has_these_settings(tmp_path):
    path = tmp_path / "few.toml"
    sweep = "people.count = [1, 2, 3]\ncameras.count = [3, 4]\nclutter.boxes = [0, 3]\n"
    sweep += "[[sweep.paired]]\nrate = [5.0, 10.0]\nduration = [1.0, 2.0]\n"
    path.write_text(f'extends = "quickstart"\nname = "few"\nseeds = 2\n[sweep]\npairwise = true\n{sweep}')
    study = load_study(path)
    found = [tuple(setting.factors.values()) for setting in study.settings]
    values = [(1, 2, 3), (3, 4), (0, 3), (5.0, 10.0)]
    assert all(duration == rate / 5.0 for *_, rate, duration in found)
    assert pairs(each[:4] for each in found) == pairs(itertools.product(*values))
    assert len(found) < 24
    assert study.plan.trials == study.trials == 2 * len(found)
