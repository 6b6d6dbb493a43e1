"""Scores that fall with distance."""

import numpy as np
import pytest
from scipy.special import logit
from worlds import world

from simharness.detector.detect import detect
from simharness.detector.score_distance import USUAL
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.truth import KeypointError


def scored(where, **scores):
    config = DetectorSection.model_validate(
        {"keypoints": {"scatter": 0.4, "jitter": 0.2, "miss": 0.2}, "scores": {"good": 0.8, "miss": 0.4, **scores}}
    )
    return detect(where.sequence, where.views, where.rig, config, seed=1)


def test_the_logit_falls_by_the_slope_within_a_class():
    where = world(frames=100, views=2, people=1)
    usual, sloped = scored(where), scored(where, slope=0.9)
    fall, far, error = [], [], []
    for before, after in zip(usual, sloped, strict=True):
        assert (before.truth.error == after.truth.error).all()
        with np.errstate(invalid="ignore"):  # joints that are not reported
            fall.append(logit(after.detections.scores) - logit(before.detections.scores))
        target = before.truth.pixels[before.detections.view, before.truth.person]
        unit = np.sqrt(0.53 * 0.4) * 300.0 * np.asarray(before.detections.skeleton.sigmas)
        far.append(np.linalg.norm(before.detections.keypoints - target, axis=-1) / unit)
        error.append(before.truth.error)
    fall, far, error = (np.concatenate(each).ravel() for each in (fall, far, error))
    for kind in (KeypointError.GOOD, KeypointError.MISS):
        of_kind = error == kind
        assert of_kind.sum() > 200
        expected = -0.9 * (np.log1p(far[of_kind]) - np.log1p(USUAL[kind]))
        np.testing.assert_allclose(fall[of_kind], expected, atol=1e-6)


@pytest.mark.parametrize("slope", [0.0, 2.0])
def test_no_score_leaves_its_range(slope):
    for frame in scored(world(frames=20, views=2), slope=slope, deviation=1.0):
        reported = np.isfinite(frame.detections.keypoints[..., 0])
        assert (frame.detections.scores[reported] > 0).all()
        assert (frame.detections.scores <= 1).all()
        assert (frame.detections.scores[~reported] == 0).all()
