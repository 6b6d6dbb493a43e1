"""The tracker on people who walk: identities, lost pictures, times of pictures, hidden people, ghosts."""

import copy
import pickle

import numpy as np
import pytest
from people import ring
from walking_people import film, identities, walking

import mvpose
from mvpose import Detections
from mvpose.tracking import Tracker, TrackingModel

PATHS = [(-0.8, -0.5, 0.5, 0.2), (0.8, 0.6, -0.4, -0.3), (0.0, 1.2, 0.3, -0.5)]
RATE = 25.0


def _run(rig, frames, *, preset="fast", **settings):
    tracker = Tracker(mvpose.preset(preset), model=TrackingModel(**settings))
    return [tracker.estimate(rig, frame) for frame in frames]


def _errors(estimates, truth):
    """Mean joint error of the nearest estimate of each person, (T, n), metres."""
    return np.array(
        [
            [np.linalg.norm(e.joints - person, axis=2).mean(axis=1).min() for person in people]
            for e, people in zip(estimates, truth, strict=True)
        ]
    )


@pytest.mark.parametrize("preset", ["full", "fast", "no-3dps", "geometry", "hungarian"])
def test_the_first_frame_alone_is_estimated_as_the_pipeline_does(preset):
    rig, frames, _ = film(PATHS, [0.0])
    alone, tracked = mvpose.preset(preset).estimate(rig, frames[0]), _run(rig, frames, preset=preset)[0]
    assert len(alone) == len(PATHS)
    order = [int(np.argmin(np.linalg.norm(alone.joints - each, axis=(1, 2)))) for each in tracked.joints]
    assert sorted(order) == list(range(len(PATHS)))
    np.testing.assert_allclose(tracked.joints, alone.joints[order], atol=1e-12)
    np.testing.assert_allclose(tracked.scores, alone.scores[order], atol=1e-12)
    np.testing.assert_allclose(tracked.covariance, alone.covariance[order], atol=1e-12)


def test_people_keep_their_identities_and_are_found_better_than_frame_by_frame():
    rig, frames, truth = film(PATHS, np.arange(30) / RATE, noise=5.0)
    estimates = _run(rig, frames)
    ids = identities(estimates, truth)
    assert (ids == ids[0]).all()
    assert sorted(ids[0]) == [0, 1, 2]
    alone = [mvpose.preset("fast").estimate(rig, frame) for frame in frames]
    assert _errors(estimates, truth)[5:].mean() < 0.9 * _errors(alone, truth)[5:].mean()


def test_a_joint_that_one_camera_sees_is_followed():
    """All cameras but one go dark: the last corrects everybody across its rays, and depth comes from the past."""
    rig, frames, truth = film(PATHS, np.arange(30) / RATE, lost=lambda frame, view: frame >= 15 and view > 0)
    estimates = _run(rig, frames)
    assert [len(each) for each in estimates] == [3] * 30
    assert _errors(estimates, truth)[20].max() < 0.10
    still = np.linalg.norm(truth[15] - truth[20], axis=-1).mean(axis=-1)
    assert _errors(estimates, truth)[20].mean() < 0.7 * still.mean()


def test_pictures_have_times_of_their_own():
    """Cameras that are up to 80 ms apart, people at 2 m/s: known times cost nothing, unknown ones do."""
    fast = [(-1.5, -0.5, 2.0, 0.0), (1.5, 0.6, -2.0, 0.0)]
    times, offsets = np.arange(25) / RATE, np.array([0.0, -0.08, -0.02, -0.06, -0.04])
    rig, frames, truth = film(fast, times, offsets=offsets)
    _, blind, _ = film(fast, times, offsets=offsets, timed=False)
    _, together, _ = film(fast, times)
    known, unknown, best = (_errors(_run(rig, each), truth)[8:].mean() for each in (frames, blind, together))
    assert known < 2.0 * best
    assert known < 0.2 * unknown


def test_who_is_hidden_for_a_second_comes_back_as_the_same_person():
    def hidden(frame, view, person):
        return person == 0 and 10 <= frame < 35

    rig, frames, truth = film(PATHS, np.arange(45) / RATE, hidden=hidden)
    ids = identities(_run(rig, frames), truth)
    assert (ids[:, 1:] == ids[0, 1:]).all()
    assert (ids[-5:, 0] == ids[0, 0]).all()


def test_two_false_detections_that_meet_for_a_moment_are_nobody():
    rig, frames, _ = film(PATHS[:2], np.arange(20) / RATE, noise=1.0)
    ghost = walking(0.0, paths=[(1.8, -1.8, 0.1, 0.0)])[0]
    for frame in (5, 9, 14):
        views = [frame % 5, (frame + 2) % 5]
        given = frames[frame]
        keypoints = np.concatenate([given.keypoints, [rig[view].project(ghost) for view in views]])
        frames[frame] = Detections.from_keypoints([*given.view, *views], keypoints, np.full(keypoints.shape[:2], 0.9))
    assert len(mvpose.preset("fast").estimate(rig, frames[5])) == 3
    assert [len(each) for each in _run(rig, frames)] == [2] * 20


