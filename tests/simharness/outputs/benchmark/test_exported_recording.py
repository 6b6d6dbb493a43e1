"""An exported sequence is a recording: it is read back with the detections, cameras and joints of the trial."""

import numpy as np
import pytest
from trials import simulated

from mvpose import COCO17, SHELF14
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.reality.recording_file import read_recording
from simharness.scenario.sections.cameras_section import FaultsSection


@pytest.fixture(scope="module")
def known(trial):
    return simulated(trial.scenario)


def test_the_recording_is_the_trial(folder, trial, known):
    recording = read_recording(folder)
    sequence, detected = known
    assert (recording.name, recording.rate, recording.scored) == ("tiny", trial.scenario.rate, (0, 1, 2))
    np.testing.assert_array_equal(recording.frames, np.arange(trial.scenario.frames))
    np.testing.assert_allclose(recording.truth, sequence.of_skeleton(SHELF14))
    for ours, given in zip(recording.detections, detected, strict=True):
        shown = given.detections.detected.any(axis=1)
        np.testing.assert_allclose(np.sort(ours.view), np.sort(given.detections.view[shown]))
        order = np.lexsort((np.flatnonzero(shown), given.detections.view[shown]))
        rows = np.flatnonzero(shown)[order]
        np.testing.assert_allclose(ours.keypoints, given.detections.keypoints[rows], atol=1e-9)
        np.testing.assert_allclose(ours.scores, given.detections.scores[rows], atol=1e-9)
        assert ours.skeleton == COCO17


def test_the_cameras_are_those_that_a_method_is_given(folder, trial):
    recording = read_recording(folder)
    for ours, believed, true in zip(recording.rig, trial.exposures.believed_rig, trial.exposures.true_rig, strict=True):
        np.testing.assert_allclose(ours.P, believed.P, rtol=1e-6)
        assert not np.allclose(ours.P, true.P, rtol=1e-6)
        assert ours.size == believed.size


def test_without_faults_and_with_every_second_frame(scenario, tmp_path):
    plan = ExportPlan(tmp_path / "tiny", every=2, pictures=False)
    sequence, _ = simulated(given := scenario(faults=FaultsSection()))
    recording = read_recording(export_sequence(given, plan))
    assert recording.rate == given.rate / 2
    assert recording.frames.tolist() == [0, 1]
    np.testing.assert_allclose(recording.truth, sequence.of_skeleton(SHELF14)[::2])
