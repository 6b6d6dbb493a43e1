"""Numbers as text: rounded, and zero without a sign."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.runtime.number_text import NOTHING, fixed, short, signed, span

NUMBERS = st.floats(-1e6, 1e6)


@pytest.mark.parametrize("value", [0.0, -0.0, 0.04, -0.04])
def test_zero_has_no_sign(value):
    assert fixed(value, 1) == signed(value, 1) == "0.0"
    assert fixed(value, 0) == signed(value, 0) == "0"


@given(value=NUMBERS, digits=st.integers(0, 3))
def test_the_text_is_the_rounded_number(value, digits):
    for text in (fixed(value, digits), signed(value, digits)):
        assert float(text) == float(f"{value:.{digits}f}")
        assert math.copysign(1, float(text)) == 1 or float(text) < 0


@given(value=NUMBERS, digits=st.integers(0, 3))
def test_a_difference_shows_its_sign(value, digits):
    text = signed(value, digits)
    assert text[0] == ("+" if float(text) > 0 else "-" if float(text) < 0 else "0")


def test_nan_and_infinity_stay():
    assert fixed(math.nan, 1) == "nan"
    assert signed(-math.inf, 1) == "-inf"


def test_the_ends_of_an_interval():
    assert span(94.04, 98.06, 1) == "94.0 to 98.1"
    assert span(-0.01, 0.2, 1) == "0.0 to 0.2"
    assert span(math.nan, 1.0, 1) == span(0.0, math.inf, 1) == ""


def test_values_of_keys_are_short():
    assert [short(each) for each in (0.1 + 0.2, 3, "none", None, True)] == ["0.3", "3", "none", NOTHING, "True"]
    assert short(1234.5678, 3) == "1.23e+03"
