"""Cameras that move while the tracker runs are named; cameras that stand are not."""

from dataclasses import replace

import numpy as np
import pytest
from people import STANDING, ring
from scipy.spatial.transform import Rotation

from mvpose import Detections, Rig, preset
from mvpose.rays import viewing_rays
from mvpose.reconstruction.likelihood import Noise
from mvpose.skeleton import COCO17
from mvpose.tracking import DriftModel, Tracker, TrackerState, TrackingModel
from mvpose.tracking.drift_watch import DriftWatch
from mvpose.tracking.picture_shift import TERMS, ExpectedPeople, _place, measure_shifts, solve_shift
from mvpose.tracking.pose_update import MatchedRays

RIG = ring(5)
SIGMAS = Noise().sigmas(COCO17)
RATE = 10.0


def turned(rig: Rig, view: int, degrees: float, axis: tuple[float, float, float], move=(0.0, 0.0, 0.0)) -> Rig:
    """Return a rig with one camera turned about an axis of its own, and moved."""
    cameras = list(rig)
    R = Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix() @ rig[view].R
    cameras[view] = replace(rig[view], R=R, t=-R @ (rig[view].center + move))
    return Rig(cameras)


def people_at(time: float, count: int = 3) -> np.ndarray:
    """Joints of people who walk in circles, (n, 17, 3)."""
    angle = 2 * np.pi * np.arange(count) / count + 0.6 * time
    return np.array([STANDING + [1.2 * np.cos(a), 1.2 * np.sin(a), 0.0] for a in angle])


def pictures(rig: Rig, time: float, rng: np.random.Generator, *, noise: float = 6.0, count: int = 3) -> Detections:
    """Detections of all cameras at a time; rig is where the cameras really stand."""
    joints = people_at(time, count)
    pixels = np.concatenate([camera.project(joints) for camera in rig])
    view = np.repeat(np.arange(len(rig)), count)
    given = Detections.from_keypoints(
        view, pixels + noise * rng.normal(size=pixels.shape), np.full((len(view), 17), 0.9)
    )
    return replace(given, time=np.full(len(rig), time))


def tracked(seconds: float, *, moved: Rig | None = None, at: float = 10.0, rig: Rig = RIG, seed: int = 0) -> Tracker:
    """Return a tracker after some seconds, in which the cameras may have moved to those of another rig."""
    tracker, rng = Tracker(preset("fast")), np.random.default_rng(seed)
    for k in range(round(seconds * RATE)):
        really = rig if moved is None or k / RATE < at else moved
        tracker.advance(rig, pictures(really, k / RATE, rng))
    return tracker


def matched_rays(rays, labels) -> MatchedRays:
    """Return rays of pictures at the time of the frame, with the groups of a matching."""
    return MatchedRays(
        labels, rays.view, rays.origins, rays.directions, rays.weights, rays.pixel, np.zeros(len(labels))
    )


def looked_at(rig: Rig, really: Rig, view: int, *, noise: float = 0.0, time: float = 0.0):
    """Return the shift of one camera's picture and its variances, if the others show people where they are."""
    given = pictures(really, time, np.random.default_rng(1), noise=noise)
    joints, count = people_at(time), 3
    rays = viewing_rays(rig, given)
    state = np.concatenate([joints + 0.02, np.zeros_like(joints)], axis=2)  # the prediction is beside the truth
    normal, residual = np.zeros((TERMS, TERMS + 1)), np.zeros(3)
    labels = np.tile(np.arange(count), len(rig))
    people = ExpectedPeople(np.arange(count), np.ones(count, bool), state)
    added = measure_shifts(
        view, normal, residual, 1.0, np.ones(len(rig), bool), people, matched_rays(rays, labels), SIGMAS, rig.packed
    )
    shift, variance = np.empty(TERMS), np.empty(TERMS)
    solve_shift(shift, variance, normal, 10.0)
    return shift, variance, added, residual


TURNS = [((0, 1, 0), (1, 0, 0, 0)), ((1, 0, 0), (0, -1, 0, 0)), ((0, 0, 1), (0, 0, 0, 1))]


@pytest.mark.parametrize(("axis", "expected"), TURNS)
def test_the_shift_of_a_picture_is_the_turn_of_its_camera(axis, expected):
    """At the edge of the image a turn moves pixels further than in its centre, by a tenth where these people are."""
    shift, _, added, _ = looked_at(RIG, turned(RIG, 2, 0.5, axis), 2)
    assert added == 3 * 17
    np.testing.assert_allclose(np.degrees(shift), 0.5 * np.array(expected), atol=0.05)


def test_a_camera_that_has_come_nearer_shows_a_larger_picture():
    nearer = turned(RIG, 1, 0.0, (1, 0, 0), move=0.08 * RIG[1].R[2])  # people are 2.8 to 5.2 m away
    shift, *_ = looked_at(RIG, nearer, 1)
    assert 0.08 / 5.2 < shift[2] < 0.08 / 2.8
    assert np.abs(np.degrees(shift[[0, 1, 3]])).max() < 0.2


