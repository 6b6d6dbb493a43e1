import json
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose.networks import Card

numbers = st.floats(0.01, 300, allow_nan=False)
colours = st.tuples(numbers, numbers, numbers)


@given(
    st.text(), colours, colours, st.sampled_from(["rgb", "bgr"]), st.sampled_from(["stride", "span", "area"]),
    st.none() | st.tuples(st.integers(1, 999), st.integers(1, 999)), st.lists(st.text(min_size=1)), numbers,
)  # fmt: skip
def test_a_card_round_trips_through_a_file(name, mean, std, order, cells, size, outputs, number):
    card = Card(
        name=name, mean=mean, std=std, color_order=order, cells=cells, size=size, outputs=tuple(outputs),
        midpoint=number, slope=number / 10, padding=number, peak=number,
    )  # fmt: skip
    assert Card.from_metadata({"stride": "32", "names": "{0: 'x'}", **card.to_metadata()}) == card


def test_default_fields_are_omitted_and_restored():
    assert Card().to_metadata() == {}
    assert Card.from_metadata({"author": "somebody"}) == Card()


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"mean": (0.5, 0.5)}, r"mean must be three numbers, red green blue, got \(0.5, 0.5\)"),
        ({"mean": 0.5}, "mean must be three numbers"),
        ({"std": (0.2, 0, 0.2)}, "std must be three positive numbers"),
        ({"size": (128, 0)}, "size must be width and height, two positive whole numbers of pixels"),
        ({"size": 128}, "size must be width and height"),
        ({"color_order": "gbr"}, "color_order must be one of rgb, bgr, got 'gbr'"),
        ({"cells": "corner"}, "cells must be one of stride, span, area, got 'corner'"),
        ({"midpoint": 1.0}, "midpoint and slope define one sigmoid, got 1.0 and None: give both or neither"),
        ({"peak": 0}, "peak must be a positive number, got 0"),
        ({"padding": "1.25"}, "padding must be a positive number"),
        ({"outputs": "features"}, "outputs must be a tuple of names, got 'features'"),
        ({"outputs": 5}, "outputs must be a tuple of names, got 5"),
        ({"outputs": None}, "outputs must be a tuple of names"),
        ({"outputs": ("features", 5)}, "outputs must be a tuple of names"),
        ({"outputs": {"features": 1}}, "outputs must be a tuple of names"),
        ({"name": 5}, "name must be text, got 5"),
        ({"name": None}, "name must be text"),
        ({"padding": None}, "padding must be a positive number, got None"),
        ({"peak": None}, "peak must be a positive number, got None"),
        ({"peak": 10**400}, "peak must be a positive number"),
        ({"midpoint": True, "slope": 1.0}, "midpoint must be a positive number"),
        ({"mean": None}, "mean must be three numbers"),
        ({"size": (True, 2)}, "size must be width and height"),
        ({"size": (float("inf"), 2)}, "size must be width and height"),
        ({"color_order": None}, "color_order must be one of"),
        ({"cells": {}}, "cells must be one of"),
    ],
)
def test_invalid_values_are_refused(stated, message):
    with pytest.raises(ValueError, match=f"card: {message}"):
        Card(**stated)


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        (
            {"mvpose.means": "[0, 0, 0]"},
            r"unknown field 'means' \(metadata entry 'mvpose.means'\); expected one of name, size",
        ),
        ({"mvpose.mean": "0.4 0.4 0.4"}, "'mvpose.mean' must be JSON, got '0.4 0.4 0.4'"),
        ({"mvpose.std": '["a", "b", "c"]'}, "std must be three numbers"),
    ],
)
def test_an_invalid_metadata_entry_is_refused(metadata, message):
    with pytest.raises(ValueError, match=message):
        Card.from_metadata(metadata)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


@given(st.sampled_from([field.name for field in fields(Card)]), json_values)
def test_any_metadata_value_is_accepted_or_refused_by_name(key, value):
    message = ""
    try:
        card = Card.from_metadata({f"mvpose.{key}": json.dumps(value)})
    except ValueError as error:
        message = str(error)
    if message:
        assert message.startswith("card: ")
        assert key in message
    else:
        assert value is not None or key in ("midpoint", "slope", "size")
        assert Card.from_metadata(card.to_metadata()) == card
