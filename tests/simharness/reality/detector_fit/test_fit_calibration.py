"""Inference of the errors of simulated detectors, which measure otherwise than they are."""

import numpy as np
import pytest

from simharness.reality.detector_fit.detector_measurement import measure_detector, point_estimates
from simharness.reality.detector_fit.inference import SCALES, infer
from simharness.reality.detector_fit.profile import prior_of, settings
from simharness.scenario.sections.detector_section import KINDS

TRUE = {"keypoints.scatter": 0.4, "keypoints.miss": 0.06, "keypoints.jitter": 0.12}


def mean(values, key):
    return np.mean([values[f"{key}.{kind}"] for kind in KINDS[3:]])


@pytest.mark.slow
def test_inferred_parameters_are_nearer_to_the_true_ones(filmed):
    """Of a poor detector too few jitters and too many misses are measured, because other views err as well."""
    errors = {key.split(".")[1]: value for key, value in TRUE.items()}
    measured = measure_detector(filmed.sample(kind="bottom-up", keypoints=errors), resamples=10)

    def simulate(values, draw):
        fitted = settings(measured.with_values(values), name="fitted")
        return point_estimates(filmed.sample(seed=5 + draw, **fitted))

    real = {key: each.value for key, each in measured.values.items()}
    inferred = infer(measured.values, simulate, prior_of("bottom-up"))
    calibrated = {key: each.value for key, each in inferred.items()}
    for key in ("keypoints.miss", "keypoints.jitter"):
        before, after = (abs(mean(values, key) - TRUE[key]) for values in (real, calibrated))
        assert after < 0.6 * before, key
    assert mean(calibrated, "keypoints.scatter") == pytest.approx(0.4, rel=0.08)
    untouched = [key for key in real if not key.startswith(sum(SCALES.values(), ()))]
    np.testing.assert_array_equal([calibrated[key] for key in untouched], [real[key] for key in untouched])


@pytest.mark.slow
def test_inferred_parameters_of_hidden_joints_are_nearer_to_the_true_ones(filmed):
    """Capsules take some visible joints for hidden ones, so that measured factors are too near to each other."""
    true = {
        "keypoints.self_occluded": {"elbows": 4.0, "wrists": 4.0},
        "keypoints.scatter_hidden": {"shoulders": 1.6, "hips": 1.6},
        "keypoints.jitter_mean": {"shoulders": 0.2, "hips": 0.2},
    }
    # Their mean distance is told where jitters are many; factors, where jitters of visible joints are few.
    jitter = {**dict.fromkeys(KINDS, 0.05), "shoulders": 0.1, "hips": 0.1}
    errors = {"scatter": 0.3, "jitter": jitter, **{key.split(".")[1]: kinds for key, kinds in true.items()}}
    away = {key: np.zeros(2) for key in true}
    for seed in range(1, 5):  # one recording says little about jitters
        sample = filmed.sample(seed=seed, staged=True, kind="bottom-up", keypoints=errors)
        measured = measure_detector(sample, resamples=10)

        def simulate(values, draw, measured=measured, seed=seed):
            fitted = settings(measured.with_values(values), name="fitted")
            return point_estimates(filmed.sample(seed=100 * seed + draw, staged=True, **fitted))

        real = {key: each.value for key, each in measured.values.items()}
        calibrated = {key: each.value for key, each in infer(measured.values, simulate, prior_of("bottom-up")).items()}
        for key, kinds in true.items():
            wanted = np.array(list(kinds.values()))
            for k, values in enumerate((real, calibrated)):
                away[key][k] += np.abs(np.log([values[f"{key}.{kind}"] for kind in kinds] / wanted)).mean()
    for key, (before, after) in away.items():
        assert after < 0.75 * before, (key, before, after)