def test_the_mean_residual_is_that_of_the_noise():
    *_, residual = looked_at(RIG, RIG, 0, noise=5.0)
    rayleigh = 5.0 * np.sqrt(np.pi / 2)  # mean length of a Gaussian vector; the other cameras' noise adds a quarter
    assert residual[1] / residual[0] == pytest.approx(rayleigh * np.sqrt(1.25), rel=0.2)


def test_the_variance_of_a_shift_is_that_of_least_squares():
    _, variance, *_ = looked_at(RIG, RIG, 0)
    joints = people_at(0.0).reshape(-1, 3) @ RIG[0].R.T + RIG[0].t
    x, y = joints[:, 0] / joints[:, 2], joints[:, 1] / joints[:, 2]
    one, zero = np.ones_like(x), np.zeros_like(x)
    deviation = np.hypot(np.tile(SIGMAS, 3) / (0.9 * joints[:, 2]), 1.0 / RIG[0].K[0, 0])
    A = (
        np.concatenate([np.stack([one, zero, x, -y], 1), np.stack([zero, one, y, x], 1)])
        / np.tile(deviation, 2)[:, None]
    )
    np.testing.assert_allclose(variance, np.linalg.inv(A.T @ A).diagonal(), rtol=0.02)


@pytest.mark.parametrize("cameras", [0, 1, 2, 4])
def test_a_joint_is_where_two_trusted_cameras_or_else_the_past_place_it(cameras):
    rays = viewing_rays(RIG, pictures(RIG, 0.0, np.random.default_rng(0), noise=0.0, count=1))
    joints, nose = people_at(0.0, 1), 0
    state = np.append(joints[0, nose] + 0.1, np.ones(3))
    memory, work = np.full(4, 7.0), np.empty((8, 3))  # the place must stay within its three numbers
    trusted = np.arange(5) <= cameras  # the watched camera 0, and so many others
    _place(memory[:3], 0, 0, state, nose, trusted, matched_rays(rays, np.zeros(5, np.int64)), work)
    np.testing.assert_allclose(memory[:3], joints[0, nose] if cameras >= 2 else state[:3], atol=4e-3)
    assert memory[3] == 7.0


@pytest.mark.parametrize(("view", "axis"), [(0, (0, 1, 0)), (3, (1, 0, 0)), (4, (0.7, 0.7, 0))])
def test_a_camera_that_turns_by_a_degree_is_named_within_seconds(view, axis):
    tracker = tracked(16.0, moved=turned(RIG, view, 1.0, axis))
    (drift,) = tracker.drifts
    assert (drift.view, drift.camera) == (view, f"cam{view}")
    assert drift.since == pytest.approx(10.0, abs=1.5)
    assert 10.0 < drift.found < 15.0
    assert drift.degrees == pytest.approx(1.0, abs=0.35)  # a mean over the latest seconds
    assert f"'cam{view}' has moved at" in str(drift)


def test_two_cameras_that_move_one_after_the_other_are_both_named():
    one = turned(RIG, 1, 1.5, (0, 1, 0))
    tracker, rng = Tracker(preset("fast")), np.random.default_rng(0)
    for k in range(260):
        really = RIG if k < 100 else one if k < 180 else turned(one, 3, -1.5, (0, 1, 0))
        tracker.advance(RIG, pictures(really, k / RATE, rng))
    assert [drift.view for drift in tracker.drifts] == [1, 3]
    assert tracker.residuals.degrees[1, 0] == pytest.approx(1.5, abs=0.4)  # wrong keypoints count less
    assert tracker.residuals.degrees[3, 0] == pytest.approx(-1.5, abs=0.4)


def test_a_camera_that_turns_away_so_far_that_nobody_fits_is_named():
    tracker = tracked(48.0, moved=turned(RIG, 2, 9.0, (0, 1, 0)))
    (drift,) = tracker.drifts
    assert drift.view == 2
    assert drift.stray > 0.8
    assert "fit nobody" in str(drift)


def test_a_rig_that_stands_has_no_alarm_and_a_wrong_one_is_no_drift():
    assert not tracked(40.0).drifts
    wrong = turned(RIG, 2, 0.5, (0, 1, 0))
    assert not tracked(30.0, moved=wrong, at=0.0).drifts


def test_two_cameras_do_not_tell_which_of_them_has_moved():
    rig = Rig([RIG[0], RIG[1]])
    assert not tracked(16.0, rig=rig, moved=turned(rig, 1, 1.0, (0, 1, 0))).drifts


