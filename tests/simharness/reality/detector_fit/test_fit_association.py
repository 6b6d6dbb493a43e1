from dataclasses import replace

import numpy as np
import pytest

from mvpose import Detections
from simharness.reality.detector_fit import sizes
from simharness.reality.detector_fit.association import associate
from simharness.reality.detector_fit.sample import LIMB_JOINTS, Sample, of_shelf, of_simulation
from simharness.scenario.sections.detector import Detector


def associated(twin, *, frames=20, known=None, **parameters):
    sample = twin.detected(Detector.model_validate(parameters), seed=3, known=known)
    sample = Sample("part", sample.rig, sample.time[:frames], sample.reference[:frames], sample.detections[:frames])
    pixels = np.stack([camera.project(sample.reference) for camera in twin.rig], axis=1)
    return sample, associate(sample, pixels, sizes.boxes(sample.reference, twin.rig))


def test_perfect_detections_are_associated_with_their_person(twin):
    _, found = associated(twin)
    detected = (np.isfinite(found.keypoints[..., LIMB_JOINTS, 0]).sum(axis=-1) >= 3) & found.detected
    assert detected.mean() > 0.9
    np.testing.assert_allclose(found.keypoints[detected], np.where(
        np.isfinite(found.keypoints[detected]), twin.views.pixels[:20][detected], np.nan
    ))  # fmt: skip
    assert found.false.sum() == found.duplicates.sum() == 0
    assert found.unannotated.shape[1] == 0
    seen = np.isfinite(found.consensus).all(axis=-1)
    assert seen.mean() > 0.9
    np.testing.assert_allclose(found.consensus[seen], twin.sequence.joints[:20][seen], atol=1e-3)


def test_people_without_annotation_are_not_false_positives(twin):
    known = np.ones((len(twin.sequence), 4), bool)
    known[:, 2] = False
    _, found = associated(twin, known=known)
    assert not found.detected[:, :, 2].any()
    assert found.false.sum() <= 2  # of 100 pictures
    near = np.linalg.norm(found.unannotated - twin.sequence.joints[:20, 2, None], axis=-1)
    assert (np.nanmin(np.nanmean(near, axis=-1), axis=1) < 0.01).all()


def test_phantoms_are_false_positives_and_duplicates_are_not(twin):
    _, found = associated(twin, frames=100, phantoms={"rate": 0.5}, boxes={"duplicates": 0.2})
    assert found.false.mean() == pytest.approx(0.5, abs=5 * np.sqrt(0.5 / 500))
    share = found.duplicates.sum() / found.detected.sum()
    assert share == pytest.approx(0.2, abs=5 * np.sqrt(0.16 / found.detected.sum()))
    assert ((found.false_scores > 0).any(axis=-1).sum(axis=-1) == found.false).all()


def test_detections_with_too_few_joints_are_fragments(twin):
    sample, _ = associated(twin, frames=3)
    scores = np.zeros((1, 17))
    scores[0, [0, 5]] = 0.5
    odd = Detections.from_keypoints([1], np.full((1, 17, 2), 50.0), scores)
    frames = tuple(odd for _ in sample.detections)
    pixels = np.stack([camera.project(sample.reference) for camera in twin.rig], axis=1)
    found = associate(replace(sample, detections=frames), pixels, sizes.boxes(sample.reference, twin.rig))
    assert found.fragments.tolist() == [[0, 1, 0, 0, 0]] * 3
    assert found.false.sum() == 0
    assert not found.detected.any()


def test_a_simulated_sample_has_no_more_truth_than_shelf(twin):
    known = np.ones((len(twin.sequence), 4), bool)
    known[:10, 1] = False
    sample = of_simulation(twin.sequence.joints, twin.sequence.time, twin.detected(Detector()).detections, twin.rig,
                           known=known)  # fmt: skip
    assert np.isnan(sample.reference[:, :, :5]).all()
    assert (sample.known == known).all()
    assert sample.step == pytest.approx(0.04)


def test_partly_known_people_are_refused(twin):
    joints = twin.sequence.joints[:2].copy()
    joints[1, 3, 7] = np.nan
    with pytest.raises(
        ValueError, match=r"expected all or none of the 12 limb joints .* got 11 for person 3 in frame 1"
    ):
        Sample("bad", twin.rig, twin.sequence.time[:2], joints, [Detections.empty()] * 2)
    with pytest.raises(ValueError, match="expected detections of 2 frames, got 1"):
        Sample("bad", twin.rig, twin.sequence.time[:2], twin.sequence.joints[:2], [Detections.empty()])


def test_joints_of_shelf_are_mapped_to_coco(shared_data):
    from simharness.reality.shelf import read_shelf

    shelf = read_shelf(shared_data / "shelf", frames=range(300, 310))
    sample = of_shelf(shelf)
    assert sample.known.sum(axis=0).tolist() == np.isfinite(shelf.truth[..., 0, 0]).sum(axis=0).tolist()
    for coco, name in ((15, 5), (16, 0), (9, 11), (5, 9), (12, 2)):  # SHELF14: left ankle 5, right ankle 0, ...
        np.testing.assert_array_equal(sample.reference[:, :, coco], shelf.truth[:, :, name])
