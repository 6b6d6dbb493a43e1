"""The tracker on bad times, silent cameras, gaps and repeats: a clear error or the right answer."""

import numpy as np
import pytest
from walking_people import film, identities

import mvpose
from mvpose import Detections
from mvpose.tracking import Tracker, track
from mvpose.tracking.picture_times import FrameClock

PATHS = [(-0.8, -0.5, 0.5, 0.2), (0.8, 0.6, -0.4, -0.3)]
RATE = 25.0
pytestmark = pytest.mark.filterwarnings("error")


def _tracker(preset="fast"):
    return Tracker(mvpose.preset(preset))


def _at(frame, time):
    """The same detections with other times."""
    return Detections(
        frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, descriptors=frame.descriptors,
        time=np.broadcast_to(np.asarray(time, float), 5).copy(),
    )  # fmt: skip


def _nothing(time):
    return _at(Detections.empty(), time)


def _bytes(estimate):
    arrays = (estimate.joints, estimate.scores, estimate.covariance, estimate.matching.labels)
    return *(array.tobytes() for array in arrays), None if estimate.ids is None else estimate.ids.tobytes()


@pytest.mark.parametrize("preset", ["full", "fast"])
def test_one_frame_alone_is_that_of_the_pipeline_to_the_byte(preset):
    for seed in range(4):
        rig, frames, _ = film([*PATHS, (0.0, 1.2, 0.3, -0.5)], [0.0], noise=6.0, seed=seed)
        alone, tracked = mvpose.preset(preset).estimate(rig, frames[0]), _tracker(preset).estimate(rig, frames[0])
        assert len(alone) == 3
        assert _bytes(tracked)[:-1] == _bytes(alone)[:-1]
        assert tracked.freedom.tobytes() == alone.freedom.tobytes()


def test_times_that_go_back_are_one_clear_error_and_leave_the_tracker_as_it_was():
    rig, frames, _ = film(PATHS, np.arange(6) / RATE)
    expected = [_bytes(each) for each in track(_tracker(), rig, frames)]
    tracker = _tracker()
    for k, frame in enumerate(frames):
        assert _bytes(tracker.estimate(rig, frame)) == expected[k]
        with pytest.raises(ValueError, match="frames must come in the order of their times"):
            tracker.estimate(rig, _at(frame, -1.0))


@pytest.mark.parametrize(("time", "text"), [(1.7e12, "1.7e\\+12 for camera 3"), (-1e300, "seconds"), (np.inf, "inf")])
@pytest.mark.parametrize("first", [False, True])
def test_times_that_cannot_be_seconds_are_refused(time, text, first):
    rig, frames, _ = film(PATHS, np.arange(2) / RATE)
    tracker = _tracker()
    if not first:
        tracker.estimate(rig, frames[0])
    with pytest.raises(ValueError, match=text):
        tracker.estimate(rig, _at(frames[1], [0.04, 0.04, 0.04, time, 0.04]))
    assert len(tracker.estimate(rig, frames[1])) == 2


@pytest.mark.parametrize("start", [-1e6, 0.0, 1.7e9])
def test_the_origin_of_time_does_not_matter(start):
    rig, frames, _ = film(PATHS, np.arange(10) / RATE)
    estimates = list(track(_tracker(), rig, frames))
    tracker = _tracker()
    for k, (frame, expected) in enumerate(zip(frames, estimates, strict=True)):
        moved = tracker.estimate(rig, _at(frame, start + k / RATE))
        np.testing.assert_allclose(moved.joints, expected.joints, atol=1e-5)
        np.testing.assert_array_equal(moved.ids, expected.ids)


def test_a_camera_that_never_delivers_holds_up_nobody():
    times = np.arange(30) / RATE
    rig, frames, truth = film(PATHS, times, lost=lambda frame, view: view == 2)
    ids = identities(list(track(_tracker(), rig, frames)), truth, reach=0.1)
    assert (ids == ids[0]).all()
    assert (ids >= 0).all()


def test_equal_times_change_neither_who_is_there_nor_the_evidence():
    rig, frames, truth = film(PATHS, np.arange(8) / RATE)
    tracker = _tracker()
    estimates = [tracker.estimate(rig, frame) for frame in frames]
    for _ in range(50):
        again = tracker.estimate(rig, frames[-1])
        assert again.time == estimates[-1].time
        np.testing.assert_array_equal(again.ids, estimates[-1].ids)
    assert (identities([again], truth[-1:], reach=0.1) >= 0).all()


def test_the_first_frames_may_have_no_picture_at_all():
    rig, frames, _ = film(PATHS, np.arange(3) / RATE)
    for lag in (0.0, 0.05, np.inf):
        dark = [_nothing(np.nan)] * 3
        estimates = list(track(_tracker(), rig, [*dark, *frames], lag=lag))
        expected = list(track(_tracker(), rig, frames, lag=lag))
        assert [(len(each), each.time) for each in estimates[:3]] == [(0, None)] * 3
        assert [_bytes(each) for each in estimates[3:]] == [_bytes(each) for each in expected]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [12.0, 25.0, 60.0])