def _look_for(seconds: int, watch: DriftWatch, *, seed: int, start: int = 0, bias: float = 0.1, moved=None) -> None:
    """Look at all cameras once a second.

    Args:
        seconds: number of looks.
        watch: watch over the cameras of RIG.
        seed: seed of the errors.
        start: time of the first, seconds.
        bias: standard deviation of an error that all keypoints of a picture share, degrees.
        moved: camera and turn of its pictures, degrees.
    """
    rng, joints, order = np.random.default_rng(seed), people_at(0.0), np.arange(15)
    exact = viewing_rays(RIG, pictures(RIG, 0.0, rng, noise=0.0))
    state = np.concatenate([joints, np.zeros_like(joints)], axis=2)
    sizes = np.array([camera.size for camera in RIG], float)
    people = ExpectedPeople(np.arange(3), np.ones(3, bool), state)
    turn = np.radians(bias) * rng.normal(size=(seconds, 5, 1, 1, 2))
    if moved is not None:
        turn[:, moved[0], ..., 0] += np.radians(moved[1])
    turn = turn + 6.0 / 800.0 * rng.normal(size=(seconds, 5, 3, 17, 2))  # pixels, focal length
    across = np.array([camera.R[:2] for camera in RIG])
    for second in range(seconds):
        directions = exact.directions + np.einsum("vnjk,vkr->vnjr", turn[second], across).reshape(15, 17, 3)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        watch.take(
            matched_rays(replace(exact, directions=directions), order % 3), people, now=float(start + second),
            pictures=np.ones(5, bool), sigmas=SIGMAS, cameras=RIG.packed, sizes=sizes,
        )  # fmt: skip


def test_an_hour_of_a_rig_that_stands_has_no_alarm():
    watch = DriftWatch(DriftModel(), 5)
    _look_for(3600, watch, seed=5)
    assert not watch.drifts(RIG)
    assert watch.charts.sums.max() < 0.5 * DriftModel().threshold(5)
    _look_for(10, watch, seed=6, start=3600, moved=(3, 1.0))
    assert [drift.view for drift in watch.drifts(RIG)] == [3]


def test_a_camera_that_is_put_back_is_trusted_again():
    watch = DriftWatch(DriftModel(), 5)
    _look_for(20, watch, seed=7)
    _look_for(10, watch, seed=8, start=20, moved=(0, 1.0))
    (drift,) = watch.drifts(RIG)
    assert (drift.view, drift.since) == (0, pytest.approx(20.0, abs=2.0))
    _look_for(30, watch, seed=9, start=30)
    assert not watch.drifts(RIG)


def test_errors_of_a_tenth_of_a_degree_give_false_alarms_where_they_are_asked_for():
    """The test has power: with a bound of hundreds an hour, and no noise allowed for, an hour has some."""
    watch = DriftWatch(DriftModel(smallest=0.05, alarms=1e4, inflation=0.1, floor=0.01), 5)
    _look_for(600, watch, seed=5)
    assert watch.drifts(RIG)


def test_a_lower_rate_of_false_alarms_needs_more_evidence():
    often, seldom = DriftModel(alarms=1.0), DriftModel(alarms=0.001)
    assert seldom.threshold(5) - often.threshold(5) == pytest.approx(np.log(1000.0))
    assert DriftModel().threshold(10) - DriftModel().threshold(5) == pytest.approx(np.log(2.0))
    with pytest.raises(ValueError, match="alarms of the drift model"):
        DriftModel(alarms=0.0)


def test_the_watch_goes_on_after_a_restoration_and_changes_no_estimate(tmp_path):
    moved, rng = turned(RIG, 1, 1.0, (0, 1, 0)), np.random.default_rng(3)
    frames = [pictures(RIG if k < 100 else moved, k / RATE, rng) for k in range(150)]
    blind = TrackingModel(drift=DriftModel(smallest=50.0))
    one, other = Tracker(preset("fast")), Tracker(preset("fast"), model=blind)
    for k, frame in enumerate(frames):
        if k == 115:
            one.state().save(tmp_path / "people.npz")
        assert one.estimate(RIG, frame).joints.tobytes() == other.estimate(RIG, frame).joints.tobytes()
    again = Tracker.restored(TrackerState.load(tmp_path / "people.npz"), preset("fast"))
    assert again.drifts == ()
    for frame in frames[115:]:
        again.advance(RIG, frame)
    assert again.drifts == one.drifts
    assert [drift.view for drift in one.drifts] == [1]
    assert not other.drifts
    for name, array in one.state().drift.items():
        np.testing.assert_array_equal(array, again.state().drift[name])


def test_nobody_in_front_of_the_cameras_is_no_evidence():
    tracker = Tracker(preset("fast"))
    assert tracker.residuals is None
    empty = pictures(RIG, 0.0, np.random.default_rng(0)).select(np.zeros(15, bool))
    for k in range(100):
        tracker.advance(RIG, replace(empty, time=np.full(5, k / RATE)))
    assert not tracker.drifts
    assert np.isnan(tracker.residuals.pixels).all()
