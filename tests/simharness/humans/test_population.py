from dataclasses import asdict

import numpy as np
import pytest

from simharness.humans.body import body_model, make_body
from simharness.humans.population import STATURE, draw_shape, with_stature
from simharness.humans.shape import Shape
from simharness.random import stream


@pytest.mark.parametrize("gender", [0.0, 1.0])
@pytest.mark.parametrize("stature", [1.5, 1.68, 1.9])
def test_a_body_is_as_tall_as_asked(gender, stature):
    body = make_body(with_stature(Shape(gender=gender, muscle=0.7, weight=0.3), stature))
    assert body.stature == pytest.approx(stature, abs=0.001)
    assert body.vertices[:, 2].max() - body.vertices[:, 2].min() == pytest.approx(stature, abs=0.005)


def test_a_stature_out_of_reach_is_refused():
    with pytest.raises(ValueError, match=r"stature of 3 m is beyond .* to "):
        with_stature(Shape(), 3.0)


@pytest.mark.parametrize(
    ("field", "value"), [("age", 0.3), ("muscle", 1.2), ("gender", -0.1), ("height", float("nan"))]
)
def test_a_shape_that_is_no_adult_is_refused(field, value):
    with pytest.raises(ValueError, match=field):
        Shape(**{field: value})


def test_drawn_statures_are_spread_as_published():
    shapes = [draw_shape(stream(7, "test", i)) for i in range(300)]
    statures = np.array([body_model().stature(asdict(shape)) for shape in shapes])
    women = np.array([shape.gender > 0.5 for shape in shapes])
    assert 120 <= women.sum() <= 180
    for group, (mean, deviation) in ((~women, STATURE["male"]), (women, STATURE["female"])):
        count = group.sum()
        assert statures[group].mean() == pytest.approx(mean, abs=4 * deviation / np.sqrt(count))
        assert statures[group].std() == pytest.approx(deviation, rel=4 / np.sqrt(2 * count))


def test_equal_streams_draw_equal_people():
    assert draw_shape(stream(3, "a")) == draw_shape(stream(3, "a"))
    assert draw_shape(stream(3, "a")) != draw_shape(stream(4, "a"))
