"""Values as JSON holds them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from mvpose.json_values import json_value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), np.float64("nan"), np.float32("inf")])
def test_an_unknown_number_is_null(value):
    assert json.dumps(json_value({"a": [value]}), allow_nan=False) == '{"a": [null]}'


def test_arrays_and_numbers_of_numpy_become_plain():
    given = {"a": np.array([[1.0, np.nan]]), "b": (np.int64(3), np.bool_(True)), "c": "text", "d": None, "e": 7}
    assert json_value(given) == {"a": [[1.0, None]], "b": [3, True], "c": "text", "d": None, "e": 7}


def test_objects_say_what_they_have():
    each = SimpleNamespace(to_json=lambda: {"x": np.float64(0.123456)})
    assert json_value([each], decimals=2) == [{"x": 0.12}]


def test_numbers_are_rounded_and_counts_are_not():
    assert json_value([1234567.891, 0.00012345678, 1234567], significant=6) == [1234570.0, 0.000123457, 1234567]
    assert json_value({"a": [1.23456, 2]}, decimals=3) == {"a": [1.235, 2]}
