"""Times of pictures: cameras that deliver one after the other, and rows of a rolling shutter."""

from dataclasses import replace

import numpy as np
import pytest
from people import ring
from walking_people import film, identities, walking

import mvpose
from mvpose import Detections, Rig, preset
from mvpose.tracking import Tracker, track
from mvpose.tracking.recent_pictures import RecentPictures

PATHS = [(-0.9, -0.5, 0.9, 0.3), (0.9, 0.6, -0.8, -0.4), (0.0, 1.2, 0.3, -0.9)]
RATE = 30.0


ROLLING_PATHS = [(-1.0, -0.6, 2.0, 0.0), (1.0, 0.6, -2.0, 0.0)]
READOUT = 0.03


def _one_by_one(paths, times, **settings):
    """Frames of one picture each, of five cameras that take turns, and the true joints at their times."""
    offsets = np.array([0.0, 0.013, 0.006, 0.028, 0.021])
    rig, frames, _ = film(paths, times, offsets=offsets, **settings)
    parts = []
    for frame in frames:
        for view in range(5):
            time = np.where(np.arange(5) == view, frame.time, np.nan)
            if np.isnan(time).all():
                continue
            own = frame.select(frame.view == view)
            parts.append(
                Detections(own.view, own.keypoints, own.scores, own.boxes, own.box_scores, own.skeleton, time=time)
            )
    parts.sort(key=lambda part: np.nanmax(part.time))
    return rig, parts, np.array([walking(np.nanmax(part.time), paths=paths) for part in parts])


def _error(estimates, truth):
    return np.mean(
        [
            [np.linalg.norm(e.joints - person, axis=2).mean(axis=1).min() for person in people]
            for e, people in zip(estimates, truth, strict=True)
        ]
    )


@pytest.mark.parametrize("preset", ["fast", "full"])
def test_single_pictures_place_people_as_well_as_synchronised_ones(preset):
    times = np.arange(25) / RATE
    rig, parts, truth = _one_by_one(PATHS, times, noise=3.0)
    _, frames, together = film(PATHS, times, noise=3.0)
    alone = list(track(Tracker(mvpose.preset(preset)), rig, parts, lag=0.2))
    best = list(track(Tracker(mvpose.preset(preset)), rig, frames, lag=0.2))
    settled = 20  # pictures, until everybody was seen by all cameras
    ids = identities(alone[settled:], truth[settled:])
    assert (ids == ids[0]).all()
    assert sorted(ids[0]) == [0, 1, 2]
    assert [len(each) for each in alone[settled:]] == [3] * (len(parts) - settled)
    assert _error(alone[settled:], truth[settled:]) < _error(best[4:], together[4:]) + 0.002


def test_who_walks_in_is_found_within_a_tenth_of_a_second():
    rig, parts, _ = _one_by_one(PATHS, np.arange(30) / RATE, hidden=lambda frame, _, person: person == 2 and frame < 15)
    tracker = Tracker(mvpose.preset("fast"))
    people = np.array([len(tracker.estimate(rig, part)) for part in parts])
    assert (people[10:75] == 2).all()
    assert (people[75 + 15 :] == 3).all()


