"""What is left out of results: joints that say nothing, impossible speeds, parts of people, people of a moment."""

from dataclasses import replace

import numpy as np
import pytest
from lab_files import walk
from scipy.stats import chi, f

from mvpose import COCO17
from mvpose.formats.people.outliers import OutputLimits, expected_errors, within_limits
from mvpose.recording import People
from mvpose.report.examined_recording import expected_median

RATE = 25.0
ANKLE, HIP, NOSE = (COCO17.index(name) for name in ("left_ankle", "left_hip", "nose"))


def people(frames=40, *, sigma=0.02):
    """Two people who walk side by side."""
    joints = walk(frames)
    covariance = np.broadcast_to(sigma**2 * np.eye(3), (*joints.shape, 3)).copy()
    freedom = np.full(joints.shape[:3], 1e9)
    return People(np.arange(frames) / RATE, np.array([3, 8]), joints, 0.9, covariance, freedom=freedom)


def moved(given, frames, person, joint, by):
    joints = given.joints.copy()
    joints[frames, person, joint] += by
    return replace(given, joints=joints)


class TestNothingIsWrong:
    def test_people_who_walk_lose_nothing(self):
        given = people()
        kept, left_out = within_limits(given, OutputLimits())
        assert kept is given
        assert left_out.sentences() == []
        assert left_out.to_json()["by_person"] == {}

    def test_a_sprinter_and_a_kick_lose_nothing(self):
        joints = walk(50, speed=12.0)  # the fastest run is 12.4 m/s
        swing = 1.5 * np.sin(2 * np.pi * 1.3 * np.arange(50) / RATE)  # up to 12 m/s more
        joints[:, 0, ANKLE, 1] += swing
        given = People(np.arange(50) / RATE, np.array([3, 8]), joints)
        assert within_limits(given, OutputLimits())[0] is given


class TestUncertainJoints:
    def test_joints_beyond_the_largest_error_are_gaps(self):
        given = people()
        covariance = given.covariance.copy()
        covariance[7:12, 1, ANKLE] *= (0.3 / 0.02) ** 2
        kept, left_out = within_limits(replace(given, covariance=covariance), OutputLimits())
        expected = given.present.copy()
        expected[7:12, 1, ANKLE] = False
        np.testing.assert_array_equal(kept.present, expected)
        np.testing.assert_array_equal(kept.joints[expected], given.joints[expected])
        assert left_out.to_json()["by_person"] == {"8": {"uncertain": 5, "fast": 0, "incomplete": 0, "short": 0}}
        assert left_out.sentences() == ["5 joints with an expected error above 0.25 m (0.37 %)"]

    def test_a_person_who_is_uncertain_everywhere_is_left_out_whole(self):
        given = people()
        covariance = given.covariance.copy()
        covariance[:, 0, 4:] *= (0.323 / 0.02) ** 2
        kept, left_out = within_limits(replace(given, covariance=covariance), OutputLimits())
        assert kept.ids.tolist() == left_out.ids[1:].tolist() == [8]
        assert left_out.people.tolist() == [3]
        assert kept.covariance.shape == (40, 1, 17, 3, 3)
        assert "1 whole people, identity 3 (in 40 frames)" in left_out.sentences()[-1]

    @pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.1), (1.0, 1e-3, 1e-3)])
    @pytest.mark.parametrize("freedom", [3.0, 6.0, np.inf])
    def test_the_expected_error_is_that_of_the_page(self, sides, freedom):
        covariance = np.broadcast_to(np.diag(np.square(sides)), (1, 1, 17, 3, 3))
        given = People(
            np.zeros(1), np.zeros(1), np.zeros((1, 1, 17, 3)), 1.0, covariance, freedom=np.full((1, 1, 17), freedom)
        )
        (error,) = np.unique(expected_errors(given))
        assert error == pytest.approx(expected_median(covariance, freedom), rel=0.06)

    def test_the_expected_error_has_its_closed_forms(self):
        given = people(1, sigma=0.1)
        np.testing.assert_allclose(expected_errors(given), 0.1 * chi(3).median(), rtol=0.005)
        heavy = replace(given, freedom=np.full((1, 2, 17), 4.0))
        np.testing.assert_allclose(expected_errors(heavy), 0.1 * np.sqrt(3 * f(3, 4).median() / 2), rtol=0.02)


class TestSpeeds:
    def test_a_wild_ankle_is_a_gap_and_its_neighbours_stay(self):
        given = people()
        wild = moved(given, [10, 11], 0, ANKLE, [0.0, 0.0, 3.46])  # 87 m/s
        kept, left_out = within_limits(wild, OutputLimits())
        expected = given.present.copy()
        expected[[10, 11], 0, ANKLE] = False
        np.testing.assert_array_equal(kept.present, expected)
        assert left_out.counts[1].tolist() == [2, 0]

    @pytest.mark.parametrize("joint", [HIP, NOSE])
    def test_trunk_and_head_are_held_to_half_of_it(self, joint):
        step = [0.0, 0.0, 16.0 / RATE]  # m/s
        assert within_limits(moved(people(), 20, 1, joint, step), OutputLimits())[1].counts[1].tolist() == [0, 1]
        assert within_limits(moved(people(), 20, 1, ANKLE, step), OutputLimits())[1].counts[1].tolist() == [0, 0]

    def test_the_longer_part_of_a_jump_stays(self):
        wild = moved(people(), slice(0, 9), 0, ANKLE, [0.0, 0.0, 40.0])
        kept, _ = within_limits(wild, OutputLimits())
        assert np.flatnonzero(~kept.present[:, 0, ANKLE]).tolist() == list(range(9))

    def test_speed_is_measured_across_gaps(self):
        given = people()
        scores = given.scores.copy()
        scores[10:30, 0, ANKLE] = 0.0  # 0.84 s, in which it may move by 20 m
        kept, _ = within_limits(
            moved(replace(given, scores=scores), slice(30, None), 0, ANKLE, [0, 5.0, 0]), OutputLimits()
        )
        assert (kept.present == (scores > 0)).all()

    def test_identities_that_mean_nothing_are_not_judged(self):
        wild = moved(people(), [10], 0, ANKLE, [0.0, 0.0, 3.46])
        assert within_limits(wild, OutputLimits(), tracked=False)[0] is wild


class TestShortPeople:
    @pytest.mark.parametrize(("frames", "stays"), [(4, False), (5, True)])
    def test_people_of_a_moment_are_left_out(self, frames, stays):
        given = people()
        scores = given.scores.copy()
        scores[:-frames, 1] = 0.0
        kept, left_out = within_limits(replace(given, scores=scores), OutputLimits())
        assert kept.ids.tolist() == ([3, 8] if stays else [3])
        assert left_out.people.tolist() == ([] if stays else [8])

    def test_a_recording_of_a_moment_keeps_those_who_are_always_there(self):
        assert len(within_limits(people(2), OutputLimits())[0]) == 2
