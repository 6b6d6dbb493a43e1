"""Twins of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from simharness.reality.annotation_errors import AnnotationModel, annotated_joints
from simharness.reality.detector_fit.detector_measurement import agreement
from simharness.reality.detector_fit.fit import fit
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS
from simharness.reality.twin import TwinModel, detected_twin, simulate_twins
from simharness.scenario.sections.detector_section import BiasSection, DetectorSection

DETECTOR = DetectorSection.model_validate(
    {"name": "known", "kind": "bottom-up", "keypoints": {"scatter": 0.3}, "boxes": {"missed": 0.1}}
)


@pytest.fixture(scope="module")
def model(reenacted):
    """Recording in which actor 2 is not annotated at first and away in the end, and actor 3 never appears."""
    recording = reenacted.recording
    truth = np.concatenate([recording.truth, np.full((60, 1, 14, 3), np.nan)], axis=1)
    truth[:10, 2] = np.nan
    truth[40, 1, 3] = np.nan
    recording = replace(recording, truth=truth, actors=(0, 2), name="two parts")
    errors = AnnotationModel(np.full((4, 14, 3), 0.02), np.full((4, 14), 0.005), 0.2, 0.0)
    return TwinModel(recording, reenacted.people, DETECTOR, errors, (reenacted.film,))


@pytest.fixture(scope="module")
def twin(model):
    return detected_twin(model, model.films[0], seed=0)


class TestTwin:
    def test_it_has_the_frame_numbers_cameras_and_actors_of_its_recording(self, model, twin):
        real = model.recording
        np.testing.assert_array_equal(twin.frames, real.frames)
        assert (twin.rig, twin.rate, twin.kind, twin.actors) == (real.rig, real.rate, real.kind, real.actors)
        assert twin.name == "two parts twin"

    def test_the_same_joints_are_annotated(self, model, twin):
        np.testing.assert_array_equal(np.isnan(twin.truth), np.isnan(model.recording.truth))

    def test_people_are_within_centimetres_of_the_recorded_ones(self, model, twin):
        """Without the errors of the annotation, which are 35 mm here."""
        exact = AnnotationModel(np.zeros((4, 14, 3)), np.zeros((4, 14)), 0.0, 0.0)
        truth = detected_twin(replace(model, annotation=exact), model.films[0], seed=0).truth
        away = np.linalg.norm(truth - model.recording.truth, axis=-1)[..., SHELF14_OF_LIMBS]
        assert np.nanmedian(away) < 0.02
        away = np.linalg.norm(twin.truth - truth, axis=-1)
        assert np.nanmedian(away) == pytest.approx(np.sqrt(3) * 0.02, abs=0.005)

    def test_bodies_of_actors_are_annotated(self, model):
        """The truth is that of the bodies that were filmed, whatever the order of the tracks."""
        exact = AnnotationModel(np.zeros((4, 14, 3)), np.zeros((4, 14)), 0.0, 0.0)
        truth = detected_twin(replace(model, annotation=exact), model.films[0], seed=0).truth
        made = annotated_joints(model.films[0].joints)
        for person, actor in enumerate(model.people.ids):
            known = np.isfinite(truth[:, actor])
            np.testing.assert_array_equal(truth[:, actor][known], made[:, person][known])

    def test_detections_have_the_errors_of_the_fitted_detector(self, model, twin):
        count = sum(len(found) for found in twin.detections)
        assert count == pytest.approx(0.9 * 5 * (30 * 3 + 30 * 2), rel=0.06)
        for found in twin.detections:
            missing = found.scores == 0
            for parent, joint in ((7, 9), (8, 10), (13, 15), (14, 16)):  # bottom-up
                assert not (missing[:, parent] & ~missing[:, joint]).any()

    def test_the_bias_of_limbs_is_in_the_film_already(self, model, twin):
        """Bodies re-enact joints as detected: hips that the detector raises are raised in the film."""
        bias = BiasSection(hips=(0.0, 0.01, 0.05), ankles=(0.0, 0.0, 0.03))
        biased = detected_twin(
            replace(model, detector=DETECTOR.model_copy(update={"bias": bias})), model.films[0], seed=0
        )
        np.testing.assert_array_equal(biased.truth, twin.truth)
        for one, same in zip(twin.detections, biased.detections, strict=True):
            np.testing.assert_array_equal(one.keypoints, same.keypoints)

    def test_it_is_that_of_its_seed(self, model, twin):
        again, other = (detected_twin(model, model.films[0], seed=seed) for seed in (0, 1))
        np.testing.assert_array_equal(again.truth, twin.truth)
        for one, same in zip(twin.detections, again.detections, strict=True):
            np.testing.assert_array_equal(one.keypoints, same.keypoints)
        assert np.nanmedian(np.abs(other.truth - twin.truth)) > 0.001
        assert any(
            one.keypoints.shape != each.keypoints.shape
            or not np.allclose(one.keypoints, each.keypoints, equal_nan=True)
            for one, each in zip(twin.detections, other.detections, strict=True)
        )

    def test_films_that_exist_are_used(self, model, twin):
        (made,) = simulate_twins(model, count=1)
        np.testing.assert_array_equal(made.truth, twin.truth)
        for one, same in zip(twin.detections, made.detections, strict=True):
            np.testing.assert_array_equal(one.keypoints, same.keypoints)

    @pytest.mark.slow
    def test_each_twin_has_a_seed_of_its_own(self, model, twin):
        first, second = simulate_twins(model, count=2)
        np.testing.assert_array_equal(first.truth, twin.truth)
        away = np.linalg.norm(second.truth - first.truth, axis=-1)
        assert 0.001 < np.nanmedian(away) < 0.03


@pytest.mark.slow
def test_a_twin_measures_as_its_recording(filmed):
    """Fit, simulate, fit again: the detector of the twin is that of the recording."""
    recording = filmed.recording(
        kind="bottom-up",
        keypoints={
            "scatter": 0.35, "jitter": 0.03, "miss": 0.02,
            "drop": {"visible": 0.01, "self_occluded": 0.1, "occluded": 0.4},
        },
        correlation={"scatter_life": 0.2, "scatter_noise": 0.4},
        scores={"good": 0.8, "jitter": 0.7, "miss": 0.4, "hidden": 0.8, "deviation": 0.4},
        boxes={"missed": 0.03},
        bias={"hips": [0.0, 0.01, 0.03]},
    )  # fmt: skip
    fitted = fit(recording, resamples=100)
    (twin,) = simulate_twins(TwinModel.of_fit(recording, fitted), count=1)
    again = fit(twin, resamples=100)
    different, compared = agreement(fitted.real, again.real)
    assert compared > 90
    # Of independent values 5 % would differ; many are correlated, and visibility is that of other bodies.
    assert len(different) <= 0.2 * compared, different
    hips = [each.annotation.bias[6, 2] for each in (fitted, again)]
    assert hips == pytest.approx([0.03, 0.03], abs=0.015)
    order = [list(again.people.ids).index(actor) for actor in fitted.people.ids]
    before, after = fitted.people.joints, again.people.joints[:, order]
    assert np.nanmedian(np.linalg.norm((after - before)[..., LIMB_JOINTS, :], axis=-1)) < 0.04
    raised = (after - before)[..., 11:13, 2] - (after - before)[..., 5:7, 2]  # hips, relative to the shoulders
    assert abs(np.nanmedian(raised)) < 0.012
