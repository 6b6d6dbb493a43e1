"""People of a recording: identities kept apart, times, gaps, and what is refused."""

import pickle

import numpy as np
import pytest

from mvpose import COCO17, Estimate, Matching
from mvpose.recording import People

J = len(COCO17)


def frame(ids, *, time=None, covariance=True, offset=0.0):
    """Person with identity i stands at x = i + offset."""
    joints = np.broadcast_to(np.reshape(ids, (-1, 1, 1)) + offset, (len(ids), J, 3)).astype(float)
    covariances = np.broadcast_to(np.eye(3), (*joints.shape, 3)) if covariance else None
    return Estimate(
        joints, np.full(joints.shape[:2], 0.5), Matching([]), covariances, ids=np.array(ids, int), time=time
    )


def test_every_identity_is_one_column_whatever_its_row_in_a_frame():
    people = People.of_estimates([frame([7, 2]), frame([]), frame([2]), frame([2, 9, 7])], COCO17, 0.1)
    assert people.ids.tolist() == [2, 7, 9]
    np.testing.assert_allclose(people.times, [0, 0.1, 0.2, 0.3])
    expected = np.array([[2, 7, np.nan], [np.nan] * 3, [2, np.nan, np.nan], [2, 7, 9]])
    np.testing.assert_array_equal(people.joints[:, :, 0, 0], expected)
    assert (people.present[..., 0] == np.isfinite(expected)).all()
    assert (np.isfinite(people.covariance[..., 0, 0, 0]) == np.isfinite(expected)).all()
    assert people.rate == pytest.approx(10.0)
    assert [people.span(k) for k in range(3)] == [slice(0, 4), slice(0, 4), slice(3, 4)]


def test_a_person_without_any_joint_is_left_out_and_partial_joints_are_absent():
    blank = frame([3, 4])
    joints = blank.joints.copy()
    joints[0], joints[1, 5, 2] = np.nan, np.nan
    people = People.of_estimates([Estimate(joints, blank.scores, Matching([]), ids=blank.ids)])
    assert people.ids.tolist() == [4]
    assert np.isnan(people.joints[0, 0, 5]).all()
    assert people.scores[0, 0, 5] == 0
    assert people.covariance is None


def test_frames_without_a_time_lie_between_their_neighbours():
    times = [None, 1.0, None, 2.0, None]
    people = People.of_estimates([frame([1], time=time) for time in times], period=0.2)
    np.testing.assert_allclose(people.times, [0.8, 1.0, 1.5, 2.0, 2.2])


def test_no_frames_and_no_people_are_recordings():
    assert People.of_estimates([]).joints.shape == (0, 0, J, 3)
    empty = People.of_estimates([frame([]), frame([])])
    assert (empty.frames, len(empty), empty.covariance) == (2, 0, None)


def test_survives_pickle_and_is_sealed():
    people = People.of_estimates([frame([1]), frame([1])])
    again = pickle.loads(pickle.dumps(people))
    np.testing.assert_array_equal(again.joints, people.joints)
    assert not again.joints.flags.writeable
    assert not again.scores.flags.writeable


def test_estimates_without_identities_are_refused_unless_asked_for():
    joints = np.zeros((2, J, 3))
    with pytest.raises(ValueError, match="frame 0 have no ids; estimate with a tracker"):
        People.of_estimates([Estimate.of_joints(joints)])
    assert People.of_estimates([Estimate.of_joints(joints)], untracked=True).ids.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([frame([1, 1])], "ids of frame 0 must be different"),
        ([frame([1], time=1.0), frame([1], time=1.0)], "increase, got 1 s in frame 1"),
        ([Estimate(np.zeros((1, 14, 3)), np.ones((1, 14)), Matching([]), ids=np.array([0]))], "14 joints, but"),
    ],
)
def test_refuses(frames, message):
    with pytest.raises(ValueError, match=message):
        People.of_estimates(frames)
