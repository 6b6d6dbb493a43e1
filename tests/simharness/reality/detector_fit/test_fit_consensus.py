"""Leave-one-out consensus of the views."""

import numpy as np
import pytest
from turning_people import PERSON, ring

from simharness.detector.viewing_conditions import oks_units
from simharness.reality.detector_fit.consensus import find_consensus

DISTORTION = (0.115, -0.219, 0.0012, 0.0086, 0.113)  # of a webcam
UNIT = 4.0  # pixels


def seen(rig, frames=1, *, noise=0.0, seed=0):
    """Keypoints (T, V, 1, 17, 2) of a standing person, with noise in units, and the units (T, V, 1, 17)."""
    pixels = np.broadcast_to(rig.project(PERSON)[None, :, None], (frames, len(rig), 1, 17, 2))
    unit = np.full(pixels.shape[:-1], UNIT) * np.linspace(0.7, 1.5, len(rig))[:, None, None]
    shift = np.random.default_rng(seed).standard_normal(pixels.shape)
    return pixels + noise * unit[..., None] * shift, unit


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION])
@pytest.mark.parametrize("views", [3, 5])
def test_exact_keypoints_give_exact_joints_and_predictions(views, distortion):
    rig = ring(views, distortion=distortion)
    keypoints, unit = seen(rig)
    found = find_consensus(rig, keypoints, unit)
    np.testing.assert_allclose(found.joints[0, 0], PERSON, atol=1e-6)
    np.testing.assert_allclose(found.predicted, keypoints, atol=1e-3)
    assert found.agrees.all()


def test_wrong_distortion_is_seen_in_the_residuals():
    """The test above can fail."""
    keypoints, unit = seen(ring(5, distortion=DISTORTION))
    found = find_consensus(ring(5), keypoints, unit)
    assert np.nanmax(np.abs(found.predicted - keypoints)) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("views", [3, 5])
def test_noise_of_predictions_is_that_of_repeated_draws(views):
    """Residuals from the other views have the variance (1 + noise) sigma²."""
    rig, sigma = ring(views), 0.25
    keypoints, unit = seen(rig, 1000, noise=sigma)
    found = find_consensus(rig, keypoints, unit)
    assert found.agrees.mean() > 0.999
    residual = (keypoints - found.predicted) / unit[..., None]
    square = (residual**2).mean(axis=-1) / (1 + found.noise)
    # Of 1000 x 17 x 2 numbers in each view: the deviation of the mean is 0.8 %.
    np.testing.assert_allclose(np.nanmean(square, axis=(0, 2, 3)), sigma**2, rtol=0.04)


@pytest.mark.slow
def test_variance_of_joints_is_that_of_repeated_draws():
    rig, sigma = ring(4), 0.25
    keypoints, unit = seen(rig, 1000, noise=sigma)
    found = find_consensus(rig, keypoints, unit)
    drawn = found.joints[:, 0].var(axis=0).mean(axis=-1)
    np.testing.assert_allclose(found.variance.mean(axis=0)[0] * sigma**2, drawn, rtol=0.1)
    np.testing.assert_allclose(found.joints[:, 0].mean(axis=0), PERSON, atol=5 * np.sqrt(drawn.max() / 1000))


def test_scale_is_the_size_of_a_unit_at_the_joint():
    rig = ring(3)
    keypoints, unit = seen(rig)
    found = find_consensus(rig, keypoints, unit)
    depth = np.stack([camera.depth(PERSON) for camera in rig])
    np.testing.assert_allclose(found.scale[0, 0], ((unit[0, :, 0] * depth / 700) ** 2).mean(axis=0), rtol=1e-6)


def test_a_gross_view_is_left_out_and_its_error_is_seen_whole():
    rig = ring(5)
    keypoints, unit = seen(rig)
    keypoints[0, 2, 0, 9] += [30.0, 40.0]
    found = find_consensus(rig, keypoints, unit)
    assert np.argwhere(~found.agrees).tolist() == [[0, 2, 0, 9]]
    np.testing.assert_allclose(found.joints[0, 0], PERSON, atol=1e-6)
    away = keypoints[0, 2, 0, 9] - found.predicted[0, 2, 0, 9]
    np.testing.assert_allclose(away, [30.0, 40.0], atol=1e-3)


def test_most_views_decide():
    """Two views that agree with each other by chance do not outvote three."""
    rig = ring(5)
    keypoints, unit = seen(rig)
    other = rig.project(PERSON + [0.3, 0.2, 0.0])
    keypoints[0, :2, 0, 9] = other[:2, 9]
    found = find_consensus(rig, keypoints, unit)
    assert found.agrees[0, :, 0, 9].tolist() == [False, False, True, True, True]
    np.testing.assert_allclose(found.joints[0, 0, 9], PERSON[9], atol=1e-6)


def test_fewer_than_two_views_are_unknown():
    rig = ring(4)
    keypoints, unit = seen(rig)
    keypoints[0, 1:, 0, 4] = np.nan  # one view
    keypoints[0, 2:, 0, 5] = np.nan  # two views
    keypoints[0, 3:, 0, 6] = np.nan  # three views
    unit[0, 1:, 0, 7] = 0.0  # the person is in one picture
    found = find_consensus(rig, keypoints, unit)
    for joint in (4, 7):
        assert np.isnan(found.joints[0, 0, joint]).all()
        assert np.isnan(found.variance[0, 0, joint])
    assert np.isfinite(found.joints[0, 0, [5, 6]]).all()
    predicted = np.isfinite(found.predicted[0, :, 0, :, 0])
    assert not predicted[:, 4].any()
    assert predicted[:, 5].tolist() == [False, False, True, True]
    assert predicted[:, 6].all()
    assert np.isfinite(found.noise[0, :, 0, 6]).tolist() == [True, True, True, False]
    assert (np.isfinite(found.noise) <= np.isfinite(found.predicted[..., 0])).all()


def test_a_view_takes_no_part_in_its_own_prediction():
    rig = ring(4)
    keypoints, unit = seen(rig, noise=0.2)
    moved = keypoints.copy()
    moved[:, 1] += 0.1
    before, after = (find_consensus(rig, each, unit).predicted for each in (keypoints, moved))
    np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-9)
    assert np.abs(after[:, 0] - before[:, 0]).max() > 1e-3


def test_the_size_of_people_in_the_pictures_weighs_the_views():
    """The consensus is that of least squares in units: a view of large units has little weight."""
    rig = ring(3)
    keypoints, unit = seen(rig)
    keypoints[:, 0] += 1.0
    unit[:, 0] *= 1000
    found = find_consensus(rig, keypoints, unit)
    np.testing.assert_allclose(found.joints[0, 0], PERSON, atol=1e-5)
    small = unit.copy()
    small[:, 0] /= 1000
    assert np.abs(find_consensus(rig, keypoints, small).joints[0, 0] - PERSON).max() > 1e-3


def test_people_of_a_real_picture_size_have_units_in_pixels(filmed):
    """On filmed people, perfect detections agree with each other everywhere."""
    rows = slice(0, 20)
    unit = oks_units(filmed.views.boxes[rows])
    keypoints = np.where(filmed.views.visibility[rows][..., None] == 4, np.nan, filmed.views.pixels[rows])
    found = find_consensus(filmed.rig, keypoints, unit)
    known = np.isfinite(found.joints[..., 0])
    assert known.mean() > 0.95
    np.testing.assert_allclose(found.joints[known], filmed.sequence.joints[rows][known], atol=1e-3)
