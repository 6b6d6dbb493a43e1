from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_shapes import crowd
from test_renderers import VIEWS

from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.sensor import blur, compressed, develop, draw_response, from_linear, to_linear
from simharness.scenario.sections.cameras_section import SensorSection

GRAY = np.full((120, 160, 3), 128, np.uint8)
RAMP = np.tile(np.arange(256, dtype=np.uint8)[None, :, None], (4, 1, 3))


@pytest.fixture(scope="module")
def picture():
    return RasterRenderer().render(VIEWS[0], crowd(12)).rgb


def test_with_all_parameters_at_zero_the_picture_is_unchanged(picture):
    for view in range(3):
        assert develop(picture, SensorSection(), seed=1, view=view, frame=2) is picture


@pytest.mark.parametrize("amount", [1.0, 4.0, 12.0])
def test_noise_has_the_given_standard_deviation(amount):
    noisy = develop(GRAY, SensorSection(noise=amount), seed=3, view=0, frame=0).astype(float)
    apart = noisy - GRAY
    n = apart.size
    assert abs(apart.mean()) < 4 * amount / np.sqrt(n) + 1e-3
    assert apart.std() == pytest.approx(np.hypot(amount, np.sqrt(1 / 12)), rel=4 / np.sqrt(2 * n))
    flat = apart.reshape(-1, 3)
    correlations = [np.corrcoef(flat[:, 0], flat[:, 1])[0, 1], np.corrcoef(flat[1:, 0], flat[:-1, 0])[0, 1]]
    assert np.abs(correlations).max() < 4 / np.sqrt(len(flat))


def test_noise_differs_between_frames_and_views_and_repeats():
    def noise(**key):
        return develop(GRAY, SensorSection(noise=5), **{"seed": 0, "view": 0, "frame": 0, **key}).astype(int) - 128

    base = noise()
    np.testing.assert_array_equal(base, noise())
    for other in (noise(frame=1), noise(view=1), noise(seed=1)):
        assert abs(np.corrcoef(base.ravel(), other.ravel())[0, 1]) < 0.02
    stronger = develop(GRAY, SensorSection(noise=10), seed=0, view=0, frame=0).astype(int) - 128
    assert np.corrcoef(base.ravel(), stronger.ravel())[0, 1] > 0.99


@given(st.integers(0, 10_000), st.floats(0.1, 1.5))
def test_exposure_multiplies_light(seed, amount):
    """Stops are powers of two of linear light, until it clips."""
    sensor = SensorSection(exposure=amount)
    stops = draw_response(sensor, seed=seed, view=0).stops
    out = develop(RAMP, sensor, seed=seed, view=0, frame=0)[0, :, 0]
    wanted = from_linear(np.minimum(to_linear(np.arange(256)) * 2.0**stops, 1.0))
    assert np.abs(out - wanted).max() <= 0.51
    twice = draw_response(SensorSection(exposure=2 * amount), seed=seed, view=0).stops
    assert twice == pytest.approx(2 * stops)


def test_white_balance_leaves_green_and_scales_light_of_red_and_blue():
    sensor = SensorSection(white_balance=0.1)
    response = draw_response(sensor, seed=5, view=1)
    assert response.balance[1] == 1.0
    out = develop(RAMP, sensor, seed=5, view=1, frame=0)
    np.testing.assert_array_equal(out[..., 1], RAMP[..., 1])
    for channel in (0, 2):
        wanted = from_linear(np.minimum(to_linear(np.arange(256)) * response.balance[channel], 1))
        assert np.abs(out[0, :, channel] - wanted).max() <= 0.51


def test_contrast_leaves_middle_gray():
    sensor = SensorSection(gain=0.2)
    response = draw_response(sensor, seed=2, view=0)
    out = develop(RAMP, sensor, seed=2, view=0, frame=0)[0, :, 0].astype(float)
    free = (out > 0) & (out < 255)
    slope, offset = np.polyfit(np.arange(256)[free], out[free], 1)
    assert slope == pytest.approx(response.contrast, abs=0.01)
    assert slope * 127.5 + offset == pytest.approx(127.5, abs=0.6)


def test_spreads_are_over_cameras():
    sensor = SensorSection(gain=0.05, white_balance=0.1, exposure=0.3)
    many = [draw_response(sensor, seed=0, view=view) for view in range(800)]
    wanted = [
        (np.array([response.contrast - 1 for response in many]), 0.05),
        (np.log([response.balance[0] for response in many]), 0.1),
        (np.log([response.balance[2] for response in many]), 0.1),
        (np.array([response.stops for response in many]), 0.3),
    ]
    for drawn, deviation in wanted:
        assert drawn.std() == pytest.approx(deviation, rel=4 / np.sqrt(2 * len(drawn)))
        assert abs(drawn.mean()) < 4 * deviation / np.sqrt(len(drawn))
    assert abs(np.corrcoef(wanted[1][0], wanted[2][0])[0, 1]) < 0.15


def test_parameters_do_not_shift_draws_of_others():
    alone, all_of_them = SensorSection(exposure=0.4), SensorSection(exposure=0.4, gain=0.1, white_balance=0.2, noise=3)
    for view in range(4):
        one, other = (draw_response(sensor, seed=9, view=view) for sensor in (alone, all_of_them))
        assert one.stops == other.stops


def test_jpeg_changes_little_and_less_at_higher_quality(picture):
    error = {}
    for quality in (30, 60, 95):
        out = develop(picture, SensorSection(jpeg=quality), seed=0, view=0, frame=0)
        assert out.shape == picture.shape
        assert out.dtype == np.uint8
        assert (out != picture).any()
        error[quality] = ((out.astype(float) - picture) ** 2).mean()
    assert error[30] > error[60] > error[95]
    assert 10 * np.log10(255**2 / error[95]) > 36  # dB
    assert 10 * np.log10(255**2 / error[30]) > 25
    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 200
    assert np.abs(compressed(red, 90).astype(int) - red).max() < 6  # red stays red, not blue


def test_a_blur_of_one_picture_is_that_picture(picture):
    np.testing.assert_array_equal(blur([picture]), picture)
    np.testing.assert_array_equal(blur([picture] * 5), picture)


def test_a_blur_averages_light_not_values():
    black, white = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 255, np.uint8)
    assert (blur([black, white]) == 188).all()  # half the light of white in sRGB
    quarter = blur([black, black, black, white])
    np.testing.assert_allclose(to_linear(quarter), 0.25, atol=0.004)


def test_a_blur_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one picture"):
        blur([])


def test_srgb_follows_the_standard():
    """IEC 61966-2-1: 50 % gray is 21.4 % of the light; both branches meet; the curves are inverse."""
    assert to_linear(np.array(127.5)) == pytest.approx(0.21404, abs=1e-4)
    assert to_linear(np.array(10.0)) == pytest.approx(10 / 255 / 12.92)
    np.testing.assert_allclose(from_linear(to_linear(np.arange(256.0))), np.arange(256), atol=1e-3)
