"""Treatments: what they change, how much, and that draws are paired."""

import numpy as np
import pytest
from turning_people import walkers

from simharness.reality.validation.treatments import KINDS, Treatment, treatments

DETECTION = ("noise", "drop", "miss", "phantoms")
CALIBRATION = ("rotation", "translation")


@pytest.fixture(scope="module")
def recording():
    return walkers(frames=60, people=3, cameras=4)


def equal(one, other):
    np.testing.assert_array_equal(one.view, other.view)
    np.testing.assert_array_equal(one.keypoints, other.keypoints)
    np.testing.assert_array_equal(one.scores, other.scores)
    np.testing.assert_array_equal(one.boxes, other.boxes)


@pytest.mark.parametrize("kind", KINDS)
def test_level_zero_changes_nothing(recording, kind):
    treated = Treatment(kind, 0.0)(recording)
    for one, other in zip(treated.detections, recording.detections, strict=True):
        equal(one, other)
    np.testing.assert_array_equal(treated.rig.P, recording.rig.P)


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_and_the_frames_stay(recording, kind):
    treated = Treatment(kind, KINDS[kind].levels[-1])(recording)
    np.testing.assert_array_equal(treated.truth, recording.truth)
    np.testing.assert_array_equal(treated.frames, recording.frames)
    if KINDS[kind].calibration:
        for one, other in zip(treated.detections, recording.detections, strict=True):
            equal(one, other)
    else:
        np.testing.assert_array_equal(treated.rig.P, recording.rig.P)


@pytest.mark.parametrize("kind", DETECTION)
def test_draws_do_not_depend_on_the_other_frames(recording, kind):
    treatment = Treatment(kind, KINDS[kind].levels[-1])
    some = np.arange(10, 20)
    if kind == "phantoms":  # their poses are from other frames, but not their number
        alone, whole = treatment(recording.during(some)), treatment(recording).during(some)
        assert [len(each) for each in alone.detections] == [len(each) for each in whole.detections]
        return
    alone, whole = treatment(recording.during(some)), treatment(recording).during(some)
    for one, other in zip(alone.detections, whole.detections, strict=True):
        equal(one, other)


@pytest.mark.parametrize("kind", KINDS)
def test_other_draws_differ(recording, kind):
    level = KINDS[kind].levels[-1]
    one, other = (Treatment(kind, level, draw)(recording) for draw in (0, 1))
    if KINDS[kind].calibration:
        assert np.abs(one.rig.P - other.rig.P).max() > 1e-3
    else:
        assert any(
            len(a) != len(b) or not np.array_equal(a.keypoints, b.keypoints, equal_nan=True)
            for a, b in zip(one.detections, other.detections, strict=True)
        )


class TestNoise:
    @pytest.mark.parametrize("level", [6.0, 24.0])
    def test_the_realised_deviation_is_the_level(self, recording, level):
        treated = Treatment("noise", level)(recording)
        shift = np.concatenate(
            [
                (after.keypoints - before.keypoints).ravel()
                for after, before in zip(treated.detections, recording.detections, strict=True)
            ]
        )
        assert shift.std() == pytest.approx(level, rel=0.02)
        assert abs(shift.mean()) < 4 * level / np.sqrt(len(shift))

    def test_recordings_with_other_detections_get_the_same_draws(self, recording):
        other = walkers(frames=60, people=3, cameras=4, noise=3.0, seed=5)
        shifts = [
            Treatment("noise", 12.0)(each).detections[7].keypoints - each.detections[7].keypoints
            for each in (recording, other)
        ]
        np.testing.assert_allclose(*shifts, atol=1e-9)

    def test_a_level_is_a_multiple_of_another(self, recording):
        shifts = [
            Treatment("noise", level)(recording).detections[3].keypoints - recording.detections[3].keypoints
            for level in (6.0, 24.0)
        ]
        np.testing.assert_allclose(4 * shifts[0], shifts[1], atol=1e-9)


class TestDrops:
    @pytest.mark.parametrize("share", [0.1, 0.4])
    def test_the_realised_share_is_the_level(self, recording, share):
        treated = Treatment("drop", share)(recording)
        missing = np.concatenate([each.scores == 0 for each in treated.detections])
        assert missing.mean() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / missing.size))

    def test_more_drops_contain_fewer(self, recording):
        few, many = (Treatment("drop", share)(recording).detections for share in (0.1, 0.2))
        for one, other in zip(few, many, strict=True):
            assert (one.scores[other.detected] > 0).all()

    def test_what_stays_is_unchanged(self, recording):
        for before, after in zip(recording.detections, Treatment("drop", 0.4)(recording).detections, strict=True):
            np.testing.assert_array_equal(after.keypoints[after.detected], before.keypoints[after.detected])