@pytest.mark.parametrize("timed", [False, True])
def test_a_minute_without_pictures_or_people(rate, timed):
    """At any rate, the time of frames without pictures stays behind that of the next picture, and all tracks end."""
    count = int(60 * rate)
    times = (np.arange(count + 20) + np.random.default_rng(0).uniform(-0.2, 0.2, count + 20)) / rate
    rig, frames, _ = film(PATHS, times[:10])
    tracker = _tracker()
    for frame in frames:
        assert len(tracker.estimate(rig, frame)) == 2
    for k in range(10, count + 10):
        estimate = tracker.estimate(rig, _nothing(times[k] if timed else np.nan))
    assert len(estimate) == 0
    assert estimate.time <= times[count + 10] + 1.0 / rate
    for k in range(5):
        estimate = tracker.estimate(rig, _at(frames[k], times[count + 10 + k]))
    assert sorted(estimate.ids) == [2, 3]


@pytest.mark.parametrize("period", [0.01, 0.04, 0.2])
def test_a_frame_without_pictures_comes_after_the_time_between_the_latest_frames(period):
    """The mean of the latest intervals draws near the true one by a tenth of the rest with each frame."""
    clock = FrameClock(period=0.04, interval=0.04)
    for k in range(12):
        clock.take(clock.read(_at(Detections.empty(), k * period), 5))
    expected = period + (0.04 - period) * 0.9**11
    assert clock.read(_nothing(np.nan), 5).elapsed == pytest.approx(expected)
    for k in range(12, 300):  # frames between two pictures count, also where two of three have none
        clock.take(clock.read(_at(Detections.empty(), k * period) if k % 3 == 0 else _nothing(np.nan), 5))
    assert clock.interval == pytest.approx(period, rel=1e-3)


@pytest.mark.parametrize("gap", [60.0, 3600.0, 1e6, 1e10])
def test_after_a_long_gap_everyone_is_new(gap):
    rig, frames, truth = film(PATHS, np.arange(20) / RATE)
    for lag in (0.0, 0.2):
        given = frames[:10] + [_at(frame, frame.time + gap) for frame in frames[10:]]
        estimates = list(track(_tracker(), rig, given, lag=lag))
        ids = identities(estimates, truth, reach=0.1)
        assert (ids[:10] == ids[0]).all()
        assert sorted(ids[10]) == [2, 3]
        assert (ids[10:] == ids[10]).all()
        assert all(np.isfinite(each.joints).all() and np.isfinite(each.covariance).all() for each in estimates)


def test_people_stay_who_they_are_over_a_gap_within_memory():
    rig, frames, truth = film([(-1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)], np.arange(20) / RATE)
    given = frames[:10] + [_at(frame, frame.time + 1.0) for frame in frames[10:]]
    ids = identities(list(track(_tracker(), rig, given)), truth, reach=0.1)
    assert (ids == ids[0]).all()


def test_a_picture_of_long_ago_is_not_used():
    rig, frames, truth = film(PATHS, np.arange(10) / RATE)
    tracker = _tracker()
    for k, frame in enumerate(frames):
        late = _at(frame, k / RATE - np.array([0.0, 0.0, 0.0, 0.0, 3600.0]))
        with pytest.warns(UserWarning, match="camera 4: a picture more than 1 s before"):
            estimate = tracker.estimate(rig, late)
        assert (estimate.matching.labels[frame.view == 4] == -1).all()
        assert (estimate.matching.labels[frame.view != 4] >= 0).all()
    assert np.abs(np.sort(estimate.joints, axis=0) - np.sort(truth[-1], axis=0)).max() < 0.1


def test_the_order_of_detections_does_not_matter():
    rng = np.random.default_rng(5)
    rig, frames, _ = film(PATHS, np.arange(12) / RATE, noise=5.0)
    one, other = _tracker(), _tracker()
    for frame in frames:
        order = rng.permutation(len(frame))
        given, permuted = one.estimate(rig, frame), other.estimate(rig, frame.select(order))
        assert _bytes(permuted)[:3] == _bytes(given)[:3]
        np.testing.assert_array_equal(permuted.ids, given.ids)
        np.testing.assert_array_equal(permuted.matching.labels, given.matching.labels[order])


