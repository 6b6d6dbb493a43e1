"""Out-of-sample check of a fit."""

import numpy as np
import pytest

from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.reality.detector_fit.half_check import HalfCheck, check_halves
from simharness.reality.detector_fit.inference import misfit


def test_misfit_counts_squared_deviations_of_the_difference():
    """Two deviations off, of a difference of two equally noisy values: 4 / 2."""
    measured = {"keypoints.scatter.hips": MeasuredValue(1.0, np.exp(-1.96 * 0.1), np.exp(1.96 * 0.1), 10_000)}
    assert misfit(measured, {"keypoints.scatter.hips": 1.0}) == pytest.approx(0.0)
    assert misfit(measured, {"keypoints.scatter.hips": np.exp(0.2)}) == pytest.approx(2.0)
    assert misfit(measured, {"keypoints.scatter.hips": 100.0}) == 9.0


def test_misfit_is_that_of_known_parameters_alone():
    unknown = MeasuredValue(np.nan, np.nan, np.nan, 0)
    measured = {"keypoints.scatter.hips": unknown, "boxes.duplicates": MeasuredValue(0.1, 0.0, 0.2, 100)}
    assert np.isnan(misfit(measured, {"keypoints.scatter.hips": 1.0, "boxes.duplicates": 0.9}))


@pytest.mark.parametrize(("fitted", "shipped", "worse"), [(1.2, 3.0, False), (4.0, 3.0, True)])
def test_the_better_one_is_named(fitted, shipped, worse):
    check = HalfCheck("topdown", (fitted - 0.5, fitted + 0.5), (shipped, shipped))
    assert check.fit_is_worse == worse == check.summary()["worse"]
    assert str(check).startswith('use "topdown"') == worse
    assert f"{fitted:.1f}" in str(check)
    assert f"{shipped:.1f}" in str(check)


@pytest.mark.slow
def test_a_fit_predicts_an_unusual_detector_better_than_the_shipped_profile(filmed):
    recording = filmed.recording(keypoints={"scatter": 0.15, "jitter": 0.2}, boxes={"missed": 0.2})
    check = check_halves(recording, resamples=50)
    assert not check.fit_is_worse
    assert max(check.fitted) < 0.7 * min(check.shipped)
