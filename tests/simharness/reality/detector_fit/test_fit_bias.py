import numpy as np

from simharness.detector.bias import world_offsets
from simharness.detector.conditions import oks_units
from simharness.reality.detector_fit.bias_fit import LinearisedBias, apply_bias, fit_bias
from simharness.reality.detector_fit.sizes import boxes
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS, Bias

BIAS = Bias(hips=(0.01, 0.02, 0.04), wrists=(-0.02, 0.0, 0.03), shoulders=(0.0, -0.01, 0.02))
EXPECTED = np.array([getattr(BIAS, kind) for kind in KINDS])


def seen(twin):
    joints = twin.sequence.joints[::10]
    biased = joints + world_offsets(joints, BIAS)
    keypoints = np.stack([camera.project(biased) for camera in twin.rig], axis=1)
    return joints, keypoints, oks_units(boxes(joints, twin.rig))


def test_apply_bias_moves_joints_as_the_detector_does(twin):
    joints = twin.sequence.joints[:5]
    np.testing.assert_allclose(apply_bias(joints, EXPECTED), joints + world_offsets(joints, BIAS), atol=1e-12)


def test_offsets_are_exact_without_noise(twin):
    joints, keypoints, unit = seen(twin)
    np.testing.assert_allclose(fit_bias(LinearisedBias.of(joints, keypoints, unit, twin.rig)), EXPECTED, atol=2e-4)


def test_offsets_are_robust_to_misses_and_scatter(twin):
    joints, keypoints, unit = seen(twin)
    rng = np.random.default_rng(0)
    noise = 0.4 * rng.normal(size=keypoints.shape)
    noise[rng.random(unit.shape) < 0.2] *= 20  # these are far off, in all directions
    noisy = keypoints + unit[..., None] * noise
    noisy[rng.random(unit.shape) < 0.1] = np.nan
    np.testing.assert_allclose(fit_bias(LinearisedBias.of(joints, noisy, unit, twin.rig)), EXPECTED, atol=0.004)


def test_a_kind_of_joint_without_detections_has_no_offset(twin):
    joints, keypoints, unit = seen(twin)
    keypoints[..., np.array(KIND_OF_JOINT) == KINDS.index("knees"), :] = np.nan
    found = fit_bias(LinearisedBias.of(joints, keypoints, unit, twin.rig))
    assert (found[KINDS.index("knees")] == 0).all()
    np.testing.assert_allclose(found[KINDS.index("hips")], BIAS.hips, atol=2e-4)
