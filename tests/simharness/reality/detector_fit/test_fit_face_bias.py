import numpy as np

from simharness.detector.viewing_conditions import world_offsets
from simharness.reality.detector_fit.fit import face_bias
from simharness.scenario.sections.detector_section import BiasSection

BIAS = BiasSection(nose=(0.02, 0.0, -0.01), eyes=(0.01, 0.004, 0.0), ears=(-0.02, 0.01, 0.03), hips=(0.0, 0.0, 0.05))
FACE = np.array([BIAS.nose, BIAS.eyes, BIAS.ears])


def test_offsets_of_the_face_are_those_of_the_detector(filmed):
    staged = filmed.sequence.joints
    np.testing.assert_allclose(face_bias(staged + world_offsets(staged, BIAS), staged), FACE, atol=1e-9)


def test_outliers_and_absent_people_do_not_count(filmed):
    staged = filmed.sequence.joints.copy()
    tracked = staged + world_offsets(staged, BIAS)
    rng = np.random.default_rng(0)
    tracked += rng.normal(0, 0.01, tracked.shape)
    tracked[rng.random(tracked.shape[:2]) < 0.2] += 0.5
    tracked[:60, 0] = np.nan
    staged[:, 2] = np.nan
    # Medians of 140 and more frames of two people and sides are known to about 2 mm.
    np.testing.assert_allclose(face_bias(tracked, staged), FACE, atol=0.006)


def test_without_anybody_there_is_no_bias():
    nobody = np.full((5, 2, 17, 3), np.nan)
    np.testing.assert_array_equal(face_bias(nobody, nobody), np.zeros((3, 3)))
