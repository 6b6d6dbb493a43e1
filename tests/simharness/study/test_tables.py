"""Tables of a study: columns of factors."""

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.study.study_folder import factor_column, tables


@pytest.mark.parametrize(
    ("values", "dtype", "shown"),
    [
        ([2, 3, 12], pl.Int64, [2, 3, 12]),
        ([0, 0.5, 1], pl.Float64, [0.0, 0.5, 1.0]),
        ([True, False], pl.Boolean, [True, False]),
        (["poor", "typical"], pl.String, ["poor", "typical"]),
        ([3, None], pl.Int64, [3, None]),
        ([None, None], pl.String, [None, None]),
        ([(1, 2.5), (3, 4)], pl.String, ["[1, 2.5]", "[3, 4]"]),
        ([True, 2], pl.String, ["true", "2"]),
        (["none", 0.5, (1,)], pl.String, ["none", "0.5", "[1]"]),
        ([], pl.String, []),
    ],
)
def test_a_factor_has_the_simplest_type_for_its_values(values, dtype, shown):
    column = factor_column(values)
    assert column.dtype == dtype
    assert column.to_list() == shown


@given(values=st.lists(st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9, 9) | st.sampled_from("ab")))
def test_different_values_differ_in_the_table(values):
    column = factor_column(values).to_list()
    known = {(type(value) is bool, value) for value in values if value is not None}
    assert len(set(column) - {None}) >= len(known)
    assert [value is None for value in column] == [value is None for value in values]


def test_an_empty_study_has_its_columns():
    empty = tables([], ["cameras.count"])
    assert empty.trials.columns[:6] == ["trial", "case", "varied", "seed", "variant", "cameras.count"]
    assert empty.trials.columns[-2:] == ["seconds", "scenario"]
    assert len(empty.trials) == len(empty.frames) == 0