def test_who_is_first_seen_by_pictures_of_two_times_is_as_uncertain_as_people_move_in_between():
    """Errors across the motion are as large as their covariance says, though half of the rays are old."""
    ratio = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        x, y, angle = *rng.uniform(-0.8, 0.8, 2), rng.uniform(0.0, 2.0 * np.pi)
        path = [(x, y, 1.3 * np.cos(angle), 1.3 * np.sin(angle))]
        rig, frames, _ = film(path, [0.0], offsets=[0.0, 0.08, 0.0, 0.0, 0.0], noise=2.0, seed=seed)
        rig, frame = Rig([rig[0], rig[1]]), frames[0]
        tracker, first = Tracker(mvpose.preset("fast")), Detections.empty()
        tracker.estimate(rig, replace(first, time=np.full(2, -0.2)))
        for view, time in ((0, 0.0), (1, 0.08)):
            given = frame.select(frame.view == view)
            moment = tracker.advance(rig, replace(given, time=np.where(np.arange(2) == view, time, np.nan)))
        assert len(moment.tracks) == 1
        off = moment.tracks.state[0, :, :3] - walking(0.08, paths=path)[0]
        ratio += np.einsum(
            "jr,jr->j", off, np.linalg.solve(moment.tracks.covariance[0, :, :3, :3], off[..., None])[..., 0]
        ).tolist()
    assert 0.1 < np.median(ratio) / 2.37 < 1.3  # 2.37: the median of chi-square of three degrees of freedom


def test_false_detections_of_pictures_that_are_apart_in_time_are_nobody():
    rig, parts, _ = _one_by_one(PATHS[:1], np.arange(40) / RATE, noise=1.0)
    ghost = walking(0.0, paths=[(1.8, -1.8, 0.1, 0.0)])[0]
    for k in range(20, 180, 37):  # a quarter of a second apart, of different cameras
        view, given = np.flatnonzero(np.isfinite(parts[k].time))[0], parts[k]
        keypoints = np.concatenate([given.keypoints, [rig[view].project(ghost)]])
        false = Detections.from_keypoints([*given.view, view], keypoints, np.full(keypoints.shape[:2], 0.9))
        parts[k] = Detections(false.view, false.keypoints, false.scores, false.boxes, false.box_scores, time=given.time)
    tracker = Tracker(mvpose.preset("fast"))
    assert [len(tracker.estimate(rig, part)) for part in parts][10:] == [1] * (len(parts) - 10)


def test_only_the_latest_picture_of_a_camera_waits_and_not_for_long():
    _, frames, _ = film(PATHS, [0.0])
    frame, recent, seen_by = frames[0], RecentPictures(5, 17), frames[0].view

    def take(now, **pictures):
        """Take pictures, by camera, whose detections belong to nobody, or to somebody ("claimed")."""
        times = np.full(5, np.nan)
        for name, (time, _) in pictures.items():
            times[int(name[1])] = time
        here = np.isfinite(times)
        since = recent.take(now, np.where(here, times - now, 0.0), here)
        recent.wait_for(now, here)
        unclaimed = [here[view] and pictures[f"c{view}"][1] for view in seen_by]
        recent.add(frame.select(here[seen_by]), np.array(unclaimed)[here[seen_by]])
        return since

    def waiting():
        return [(int(view), float(time)) for view, time in zip(recent.rows["view"], recent.rows["time"], strict=True)]

    np.testing.assert_array_equal(take(1.01, c0=(1.0, True), c1=(1.01, True)), [np.inf, np.inf, 0, 0, 0])
    assert waiting() == [(0, 1.0)] * 3 + [(1, 1.01)] * 3
    np.testing.assert_allclose(take(1.05, c1=(1.04, False), c2=(1.05, True)), [0, 0.03, np.inf, 0, 0])
    assert waiting() == [(0, 1.0)] * 3 + [(2, 1.05)] * 3
    take(1.12)
    assert waiting() == [(2, 1.05)] * 3
    restored = RecentPictures.restored(recent.state())
    for name, array in recent.state().items():
        np.testing.assert_array_equal(restored.state()[name], array)
    take(2.0, c4=(2.0, True))
    assert waiting() == [(4, 2.0)] * 3
    recent.drop(np.array([True, False, True]))
    assert waiting() == [(4, 2.0)]