def _wild_stream(seed, count=150):
    """Frames of people, with gaps, jumps, repeats, late, lost and missing pictures, and wrong keypoints."""
    rng = np.random.default_rng(seed)
    steps = rng.choice([0.04, 0.0, 1e-9, 0.5, 3.0, 20.0, 4000.0], count, p=[0.8, 0.06, 0.03, 0.05, 0.03, 0.02, 0.01])
    rig, frames, _ = film(PATHS, np.arange(count) / RATE % 2.0, noise=5.0, seed=seed)
    result, now = [], 0.0
    for frame, step in zip(frames, steps, strict=True):
        now += step
        time = now - rng.choice([0.0, 0.03, 0.4], 5, p=[0.7, 0.25, 0.05])
        time[rng.random(5) < 0.2] = np.nan
        if rng.random() < 0.05:
            time[:] = np.nan
        if not np.isnan(time).all():
            time += now - np.nanmax(time)  # so that times never go back
        seen = ~np.isnan(time)[frame.view] & (rng.random(len(frame)) < 0.85)
        keypoints = np.where(rng.random((len(frame), 1, 1)) < 0.1, rng.uniform(0, 900, (len(frame), 17, 2)), np.nan)
        given = np.where(np.isnan(keypoints), frame.keypoints, keypoints)
        scores = np.where(rng.random((len(frame), 17)) < 0.2, 0.0, rng.random((len(frame), 17)))
        kept = Detections.from_keypoints(frame.view[seen], given[seen], scores[seen])
        result.append(_at(kept, time))
    return rig, result


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.0, 0.3, np.inf])
@pytest.mark.parametrize("preset", ["fast", "full"])
def test_whatever_comes_estimates_are_finite_and_in_order(preset, lag):
    for seed in range(3):
        rig, frames = _wild_stream(seed)
        estimates = list(track(_tracker(preset), rig, frames, lag=lag))
        assert len(estimates) == len(frames)
        times = [each.time for each in estimates if each.time is not None]
        assert (np.diff(times) >= 0.0).all()
        for frame, estimate in zip(frames, estimates, strict=True):
            known = estimate.scores > 0.0
            assert np.isfinite(estimate.joints[known]).all()
            assert np.isfinite(estimate.covariance[known]).all()
            assert np.isnan(estimate.joints[~known]).all()
            assert (np.linalg.eigvalsh(estimate.covariance[known]) > 0.0).all()
            assert len(set(estimate.ids.tolist())) == len(estimate)
            assert estimate.matching.labels.shape == (len(frame),)
            assert estimate.matching.labels.max(initial=-1) < len(estimate)
        assert max(map(len, estimates)) <= 6


def _clock_after(*times):
    clock = FrameClock(period=0.04, interval=0.04)
    for time in times:
        clock.take(clock.read(_nothing(time), 5))
    return clock


@pytest.mark.parametrize(("unit", "factor"), [("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)])
def test_times_from_zero_in_other_units_are_said_to_be(unit, factor):
    """A warning, not an error: 40 s between frames may be a time lapse. It comes once."""
    times = 0.04 * factor * np.arange(9)
    clock = _clock_after(*times[:3])
    said = f"came {times[1]:.4g} s after the previous one, .* Are the times {unit}? Divide them by {factor:g}"
    with pytest.warns(UserWarning, match=said.replace("+", r"\+").replace("?", r"\?")):
        clock.take(clock.read(_nothing(times[3]), 5))
    for time in times[4:]:
        clock.take(clock.read(_nothing(time), 5))


def test_gaps_now_and_then_are_no_wrong_unit():
    assert _clock_after(*np.cumsum([0.0, 40.0, 40.0, 0.04] * 3)).time == pytest.approx(240.12)


@pytest.mark.parametrize("offsets", [{2: 10.0}, {0: 10.0}, {1: 30.0, 4: 10.0}, {1: 1.5, 4: 3.0}])
def test_a_clock_that_is_ahead_of_most_costs_its_camera_alone(offsets):
    """The people are those of the cameras that agree, to the byte; the message has the camera and its offset."""
    rig, frames, truth = film(PATHS, np.arange(10) / RATE)
    ahead = np.isin(np.arange(5), list(offsets))
    tracker, alone = _tracker(), _tracker()
    estimates = []
    for frame in frames:
        time = frame.time + [offsets.get(camera, 0.0) for camera in range(5)]
        camera = min(offsets, key=offsets.get)
        with pytest.warns(
            UserWarning, match=rf"camera {camera}: its picture is {offsets[camera]:.1f} s after those of"
        ):
            estimates.append(tracker.estimate(rig, _at(frame, time)))
        left = _at(frame.select(~ahead[frame.view]), np.where(ahead, np.nan, frame.time))
        expected = alone.estimate(rig, left)
        assert estimates[-1].time == expected.time
        assert estimates[-1].joints.tobytes() == expected.joints.tobytes()
    ids = identities(estimates, truth, reach=0.1)
    assert (ids == ids[0]).all()
    assert (ids >= 0).all()


def test_of_two_halves_that_disagree_the_later_counts():
    clock = _clock_after()
    with pytest.warns(UserWarning, match="camera 0: a picture more than 1 s before"):
        times = clock.read(_nothing([0.0, 0.0, 9.0, 9.0, np.nan]), 5)
    assert (times.now, times.pictures.tolist()) == (9.0, [False, False, True, True, False])
