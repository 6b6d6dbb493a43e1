"""Filters of joints over time: responses of the Butterworth filter, splines, gaps."""

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline

from mvpose.formats.people.filters import filter_of, filtered, freedom, smoothed, spline
from mvpose.recording import People

RATE = 60.0
TIMES = np.arange(600) / RATE


def swinging(hertz, *, times=TIMES):
    joints = np.zeros((len(times), 1, 17, 3))
    joints[..., 0] = np.sin(2 * np.pi * hertz * times)[:, None, None]
    joints[..., 1] = 1.5
    return People(times, [0], joints, np.ones((len(times), 1, 17)))


@pytest.mark.parametrize("hertz", [1.0, 3.0, 6.0, 12.0])
@pytest.mark.parametrize("cutoff", [4.0, 6.0])
def test_the_gain_of_the_butterworth_filter_is_that_of_two_passes_and_there_is_no_lag(hertz, cutoff):
    """Half of the power is left at the cutoff, as after one filter of fourth order (bilinear transform)."""
    inner = slice(120, 480)
    found = filtered(swinging(hertz), "butterworth", cutoff).joints[inner, 0, 0]
    share = (np.sqrt(2) - 1) ** 0.25
    warped = np.tan(np.pi * hertz / RATE) / np.tan(np.pi * cutoff / share / RATE)
    gain = 1 / (1 + warped**4)
    np.testing.assert_allclose(found[:, 0], gain * np.sin(2 * np.pi * hertz * TIMES[inner]), atol=2e-3)
    np.testing.assert_allclose(found[:, 1], 1.5, atol=1e-9)
    if hertz == cutoff:
        assert gain == pytest.approx(np.sqrt(0.5), abs=0.02)


@pytest.mark.parametrize("frames", [5, 40, 300])
@pytest.mark.parametrize("weight", [0.1, 10.0, 1e4])
def test_smoothing_splines_are_those_of_scipy(frames, weight):
    values = np.random.default_rng(frames).normal(size=(frames, 3))
    reference = [
        make_smoothing_spline(np.arange(float(frames)), each, lam=weight)(np.arange(frames)) for each in values.T
    ]
    np.testing.assert_allclose(smoothed(values, weight), np.transpose(reference), atol=1e-9)
    assert freedom(frames, weight) == pytest.approx(np.trace(smoothed(np.eye(frames), weight)), abs=0.2)


@pytest.mark.parametrize("frames", [60, 600, 3000])
@pytest.mark.parametrize("hertz", [0.2, 2.0, 5.0])
def test_the_spline_that_is_chosen_is_near_the_best(frames, hertz):
    times, rng = np.arange(frames) / RATE, np.random.default_rng(0)
    true = np.sin(2 * np.pi * hertz * times)[:, None] * [1.0, 0.5, 0.1]
    noisy = true + rng.normal(0, 0.02, true.shape)

    def error(values):
        return np.sqrt(np.mean((values - true) ** 2, axis=0))

    best = np.min([error(smoothed(noisy, weight)) for weight in np.logspace(-2, 10, 97)], axis=0)
    assert np.all(error(spline(noisy, times, 6.0)) < 1.3 * best)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["butterworth", "spline"])
def test_noise_falls_and_slow_motion_stays(name):
    people, rng = swinging(0.5), np.random.default_rng(0)
    noisy = People(TIMES, [0], people.joints + rng.normal(0, 0.02, people.joints.shape), people.scores)
    left = filtered(noisy, name).joints - people.joints
    assert np.sqrt(np.mean(left**2)) < 0.5 * 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["butterworth", "spline"])
def test_stretches_are_filtered_for_themselves_and_gaps_stay(name):
    joints = swinging(2.0).joints.copy()
    joints[200:230] = joints[300, 0, 3] = np.nan
    joints[310:313, 0, 5], joints[309, 0, 5], joints[313, 0, 5] = 7.0, np.nan, np.nan
    people = People(TIMES, [0], joints, np.ones(joints.shape[:3]))
    found = filtered(people, name).joints
    np.testing.assert_array_equal(np.isnan(found), np.isnan(joints))
    np.testing.assert_array_equal(found[310:313, 0, 5], 7.0)
    alone = filtered(People(TIMES[:200], [0], joints[:200], np.ones((200, 1, 17))), name).joints
    np.testing.assert_allclose(found[:200], alone, atol=1e-9)


@pytest.mark.parametrize("text", ["mean", "butterworth:", "butterworth:-1", "butterworth:x", "spline:3", ""])
def test_other_filters_are_refused(text):
    if text == "butterworth:":
        assert filter_of(text) == ("butterworth", 6.0)
        return
    with pytest.raises(ValueError, match="expected butterworth, butterworth:HZ or spline"):
        filter_of(text)


def test_a_cutoff_above_half_of_the_rate_and_uneven_times_are_refused():
    with pytest.raises(ValueError, match="cutoff of 40 Hz: expected between 0 and"):
        filtered(swinging(1.0), "butterworth", 40.0)
    uneven = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.02, 600))
    with pytest.raises(ValueError, match="even times"):
        filtered(swinging(1.0, times=uneven), "spline")
