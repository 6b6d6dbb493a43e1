from dataclasses import replace

import numpy as np
import pytest

from mvpose import Detections
from simharness.reality.detector_fit import occlusion
from simharness.reality.detector_fit.association import associate
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample, sample_of
from simharness.reality.people_tracks import track_people


def associated(sample, *, frames=20):
    """Return the first frames of a sample, and the people whom its detections show."""
    part = replace(
        sample,
        time=sample.time[:frames],
        reference=sample.reference[:frames],
        detections=sample.detections[:frames],
        measured=None if sample.measured is None else sample.measured[:frames],
    )
    pixels = np.stack([camera.project(part.reference) for camera in part.rig], axis=1)
    return part, associate(part, pixels, occlusion.person_boxes(part.reference, part.rig))


def test_perfect_detections_are_associated_with_their_person(filmed):
    _, found = associated(filmed.sample())
    detected = (np.isfinite(found.keypoints[..., LIMB_JOINTS, 0]).sum(axis=-1) >= 3) & found.detected
    assert detected.mean() > 0.9
    np.testing.assert_allclose(found.keypoints[detected], np.where(
        np.isfinite(found.keypoints[detected]), filmed.views.pixels[:20][detected], np.nan
    ))  # fmt: skip
    assert found.false.sum() == found.duplicates.sum() == 0
    assert found.unannotated.shape[1] == 0
    seen = np.isfinite(found.consensus).all(axis=-1)
    assert seen.mean() > 0.9
    np.testing.assert_allclose(found.consensus[seen], filmed.sequence.joints[:20][seen], atol=1e-3)


def test_people_who_are_not_in_the_sample_are_not_false_positives(filmed):
    sample = filmed.sample()
    others = replace(sample, reference=sample.reference[:, [0, 2]])
    _, found = associated(others)
    assert found.false.sum() <= 2  # of 100 pictures
    near = np.linalg.norm(found.unannotated - filmed.sequence.joints[:20, 1, None], axis=-1)
    assert (np.nanmin(np.nanmean(near, axis=-1), axis=1) < 0.01).all()


def test_phantoms_are_false_positives_and_duplicates_are_not(filmed):
    _, found = associated(filmed.sample(phantoms={"rate": 0.5}, boxes={"duplicates": 0.2}), frames=100)
    assert found.false.mean() == pytest.approx(0.5, abs=5 * np.sqrt(0.5 / 500))
    share = found.duplicates.sum() / found.detected.sum()
    assert share == pytest.approx(0.2, abs=5 * np.sqrt(0.16 / found.detected.sum()))
    assert ((found.false_scores > 0).any(axis=-1).sum(axis=-1) == found.false).all()


def test_detections_with_too_few_joints_are_fragments(filmed):
    sample, _ = associated(filmed.sample(), frames=3)
    scores = np.zeros((1, 17))
    scores[0, [0, 5]] = 0.5
    odd = Detections.from_keypoints([1], np.full((1, 17, 2), 50.0), scores)
    frames = tuple(odd for _ in sample.detections)
    pixels = np.stack([camera.project(sample.reference) for camera in filmed.rig], axis=1)
    found = associate(replace(sample, detections=frames), pixels, occlusion.person_boxes(sample.reference, filmed.rig))
    assert found.fragments.tolist() == [[0, 1, 0, 0, 0]] * 3
    assert found.false.sum() == 0
    assert not found.detected.any()


def test_the_sample_of_a_recording_measures_those_who_are_annotated(filmed):
    recording = filmed.recording()
    truth = recording.truth.copy()
    truth[:10, 1] = np.nan
    truth[:, 2] = np.nan
    recording = replace(recording, truth=truth)
    tracks = track_people(recording)
    sample = sample_of(recording, tracks)
    expected = np.ones((len(filmed), 3), bool)
    expected[:10, tracks.ids == 1] = False
    expected[:, tracks.ids >= 3] = False
    np.testing.assert_array_equal(sample.known, expected)
    assert np.isfinite(sample.reference).all()  # everybody hides others
    assert sample.step == pytest.approx(0.04)
    nobody = replace(recording, truth=np.full(truth.shape, np.nan))
    assert sample_of(nobody, track_people(nobody)).known.all()  # everyone, where nobody is annotated


def test_partly_known_people_are_refused(filmed):
    joints = filmed.sequence.joints[:2].copy()
    joints[1, 2, 7] = np.nan
    with pytest.raises(
        ValueError, match=r"expected all or none of the 12 limb joints .* got 11 for person 2 in frame 1"
    ):
        Sample("bad", filmed.rig, filmed.sequence.time[:2], joints, [Detections.empty()] * 2)
    with pytest.raises(ValueError, match="expected detections of 2 frames, got 1"):
        Sample("bad", filmed.rig, filmed.sequence.time[:2], filmed.sequence.joints[:2], [Detections.empty()])
