"""Corrections of p-values for many tests."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.statistics.many_tests import holm, joint_p
from simharness.statistics.paired_tests import paired


def rejected_step_by_step(p, level):
    """Return the indices that Holm's procedure rejects, step by step."""
    rejected = set()
    for step, index in enumerate(sorted(range(len(p)), key=p.__getitem__)):
        if p[index] > level / (len(p) - step):
            break
        rejected.add(index)
    return rejected


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []
    assert holm([0.7, 0.8]) == [1.0, 1.0]
    with pytest.raises(ValueError, match="between 0 and 1"):
        holm([0.5, float("nan")])


@given(
    p=st.lists(st.integers(0, 997).map(lambda i: i / 997), min_size=1, max_size=12),
    level=st.sampled_from([0.0101, 0.0502, 0.2003]),
)
def test_holm_agrees_with_the_step_by_step_procedure(p, level):
    assert {i for i, adjusted in enumerate(holm(p)) if adjusted <= level} == rejected_step_by_step(p, level)


def by_brute_force(changes):
    """Return the single-step minP p-values of m tests (m, n) by enumeration of all joint sign flips."""
    flips = [np.array(signs) for signs in itertools.product((1, -1), repeat=changes.shape[1])]
    p = np.array([[paired(np.zeros(len(row)), row * flip, symmetric=True).p for flip in flips] for row in changes])
    return np.array([(p.min(axis=0) <= own + 1e-12).mean() for own in p[:, 0]])


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(2, 6))
def test_the_most_certain_test_is_corrected_for_all(seed, tests, scenes):
    changes = np.random.default_rng(seed).normal(size=(tests, scenes)) + 0.5
    joint, expected = joint_p(changes), by_brute_force(changes)
    alone = np.array([paired(np.zeros(scenes), row, symmetric=True).p for row in changes])
    first = alone.argmin()
    assert joint.p[first] == pytest.approx(expected[first])
    assert (joint.p >= alone - 1e-12).all()  # corrected upwards
    assert (joint.p <= expected + 1e-12).all()  # step-down: never worse than for all tests at once
    assert joint.p.argmin() == first or joint.p[first] == joint.p.min()


def test_tests_that_agree_are_not_corrected():
    change = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 2.5, 1.5])
    alone = paired(np.zeros(7), change, symmetric=True).p
    assert joint_p(np.array([change, 2 * change, -change])).p == pytest.approx(alone)


def test_independent_tests_are_corrected_nearly_as_by_holm():
    rng = np.random.default_rng(3)
    changes = rng.normal(size=(30, 12))
    changes[4] = 1.0 + rng.random(12)
    joint = joint_p(changes)
    alone = [paired(np.zeros(12), row, symmetric=True).p for row in changes]
    assert 0.7 * holm(alone)[4] < joint.p[4] <= holm(alone)[4]
    assert joint.corrected(alone[4]) == pytest.approx(joint.p[4])


def test_other_tests_are_added():
    agreeing = np.full((1, 8), 2.0)
    alone = 2.0**-7
    assert joint_p(agreeing, [0.5, 0.9]).p == pytest.approx([3 * alone, 1.0, 1.0])
    assert joint_p(np.zeros((0, 0)), [0.01, 0.04, 0.03]).p == pytest.approx(holm([0.01, 0.04, 0.03]))
    assert joint_p(agreeing, [0.001]).p == pytest.approx([alone, 0.001 + 0.0])
    assert len(joint_p(np.zeros((0, 0))).p) == 0
    with pytest.raises(ValueError, match="p must be between 0 and 1"):
        joint_p(agreeing, [float("nan")])


@pytest.mark.parametrize("scenes", [9, 14])
@pytest.mark.parametrize("shared", [0.0, 0.6])
def test_the_level_holds_for_all_tests_together(scenes, shared):
    """Changes at random, skewed in pairs, of scores that depend on each other or not: one run in ten may be red."""
    rng = np.random.default_rng(1)
    runs = rng.normal(size=(300, 6, scenes)) * (1 - shared) ** 0.5 + rng.normal(size=(300, 1, scenes)) * shared**0.5
    red = np.mean([joint_p(run, draws=2000).p.min() <= 0.1 for run in runs])
    assert 0.1 - 4 * (0.09 / 300) ** 0.5 < red < 0.1 + 3 * (0.09 / 300) ** 0.5
