"""Intervals of forecasts: the noise of the scenes and the error of the model together, within the bounds of a score."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.planning.forecast_error import GENERAL, MEASURED, ForecastError, ForecastErrors, forecast_text
from simharness.scenario.presets import read_profile
from simharness.statistics.intervals import Interval

Z90, Z95, T90 = 1.6448536269514722, 1.959963984540054, 1.8124611228107335  # t of 10 degrees of freedom


def test_without_noise_the_interval_is_that_of_the_model_alone():
    made = ForecastError(3.0, 0.4, 11).interval(Interval(70.0, 70.0, 70.0, 9), 10.0)
    assert (made.mean, made.low, made.high, made.n) == (
        70.0,
        pytest.approx(70 - 5 * T90),
        pytest.approx(70 + 5 * T90),
        9,
    )


def test_without_an_error_the_interval_is_that_of_the_scenes_at_90_percent():
    made = ForecastError(0.0, 0.0, 11).interval(Interval(70.0, 70 - Z95, 70 + 2 * Z95, 9), 30.0)
    assert (made.low, made.high) == (pytest.approx(70 - Z90), pytest.approx(70 + 2 * Z90))


@given(mean=st.floats(0, 100), noise=st.floats(0, 20))
def test_forecasts_stay_within_the_scale_and_hold_their_mean(mean, noise):
    scenes = Interval(mean, max(mean - noise, 0.0), min(mean + noise, 100.0), 5)
    for made in (GENERAL.of_pcp(scenes), GENERAL.of_mm(scenes), GENERAL.of_loss(scenes)):
        assert made.low <= made.mean == mean <= made.high
    assert GENERAL.of_pcp(scenes).low >= 0.0
    assert GENERAL.of_pcp(scenes).high <= 100.0
    assert GENERAL.of_mm(scenes).low >= 0.0


def test_a_worse_forecast_is_less_sure():
    widths = [
        np.subtract(*[getattr(GENERAL.of_pcp(Interval(m, m, m, 5)), e) for e in ("mean", "low")]) for m in (99, 90, 70)
    ]
    assert widths[0] < widths[1] < widths[2]


def test_one_scene_has_the_error_of_the_model():
    made = GENERAL.of_pcp(Interval(90.0, np.nan, np.nan, 1))
    assert made.low < 90.0 < made.high


def test_an_unknown_score_has_no_interval():
    assert np.isnan(GENERAL.of_pcp(Interval(np.nan, np.nan, np.nan, 0)).low)


def test_a_profile_of_the_network_makes_forecasts_more_exact():
    assert ForecastErrors.of_detector(read_profile("movenet")) is MEASURED
    assert ForecastErrors.of_detector(read_profile("topdown")) is GENERAL
    for name, figure in (("of_pcp", 90.0), ("of_loss", 3.0), ("of_mm", 40.0)):
        scenes = Interval(figure, figure, figure, 5)
        close, wide = getattr(MEASURED, name)(scenes), getattr(GENERAL, name)(scenes)
        assert wide.low < close.low < figure < close.high < wide.high


def test_what_rounds_to_nothing_has_no_sign():
    """Losses of a camera that nobody misses are a little below zero as often as above."""
    assert forecast_text(Interval(-0.01, -0.04, 0.04, 2)) == "0.0 (0.0 to 0.0)"
    assert forecast_text(Interval(-0.4, -1.4, 0.4, 2), digits=0) == "0 (-1 to 0)"