class TestMissedPeople:
    def test_the_realised_share_is_the_level(self, recording):
        total = sum(len(each) for each in recording.detections)
        left = sum(len(each) for each in Treatment("miss", 0.2)(recording).detections)
        assert 1 - left / total == pytest.approx(0.2, abs=4 * np.sqrt(0.2 * 0.8 / total))

    def test_whole_detections_are_removed(self, recording):
        for before, after in zip(recording.detections, Treatment("miss", 0.4)(recording).detections, strict=True):
            rows = {row.tobytes() for row in before.keypoints}
            assert all(row.tobytes() in rows for row in after.keypoints)


class TestPhantoms:
    @pytest.mark.parametrize("rate", [0.5, 2.0])
    def test_the_realised_rate_is_the_level(self, recording, rate):
        treated = Treatment("phantoms", rate)(recording)
        added = [
            len(after) - len(before) for after, before in zip(treated.detections, recording.detections, strict=True)
        ]
        pictures = len(recording) * len(recording.rig)
        assert sum(added) / pictures == pytest.approx(rate, abs=4 * np.sqrt(rate / pictures))

    @pytest.mark.slow
    def test_detections_stay_and_phantoms_have_real_poses(self, recording):
        treated = Treatment("phantoms", 2.0)(recording)
        shapes = [each.keypoints - each.boxes[:, None, :2] for each in recording.detections]
        for frame, (after, before) in enumerate(zip(treated.detections, recording.detections, strict=True)):
            np.testing.assert_array_equal(after.keypoints[: len(before)], before.keypoints)
            for row in range(len(before), len(after)):
                pose = after.keypoints[row] - after.boxes[row, :2]
                flipped = pose[list(after.skeleton.mirror)] * [-1, 1] + [after.boxes[row, 2], 0]
                matches = [
                    source
                    for source, each in enumerate(shapes)
                    for candidate in each[recording.detections[source].view == after.view[row]]
                    if np.allclose(candidate, pose, atol=1e-6) or np.allclose(candidate, flipped, atol=1e-6)
                ]
                assert matches
                assert frame not in matches

    def test_they_lie_in_the_picture(self, recording):
        for after, before in zip(Treatment("phantoms", 2.0)(recording).detections, recording.detections, strict=True):
            boxes = after.boxes[len(before) :]
            assert (boxes[:, :2] >= 0).all()
            assert (boxes[:, :2] + boxes[:, 2:] <= np.maximum([1032, 776], boxes[:, 2:]) + 1e-9).all()


class TestCalibration:
    def test_turned_cameras_stay_in_place(self, recording):
        treated = Treatment("rotation", 1.0)(recording)
        np.testing.assert_allclose(treated.rig.centers, recording.rig.centers, atol=1e-9)

    def test_moved_cameras_keep_their_direction(self, recording):
        treated = Treatment("translation", 10.0)(recording)
        for one, other in zip(treated.rig, recording.rig, strict=True):
            np.testing.assert_array_equal(one.R, other.R)

    def test_the_realised_sizes_are_the_levels(self, recording):
        angles, shifts = [], []
        for draw in range(60):
            turned = Treatment("rotation", 1.0, draw)(recording).rig
            moved = Treatment("translation", 5.0, draw)(recording).rig
            for one, other, base in zip(turned, moved, recording.rig, strict=True):
                angles.append(np.degrees(np.arccos(np.clip((np.trace(one.R @ base.R.T) - 1) / 2, -1, 1))))
                shifts.append(np.linalg.norm(other.center - base.center))
        assert np.sqrt(np.mean(np.square(angles))) == pytest.approx(np.sqrt(3), rel=0.1)
        assert np.sqrt(np.mean(np.square(shifts))) == pytest.approx(0.05 * np.sqrt(3), rel=0.1)

    @pytest.mark.parametrize("kind", CALIBRATION)
    def test_recordings_with_the_same_cameras_get_the_same_errors(self, recording, kind):
        treatment = Treatment(kind, KINDS[kind].levels[0])
        np.testing.assert_array_equal(treatment(recording).rig.P, treatment(walkers(frames=2, cameras=4)).rig.P)


def test_a_validation_has_every_level_and_draw():
    every = treatments(draws=4, detection_draws=2)
    assert len(set(every)) == len(every) == 4 * 3 * 2 + 2 * 3 * 4