def test_who_walks_in_is_reported_within_a_fifth_of_a_second():
    rig, frames, _ = film(PATHS, np.arange(20) / RATE, hidden=lambda frame, _, person: person == 2 and frame < 8)
    people = [len(each) for each in _run(rig, frames)]
    assert people[:8] == [2] * 8
    assert people[13:] == [3] * 7


@pytest.mark.parametrize("speed", [1.5, 2.5, 3.0])
def test_who_runs_is_followed_from_the_first_of_few_frames(speed):
    """Five frames a second, in which a runner gets on by 0.6 m."""
    paths = [(-0.6 * speed, -0.5, speed, 0.3), (0.5, 0.6 * speed, 0.2, -speed)]
    rig, frames, truth = film(paths, np.arange(7) * 0.2)
    tracker = Tracker(model=TrackingModel(period=0.2))
    found = identities([tracker.estimate(rig, each) for each in frames], truth)
    assert (found >= 0).all()
    assert (found == found[0]).all()


def test_who_leaves_is_reported_for_less_than_half_a_second():
    rig, frames, _ = film(PATHS, np.arange(40) / RATE, hidden=lambda frame, _, person: person == 2 and frame >= 15)
    people = [len(each) for each in _run(rig, frames)]
    assert people[:15] == [3] * 15
    assert people[27:] == [2] * 13


def test_the_same_frames_give_the_same_bytes_also_from_a_copy_in_the_middle():
    rig, frames, _ = film(PATHS, np.arange(12) / RATE)
    whole = _run(rig, frames)
    tracker = Tracker(mvpose.preset("fast"))
    for frame in frames[:6]:
        tracker.estimate(rig, frame)
    for resumed in (pickle.loads(pickle.dumps(tracker)), copy.deepcopy(tracker), tracker):
        for frame, expected in zip(frames[6:], whole[6:], strict=True):
            estimate = resumed.estimate(rig, frame)
            assert estimate.joints.tobytes() == expected.joints.tobytes()
            assert estimate.ids.tobytes() == expected.ids.tobytes()


def test_memory_does_not_grow():
    rig, frames, _ = film(PATHS[:1], np.arange(4) / RATE)
    tracker = Tracker(mvpose.preset("fast"))
    sizes = []
    for k in range(60):
        late = _at(frames[k % 4], k * 20.0)
        tracker.estimate(rig, late)  # 20 s between frames: somebody new each time
        sizes.append(len(pickle.dumps(tracker)))
    assert max(sizes[30:]) <= max(sizes[:30])


def test_nobody_for_a_minute_and_a_jump_of_an_hour():
    rig, frames, _ = film(PATHS[:1], np.arange(3) / RATE)
    tracker = Tracker(mvpose.preset("fast"))
    for frame in frames:
        assert len(tracker.estimate(rig, frame)) == 1
    for k in range(60):
        estimate = tracker.estimate(rig, _at(Detections.empty(), 1.0 + k))
    assert len(estimate) == 0
    assert len(tracker.estimate(rig, _at(frames[0], 3600.0))) == 1


def _at(frame, time):
    """The same detections, all of one time."""
    return Detections(
        frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, time=np.full(5, float(time))
    )


@pytest.mark.parametrize(
    ("time", "message"),
    [
        (np.full(5, -1.0), "frames must come in the order of their times"),
        (np.zeros(4), r"time must be \(5,\)"),
        ([0.1, np.nan, 0.1, 0.1, 0.1], "camera 1 has detections, but the time of its picture is NaN"),
    ],
)
def test_bad_times_are_refused(time, message):
    rig, frames, _ = film(PATHS, [0.0])
    tracker, frame = Tracker(mvpose.preset("fast")), frames[0]
    tracker.estimate(rig, frame)
    with pytest.raises(ValueError, match=message):
        tracker.estimate(
            rig, Detections(frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, time=time)
        )


def test_another_rig_is_refused():
    rig, frames, _ = film(PATHS, [0.0])
    tracker = Tracker(mvpose.preset("fast"))
    tracker.estimate(rig, frames[0])
    with pytest.raises(ValueError, match="one rig and one skeleton"):
        tracker.estimate(ring(6), frames[0])


def test_a_stranger_far_from_where_somebody_was_lost_is_somebody_new():
    """Two seconds of motion may lead 3 m away, but that somebody new has come is likelier."""
    paths = [(-1.0, 0.0, 0.5, 0.0), (3.9, 0.0, -0.2, 0.0), (0.0, -2.0, 0.2, 0.0)]
    gone, came = 1.0, 3.0

    def hidden(stranger):
        return lambda frame, view, person: (
            (person == 0 and frame / 25.0 >= gone and (stranger or frame / 25.0 < came))
            or (person == 1 and (not stranger or frame / 25.0 < came))
        )

    for stranger in (False, True):
        rig, frames, truth = film(paths, np.arange(100) / 25.0, hidden=hidden(stranger))
        ids = identities(_run(rig, frames), truth)
        assert len(set(ids[:25, 0]) - {-1}) == 1
        seen = 1 if stranger else 0
        assert (ids[-1, seen] == ids[20, 0]) == (not stranger)
        assert ids[-1, seen] >= 0
