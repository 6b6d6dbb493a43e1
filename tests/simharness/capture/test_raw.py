"""Lens, colour filters and noise of the image sensor."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mvpose.camera import Camera
from simharness.capture.picture import scaled
from simharness.capture.raw import BLACK, WHITE, raw_picture
from simharness.capture.sensor import develop
from simharness.scenario.layers import SENSORS
from simharness.scenario.load import load
from simharness.scenario.presets import summary_of
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.types.random_streams import stream
from simharness.types.srgb import from_linear, to_linear

CAMERA = Camera(
    np.array([[150.0, 0, 101.5], [0, 160.0, 70.25], [0, 0, 1]]), np.eye(3), np.zeros(3), size=(200, 150), name="a"
)
WHITE_PICTURE = np.full((150, 200, 3), 255, np.uint8)


def light(rgb, *, exposure=1.0, camera=CAMERA, draw=0, **dials):
    """The linear light that a sensor reads, (h, w, 3)."""
    raw = raw_picture(rgb, SensorSection(**dials), stream(0, "test", draw), camera=camera, exposure=exposure)
    return (raw.astype(float) - BLACK) / (WHITE - BLACK)


def smooth_picture(seed=0, shape=(150, 200)):
    noise = np.random.default_rng(seed).normal(size=(*shape, 3))
    blurred = cv2.GaussianBlur(noise, (0, 0), 4.0)
    return np.clip(128 + 60 * blurred / blurred.std(), 5, 250).astype(np.uint8)


def test_the_variance_of_the_noise_is_an_affine_function_of_the_light():
    """Photon transfer curve of EMVA 1288: its slope and its value in the dark are those of the dials."""
    shot, read = 0.03, 0.004
    means, variances = [], []
    for value in range(0, 240, 20):
        seen = light(np.full((300, 400, 3), value, np.uint8), shot_noise=shot, read_noise=read, draw=value)
        means.append(seen.mean())
        variances.append(seen.var())
        assert seen.mean() == pytest.approx(float(to_linear(np.array(value))), abs=3e-4)
    slope, dark = np.polyfit(means, variances, 1)
    assert slope == pytest.approx(shot**2, rel=0.02)
    assert variances[0] == pytest.approx(read**2, rel=0.02)
    assert dark == pytest.approx(read**2, abs=0.02 * shot**2)


def test_noise_is_independent_of_pixel_and_colour():
    seen = light(np.full((300, 400, 3), 120, np.uint8), shot_noise=0.02) - to_linear(np.array(120))
    columns = [seen[..., 0], seen[..., 1], np.roll(seen[..., 0], 1, axis=0), np.roll(seen[..., 0], 1, axis=1)]
    correlation = np.corrcoef([column.ravel() for column in columns])
    assert np.abs(correlation - np.eye(4)).max() < 5 / np.sqrt(seen[..., 0].size)


def test_interpolated_colours_have_the_noise_of_means():
    """Bilinear: red is measured in one of four pixels, the mean of two in two of them, and of four in the last."""
    variance = light(np.full((300, 400, 3), 120, np.uint8), shot_noise=0.02, mosaic=True).var(axis=(0, 1))
    one = 0.02**2 * float(to_linear(np.array(120)))
    np.testing.assert_allclose(variance, one * np.array([(1 + 2 / 2 + 1 / 4) / 4, (2 + 2 / 4) / 4, 0.5625]), rtol=0.03)


@pytest.mark.parametrize("amount", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("fov", [30.0, 75.0, 120.0])
def test_vignetting_is_a_power_of_the_cosine(amount, fov):
    focal = 100 / np.tan(np.radians(fov / 2))
    K = np.array([[focal, 0, 99.5], [0, focal, 74.5], [0, 0, 1]])
    camera = Camera(K, np.eye(3), np.zeros(3), size=(200, 150))
    seen = light(WHITE_PICTURE, camera=camera, vignetting=amount)
    rows, columns = np.indices(seen.shape[:2])
    rays = np.stack([(columns - 99.5) / focal, (rows - 74.5) / focal, np.ones(rows.shape)], axis=-1)
    cosine = 1 / np.linalg.norm(rays, axis=-1)
    np.testing.assert_allclose(seen, np.repeat(cosine[..., None] ** (4 * amount), 3, axis=-1), atol=2e-3)


def test_aberration_magnifies_red_and_reduces_blue_about_the_optical_axis():
    magnified = 0.012
    rows, columns = np.indices((150, 200)).astype(float)

    def wave(factor):
        u, v = columns - CAMERA.K[0, 2], rows - CAMERA.K[1, 2]
        return 0.4 + 0.2 * np.sin(0.21 * u / factor + 0.3) * np.cos(0.17 * v / factor)

    picture = np.repeat(from_linear(wave(1.0))[..., None], 3, axis=-1).round().astype(np.uint8)
    seen = light(picture, aberration=magnified)
    inside = np.s_[4:-4, 4:-4]
    for channel, sign in enumerate((1, 0, -1)):
        wanted = wave(1 + sign * magnified)
        np.testing.assert_allclose(seen[inside][..., channel], wanted[inside], atol=0.006)
    assert np.abs(wave(1 + magnified) - wave(1.0)).max() > 0.04


@pytest.mark.parametrize("softness", [0.3, 0.6, 0.8, 1.7])
def test_softness_is_the_deviation_of_the_blur(softness):
    dot = np.zeros((41, 41, 3), np.uint8)
    dot[20, 20] = 255
    seen = light(dot, softness=softness)[..., 1]
    offset = np.arange(41) - 20.0
    for axis in range(2):
        weight = seen.sum(axis=axis)
        assert weight.sum() == pytest.approx(1.0, abs=0.02)
        assert weight @ offset == pytest.approx(0.0, abs=0.02)
        assert np.sqrt(weight @ offset**2) == pytest.approx(softness, rel=0.06)


def test_colours_are_behind_their_filters():
    flat = np.tile(np.array([220, 120, 30], np.uint8), (40, 50, 1))
    np.testing.assert_allclose(light(flat, mosaic=True), to_linear(flat), atol=1e-4)
    picture = smooth_picture()
    assert np.abs(light(picture, mosaic=True) - to_linear(picture))[2:-2, 2:-2].mean() < 0.01


def test_pictures_of_odd_size_and_tiny_pictures():
    for shape in ((1, 1), (2, 3), (5, 7), (33, 31)):
        picture = np.full((*shape, 3), 200, np.uint8)
        seen = light(picture, softness=0.5, aberration=0.01, mosaic=min(shape) > 2)
        np.testing.assert_allclose(seen, to_linear(picture), atol=1e-4)


def test_an_exposure_clips_at_white():
    seen = light(np.full((20, 20, 3), 200, np.uint8), exposure=2.0, softness=0.5)
    assert seen.max() == pytest.approx(1.0)
    assert light(np.full((20, 20, 3), 100, np.uint8), exposure=2.0, softness=0.5).mean() == pytest.approx(
        2 * float(to_linear(np.array(100))), abs=1e-4
    )


def test_an_aberration_needs_a_camera():
    for dial in ("vignetting", "aberration"):
        with pytest.raises(ValueError, match="expected a camera"):
            develop(WHITE_PICTURE, SensorSection(**{dial: 0.01}), seed=0, view=0, frame=0)


DIALS = {
    "shot_noise": 0.02,
    "read_noise": 0.003,
    "softness": 0.5,
    "mosaic": True,
    "vignetting": 0.4,
    "aberration": 0.004,
    "tone": 0.4,
    "sharpening": 0.8,
    "noise": 2.0,
    "jpeg": 90,
}


@pytest.mark.parametrize("dial", DIALS)
def test_each_dial_changes_the_picture_and_none_at_zero(dial):
    picture, where = smooth_picture(), {"seed": 3, "view": 1, "frame": 2, "camera": CAMERA}
    assert (develop(picture, SensorSection(**{dial: DIALS[dial]}), **where) != picture).any()
    assert develop(picture, SensorSection(**{dial: type(DIALS[dial])(0)}), **where) is picture
    others = {key: value for key, value in DIALS.items() if key != dial}
    np.testing.assert_array_equal(
        develop(picture, SensorSection(**others), **where),
        develop(picture, SensorSection(**others, **{dial: type(DIALS[dial])(0)}), **where),
    )


def test_the_raw_path_without_lens_and_noise_is_the_identity():
    """A blur that is too small to see leaves all 256 values as they are: linear light and back, through 16 bits."""
    ramp = np.tile(np.arange(256, dtype=np.uint8)[None, :, None], (4, 1, 3))
    np.testing.assert_array_equal(develop(ramp, SensorSection(softness=1e-6), seed=0, view=0, frame=0), ramp)


def test_draws_belong_to_camera_and_picture():
    picture, sensor = smooth_picture(), SensorSection(shot_noise=0.03, mosaic=True)

    def noise(**key):
        where = {"seed": 0, "view": 0, "frame": 0, **key}
        return develop(picture, sensor, **where, camera=CAMERA).astype(float) - picture

    base = noise()
    np.testing.assert_array_equal(base, noise())
    fixed = develop(picture, SensorSection(mosaic=True), seed=0, view=0, frame=0, camera=CAMERA).astype(float) - picture
    for other in (noise(frame=1), noise(view=1), noise(seed=1)):
        assert abs(np.corrcoef((base - fixed).ravel(), (other - fixed).ravel())[0, 1]) < 0.02


def test_a_reduced_picture_has_the_noise_of_means():
    """Reduced after the sensor or before it: the same light with the same variance, for noise without a mosaic."""
    picture, sensor = np.full((300, 400, 3), 130, np.uint8), SensorSection(shot_noise=0.05, read_noise=0.01)
    full = to_linear(develop(picture, sensor, seed=0, view=0, frame=0, camera=CAMERA))
    means = full.reshape(150, 2, 200, 2, 3).mean(axis=(1, 3))
    small = to_linear(develop(picture[:150, :200], sensor, seed=1, view=0, frame=0, camera=CAMERA, scale=0.5))
    assert small.mean() == pytest.approx(means.mean(), rel=0.003)
    assert small.std() == pytest.approx(means.std(), rel=0.02)
    half = scaled(CAMERA, 0.5)
    bright, dark = (
        develop(
            np.full((h, w, 3), 200, np.uint8), SensorSection(vignetting=1.0), seed=0, view=0, frame=0, camera=camera
        )
        for h, w, camera in ((150, 200, CAMERA), (75, 100, half))
    )
    np.testing.assert_allclose(bright[::2, ::2].astype(int), dark, atol=3)


def test_tone_darkens_shadows_and_brightens_lights():
    ramp = np.tile(np.arange(256, dtype=np.uint8)[None, :, None], (4, 1, 3))
    out = develop(ramp, SensorSection(tone=1.0), seed=0, view=0, frame=0)[0, :, 0]
    share = np.arange(256) / 255
    np.testing.assert_allclose(out, 255 * (3 * share**2 - 2 * share**3), atol=0.51)
    assert (np.diff(out.astype(int)) >= 0).all()
    np.testing.assert_array_equal(
        out, develop(ramp, SensorSection(tone=1.0, softness=1e-6), seed=0, view=0, frame=0)[0, :, 0]
    )


def test_sharpening_steepens_an_edge_and_keeps_flat_places():
    edge = np.full((40, 40, 3), 100, np.uint8)
    edge[:, 20:] = 150
    out = develop(edge, SensorSection(sharpening=1.0), seed=0, view=0, frame=0).astype(int)
    assert (out[:, :14] == 100).all()
    assert (out[:, 26:] == 150).all()
    assert out[20, 19, 0] < 95
    assert out[20, 20, 0] > 155


class TestProfiles:
    PATHS = sorted(SENSORS.shipped.glob("*.toml"))

    @pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
    def test_every_shipped_profile_makes_pictures_and_says_what_it_is(self, path):
        sensor = load("quickstart", overrides=[f"sensor.profile={path.stem}"]).sensor
        picture = smooth_picture()
        out = develop(picture, sensor, seed=0, view=0, frame=0, camera=CAMERA)
        assert out.shape == picture.shape
        assert (out is picture) == (path.stem == "perfect")
        assert 20 < len(summary_of(path)) < 110

    def test_scenarios_have_a_real_camera_unless_they_name_another(self):
        assert load("quickstart").sensor == load("quickstart", overrides=["sensor.profile=machine-vision"]).sensor
        assert load("quickstart").sensor.jpeg == 92
        assert load("quickstart", overrides=["sensor.profile=perfect"]).sensor == SensorSection()
        changed = load("quickstart", overrides=["sensor.profile=webcam", "sensor.jpeg=0"]).sensor
        assert changed == load("quickstart", overrides=["sensor.profile=webcam"]).sensor.model_copy(update={"jpeg": 0})

    def test_a_scenario_that_is_written_out_is_read_again(self, tmp_path):
        """All keys stand in the file of a result, also those that are zero: no profile changes them."""
        from simharness.scenario.load import read_plan
        from simharness.scenario.outline import outline

        file = tmp_path / "again.toml"
        for profile in ("perfect", "webcam"):
            file.write_text(outline(read_plan("quickstart", overrides=[f"sensor.profile={profile}"]), ""))
            assert load(file).sensor == load("quickstart", overrides=[f"sensor.profile={profile}"]).sensor
