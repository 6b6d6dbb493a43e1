"""Tolerance of a rig: where its cliff is."""

from __future__ import annotations

import pytest

from simharness.planning.tolerance import FAULTS, cliff_of, fault_conditions


def test_the_cliff_of_a_straight_line_is_where_it_crosses_the_limit():
    levels = [0.5, 1.0, 2.0]
    assert cliff_of(levels, [10 * level for level in levels]) == pytest.approx(0.5)
    assert cliff_of(levels, [4 * level for level in levels]) == pytest.approx(1.25)
    assert cliff_of(levels, [20 * level for level in levels]) == pytest.approx(0.25)  # between none and the first level


def test_a_rig_that_loses_little_has_no_cliff():
    assert cliff_of([1.0, 2.0], [0.1, 4.9]) is None
    assert cliff_of([1.0, 2.0], [-3.0, 0.0]) is None


def test_conditions_are_in_the_units_of_scenarios():
    levels = {(each.fault, each.level) for each in fault_conditions(range(3))}
    assert ("translation", 0.0025) in levels  # 0.25 cm
    assert ("clock_offset", 0.067) in levels  # 67 ms
    assert ("rotation", 2.0) in levels
    assert len(levels) == sum(len(fault.levels) for fault in FAULTS.values())
