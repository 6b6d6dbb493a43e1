"""Times of pictures in trials: detections carry them, and truth follows the times of estimates."""

from dataclasses import replace

import numpy as np
import pytest
from moments import crowd, estimate_of, moment, recorded, ring

from mvpose import Rig, preset
from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial

SCENE = """
name = "times"
duration = 1.0
rate = 10
variants = ["track-fast", "fast"]
rendering.renderer = "rays"
people.count = 2
detector.profile = "typical"
detector.phantoms.rate = 2.0
"""


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("times") / "times.toml"
    path.write_text(SCENE)
    return lambda *overrides: run_trial(load(path, overrides=overrides), until="score")


@pytest.mark.slow
def test_detections_have_the_known_times_and_clocks_change_nothing_else(trial):
    blind, known = (
        trial("faults.clock_offset=0.06", "faults.dropped=0.3", f"faults.clocks_known={value}")
        for value in ("false", "true")
    )
    assert not np.array_equal(blind.trial.exposures.known_time, known.trial.exposures.known_time)
    for result in (blind, known):
        times = [frame.detections.time for frame in result.detected.frames]
        np.testing.assert_array_equal(times, result.trial.exposures.known_time)
    for one, other in zip(blind.detected.frames, known.detected.frames, strict=True):
        assert one.detections.keypoints.tobytes() == other.detections.keypoints.tobytes()
    for one, other in zip(blind.estimates["fast"], known.estimates["fast"], strict=True):
        assert one.joints.tobytes() == other.joints.tobytes()
    assert blind.assessments["fast"].scores["pcp"] == known.assessments["fast"].scores["pcp"]


def test_no_camera_without_a_picture_has_detections(trial):
    for frame in trial("faults.dropped=0.5", "cameras.every=[1, 2]").detected.frames:
        assert np.isfinite(frame.detections.time[frame.detections.view]).all()


@pytest.mark.slow
def test_free_running_cameras_are_tracked_at_their_times(trial):
    result = trial('cameras.trigger="free"', "duration=1.5", "rate=25")
    offset = result.trial.exposures.known_time - result.recording.time[:, None]
    assert 0.005 < np.abs(offset).max() <= 0.5 / 25
    times = [each.time for each in result.estimates["track-fast"]]
    assert times == pytest.approx(result.trial.exposures.known_time.max(axis=1).tolist())
    together = trial("duration=1.5", "rate=25")
    scores = [each.assessments["track-fast"].scores for each in (result, together)]
    assert scores[0]["mpjpe_mm"] < scores[1]["mpjpe_mm"] + 5


@pytest.mark.slow
def test_the_readout_of_a_rolling_shutter_helps_trackers_only(trial):
    runners = ('people.activities=["run"]', "duration=2.0", "rate=25", "faults.rolling_shutter=0.03")
    result = trial(*runners, 'detector.profile="perfect"')
    frames = [frame.detections for frame in result.detected.frames]
    unknown = Rig([replace(camera, readout=0.0) for camera in result.detected.rig])
    assert all(camera.readout == 0.03 for camera in result.detected.rig)
    blind = {
        "fast": [preset("fast").estimate(unknown, seen) for seen in frames],
        "track-fast": list(preset("track-fast").track(unknown, frames)),
    }
    for one, other in zip(blind["fast"], result.estimates["fast"], strict=True):
        assert one.joints.tobytes() == other.joints.tobytes()

    def error(estimates):
        """Mean distance of the joints to those of the nearest person, metres, once the tracks are settled."""
        truth = [frame.truth.joints for frame in result.detected.frames]
        apart = [
            np.linalg.norm(estimate.joints[:, None] - joints, axis=-1).mean(axis=-1).min(axis=1)
            for estimate, joints in zip(estimates[20:], truth[20:], strict=True)
        ]
        return np.concatenate(apart).mean()

    assert error(result.estimates["track-fast"]) < 0.95 * error(blind["track-fast"])


class TestTruthAtTimesOfEstimates:
    RIG = ring(3)
    TIME = np.arange(8) / 10

    def recording(self, path, *, timed=True):
        """People whose place at a time is a function of it."""
        people = crowd(2)
        moments = [moment(self.RIG, people + path(time)) for time in self.TIME]
        if timed:
            moments = [
                (replace(seen, time=np.full(3, time)), truth)
                for time, (seen, truth) in zip(self.TIME, moments, strict=True)
            ]
        return people, recorded(self.RIG, *moments)

    def estimates(self, late):
        empty = estimate_of(np.zeros((0, 17, 3)), np.zeros(0, int))
        return [replace(empty, time=float(time + late)) for time in self.TIME]

    def test_a_cubic_motion_is_met_exactly(self):
        def path(time):
            return np.array([time, time**2, 3 * time**3 - time])

        people, recording = self.recording(path)
        for late in (0.03, -0.07, 0.13):
            moved = recording.at_times_of(self.estimates(late))
            for frame in range(2, 5):
                np.testing.assert_allclose(
                    moved.truth[frame].joints, people + path(self.TIME[frame] + late), atol=1e-12
                )

    def test_the_ends_follow_a_line(self):
        def path(time):
            return np.array([2 * time, 1 - time, 0.0])

        people, recording = self.recording(path)
        for late in (-0.15, 0.15):
            for frame, truth in enumerate(recording.at_times_of(self.estimates(late)).truth):
                np.testing.assert_allclose(truth.joints, people + path(self.TIME[frame] + late), atol=1e-12)

    def test_frames_without_a_time_of_their_own_stay(self):
        _, recording = self.recording(lambda time: np.array([time, 0.0, 0.0]))
        assert recording.at_times_of(self.estimates(0.0)) is recording
        assert recording.at_times_of([replace(each, time=None) for each in self.estimates(0.5)]) is recording
        _, timeless = self.recording(lambda time: np.array([time, 0.0, 0.0]), timed=False)
        assert timeless.at_times_of(self.estimates(0.5)) is timeless

    def test_absent_people_stay_absent_and_those_beside_them_stay_in_place(self):
        people, recording = self.recording(lambda time: np.array([time, 0.0, 0.0]))
        truth = list(recording.truth)
        joints = truth[4].joints.copy()
        joints[0] = np.nan
        truth[4] = replace(truth[4], joints=joints)
        moved = replace(recording, truth=tuple(truth)).at_times_of(self.estimates(0.05))
        assert np.isnan(moved.truth[4].joints[0]).all()
        np.testing.assert_allclose(moved.truth[3].joints[0], people[0] + [0.3, 0, 0], atol=1e-12)
        for frame in (2, 5):
            np.testing.assert_allclose(
                moved.truth[frame].joints[0], people[0] + [self.TIME[frame] + 0.05, 0, 0], atol=1e-12
            )
        np.testing.assert_allclose(moved.truth[4].joints[1], people[1] + [0.45, 0, 0], atol=1e-12)
