"""Calibration of measured errors by simulation."""

import numpy as np
import pytest

from simharness.reality.detector_fit.detector_measurement import measure_detector, point_estimates
from simharness.reality.detector_fit.fit import FACTORS, SHARES, calibrate
from simharness.reality.detector_fit.profile import settings
from simharness.scenario.sections.detector_section import KINDS

TRUE = {"keypoints.scatter": 0.4, "keypoints.miss": 0.06, "keypoints.jitter": 0.12}


def mean(values, key):
    return np.mean([values[f"{key}.{kind}"] for kind in KINDS[3:]])


@pytest.mark.slow
def test_calibrated_parameters_are_nearer_to_the_true_ones(filmed):
    """Of a poor detector too few jitters and too many misses are measured, because other views err as well."""
    errors = {key.split(".")[1]: value for key, value in TRUE.items()}
    measured = measure_detector(filmed.sample(kind="bottom-up", keypoints=errors), resamples=10)

    def simulate(values):
        return [point_estimates(filmed.sample(seed=5, **settings(measured.with_values(values), name="fitted")))]

    real = {key: each.value for key, each in measured.values.items()}
    calibrated = calibrate(real, simulate)
    for key in ("keypoints.miss", "keypoints.jitter"):
        before, after = (abs(mean(values, key) - TRUE[key]) for values in (real, calibrated))
        assert after < 0.6 * before, key
    assert mean(calibrated, "keypoints.scatter") == pytest.approx(0.4, rel=0.08)
    untouched = [key for key in real if not key.startswith((*SHARES, *FACTORS))]
    np.testing.assert_array_equal([calibrated[key] for key in untouched], [real[key] for key in untouched])


@pytest.mark.slow
def test_calibrated_parameters_of_hidden_joints_are_nearer_to_the_true_ones(filmed):
    """Capsules take some visible joints for hidden ones, so that measured factors are too near to each other."""
    true = {
        "keypoints.self_occluded": {"elbows": 4.0, "wrists": 4.0},
        "keypoints.scatter_hidden": {"shoulders": 1.6, "hips": 1.6},
        "keypoints.jitter_mean": {"shoulders": 0.2, "hips": 0.2},
    }
    errors = {"scatter": 0.3, "jitter": 0.05, **{key.split(".")[1]: kinds for key, kinds in true.items()}}
    measured = measure_detector(filmed.sample(staged=True, kind="bottom-up", keypoints=errors), resamples=10)

    def simulate(values):
        fitted = settings(measured.with_values(values), name="fitted")
        return [point_estimates(filmed.sample(seed=seed, staged=True, **fitted)) for seed in (5, 6)]

    real = {key: each.value for key, each in measured.values.items()}
    calibrated = calibrate(real, simulate)
    for key, kinds in true.items():
        wanted = np.array(list(kinds.values()))
        before, after = (
            np.abs(np.log([values[f"{key}.{kind}"] for kind in kinds] / wanted)).mean() for values in (real, calibrated)
        )
        assert after < 0.75 * before, (key, before, after)


def test_a_simulation_that_measures_alike_changes_nothing(filmed):
    sample = filmed.sample(keypoints={"scatter": 0.3, "jitter": 0.05})
    real = {key: each.value for key, each in measure_detector(sample, resamples=10).values.items()}
    calibrated = calibrate(real, lambda values: [point_estimates(sample)], rounds=1)
    for key, value in real.items():
        assert calibrated[key] == pytest.approx(value, rel=1e-6, nan_ok=True), key