@pytest.mark.parametrize("described", [True, False])
def test_those_who_wait_keep_their_descriptors_if_all_have_some(described):
    _, frames, _ = film(PATHS, [0.0])
    frame, everybody = frames[0], np.ones(len(frames[0]), np.bool_)
    with_descriptors = Detections(
        frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, descriptors=np.eye(len(frame))
    )
    recent = RecentPictures(5, 17)
    recent.take(0.0, np.zeros(5), np.ones(5, np.bool_))
    recent.add(with_descriptors, everybody)
    recent.add(with_descriptors if described else frame, everybody)
    both = recent.beside(with_descriptors, frame.skeleton)
    np.testing.assert_array_equal(both.view, np.tile(frame.view, 3))
    np.testing.assert_array_equal(both.keypoints, np.tile(frame.keypoints, (3, 1, 1)))
    if described:
        np.testing.assert_array_equal(both.descriptors, np.tile(np.eye(len(frame)), (3, 1)))
    else:
        assert both.descriptors is None


@pytest.mark.parametrize("middle", [3, 40])
def test_a_tracker_restored_between_pictures_goes_on_with_the_same_bytes(middle):
    rig, parts, _ = _one_by_one(PATHS, np.arange(12) / RATE, hidden=lambda frame, _, person: person == 2 and frame < 8)
    tracker = Tracker(mvpose.preset("fast"))
    for part in parts[:middle]:
        tracker.estimate(rig, part)
    restored = Tracker.restored(tracker.state(), mvpose.preset("fast"))
    for part in parts[middle:]:
        one, other = tracker.estimate(rig, part), restored.estimate(rig, part)
        assert one.joints.tobytes() == other.joints.tobytes()
        assert one.ids.tobytes() == other.ids.tobytes()


def _seen(camera, time, readout):
    """Pixels of the joints of people, each at the time of its row, (n, 17, 2)."""
    joints = walking(time, paths=ROLLING_PATHS)
    velocity = (walking(time + 1e-3, paths=ROLLING_PATHS) - walking(time - 1e-3, paths=ROLLING_PATHS)) / 2e-3
    pixels = camera.project(joints)
    for _ in range(5):
        late = readout * ((pixels[..., 1] + 0.5) / camera.size[1] - 0.5)
        pixels = camera.project(joints + late[..., None] * velocity)
    return pixels


def _rolling_error(rig, readout):
    """Mean error of the joints after a while, metres."""
    tracker, errors = Tracker(preset("fast")), []
    for time in np.arange(20) / 25:
        pixels = np.concatenate([_seen(camera, time, readout) for camera in rig])
        view = np.repeat(np.arange(len(rig)), len(ROLLING_PATHS))
        given = Detections.from_keypoints(view, pixels, np.full((len(view), 17), 0.9))
        estimate = tracker.estimate(rig, replace(given, time=np.full(len(rig), time)))
        assert estimate.ids.tolist() == [0, 1]
        distance = np.linalg.norm(estimate.joints[:, None] - walking(time, paths=ROLLING_PATHS), axis=-1).mean(axis=-1)
        errors.append(distance.min(axis=1).mean())
    return np.mean(errors[10:])


def test_a_known_readout_costs_little_and_an_unknown_one_much():
    rig = ring(5)
    rolling = Rig([replace(camera, readout=READOUT) for camera in rig])
    whole, known, unknown = _rolling_error(rig, 0.0), _rolling_error(rolling, READOUT), _rolling_error(rig, READOUT)
    assert known < whole + 0.15 * (unknown - whole)
    assert unknown > 1.3 * whole


def test_cameras_of_one_rig_may_differ():
    rig = ring(5)
    some = Rig([replace(camera, readout=READOUT * (k == 2)) for k, camera in enumerate(rig)])
    assert _rolling_error(some, 0.0) > _rolling_error(
        rig, 0.0
    )  # a wrong readout of one camera moves its rays, and only its


@pytest.mark.parametrize("readout", [-0.01, np.inf, np.nan])
def test_a_readout_that_is_no_time_is_refused(readout):
    with pytest.raises(ValueError, match="readout must be 0 s or more and finite"):
        replace(ring(2)[0], readout=readout)
