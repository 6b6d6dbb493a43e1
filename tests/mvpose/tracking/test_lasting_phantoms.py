"""False detections that stay in their pictures make no people, and people who stand still remain people."""

from dataclasses import replace

import numpy as np
import pytest
from people import STANDING, ring
from walking_people import film, identities

from mvpose import Detections, preset
from mvpose.tracking import Tracker, track
from mvpose.tracking.existence import Existence, MeasuredClutter, log_odds
from mvpose.tracking.frame_kernels import repeats
from mvpose.tracking.motion import note_displacement, staying

RIG = ring(5)
WALKERS = [(-1.2, -0.5, 0.5, 0.1), (1.0, 0.8, -0.4, 0.0)]
RATE = 10.0


def with_phantoms(frames, keypoints, view):
    """Return frames with the same detections added to each, with a pixel of noise."""
    rng, result = np.random.default_rng(0), []
    for each in frames:
        shaky = keypoints + rng.normal(size=keypoints.shape)
        points, views = np.concatenate([each.keypoints, shaky]), np.concatenate([each.view, view])
        given = Detections.from_keypoints(views, points, np.full(points.shape[:2], 0.9))
        result.append(replace(given, time=each.time))
    return result


def phantoms(seed, count=4):
    """Upright figures at chance places and of chance heights in each picture, (5 count, 17, 2), and their cameras."""
    rng, poses = np.random.default_rng(seed), []
    view = np.repeat(np.arange(len(RIG)), count)
    for camera in view:
        pose = RIG[camera].project(STANDING)
        pose = (pose - pose.mean(axis=0)) / np.ptp(pose[:, 1])
        width, height = RIG[camera].size
        poses.append(rng.uniform(0.25, 0.75) * height * pose + rng.uniform(0.2, 0.8, 2) * [width, height])
    return np.array(poses), view


def test_posters_that_meet_by_chance_are_no_people_after_the_first_seconds():
    """Some meet in three of five views: nothing but time tells them from people who stand still."""
    rig, walking, truth = film(WALKERS, np.arange(60) / RATE, rig=RIG, noise=4.0)
    ghosts, alone = [], []
    for seed in range(3):
        frames = with_phantoms(walking, *phantoms(seed))
        estimates = list(track(Tracker(preset("fast")), rig, frames, lag=0.2))
        ids = identities(estimates, truth)
        assert (ids >= 0).all()
        assert (ids == ids[0]).all()
        ghosts += [len(each) - 2 for each in estimates[20:]]
        alone += [len(preset("fast").estimate(rig, each)) - 2 for each in frames[20:]]
    assert np.mean(alone) > 1.0
    assert np.mean(ghosts) < 0.2 * np.mean(alone)


def test_people_who_stand_still_among_posters_remain_people():
    still = [(-0.8, -0.5, 1e-9, 0.0), (1.0, 0.8, 1e-9, 0.0), (0.9, -1.0, 1e-9, 0.0)]
    times = np.arange(80) / RATE
    rig, frames, truth = film(still, np.zeros(len(times)), rig=RIG, noise=4.0)  # nobody moves at all
    frames = [replace(each, time=np.full(5, time)) for each, time in zip(frames, times, strict=True)]
    frames = with_phantoms(frames, *phantoms(7, count=2))
    ids = identities(track(Tracker(preset("fast")), rig, frames, lag=0.2), truth)
    assert (ids >= 0).all()
    assert (ids == ids[0]).all()


def test_what_lasts_without_moving_gains_nothing_by_being_seen_again():
    existence = Existence()
    origin, none, clutter = np.array([True, True]), np.zeros(2), np.full(2, 2.0)

    def odds(hits, moved):
        return log_odds(2.0, origin, np.full(2, hits), none, moved, clutter, 0.02, existence.rates)

    assert odds(15.0, 0.0) < odds(5.0, 0.0)
    values = [odds(15.0, moved) for moved in np.linspace(0.0, 1.0, 20)]
    assert (np.diff(values) >= 0.0).all()
    assert values[0] < 0.0 < values[-1]  # who walks is a person


def test_a_displacement_is_that_of_the_whole_body_while_two_cameras_see_it():
    state = np.concatenate([STANDING, np.zeros_like(STANDING)], axis=1)[None]
    anchor, moved = np.full((1, 17, 3), np.nan), np.zeros(1)

    def note(now, found):
        note_displacement(anchor, moved, state, np.array([found]), now)
        return moved[0]

    state[0, 11:] = np.nan  # legs that nobody has seen yet
    assert note(0.0, [0.0, 0.0, -np.inf]) == 0.0
    np.testing.assert_array_equal(anchor[0, :11], STANDING[:11])
    state[0, :, :3] = STANDING + [0.3, 0.4, 0.0]
    assert note(0.1, [0.1, 0.0, -np.inf]) == pytest.approx(0.5)
    np.testing.assert_allclose(anchor[0], STANDING, atol=1e-12)  # as if they had been there before
    state[0, :, :3] = STANDING
    assert note(0.2, [0.2, 0.2, -np.inf]) == pytest.approx(0.5)
    state[0, :, 0] += 9.0
    assert note(1.0, [1.0, 0.2, 0.3]) == pytest.approx(0.5)  # one camera


def test_the_likelihood_of_staying_falls_from_one_to_the_share_that_moves():
    assert staying(0.0, 0.15, 0.1) == 1.0
    assert staying(0.15, 0.15, 0.1) == pytest.approx(np.exp(-0.5))
    assert staying(3.0, 0.15, 0.1) == 0.1


def test_a_body_with_the_legs_of_another_is_not_a_person_of_its_own():
    state = np.concatenate([STANDING, np.zeros_like(STANDING)], axis=1)[None]
    torn, beside, half = STANDING.copy(), STANDING + [0.35, 0.0, 0.0], STANDING.copy()
    torn[11:] += [1.5, 0.0, 0.0]  # the mean distance is 0.53 m
    half[:9] += [1.5, 0.0, 0.0]
    assert repeats(np.array([torn, beside, half]), state).tolist() == [True, False, False]


def test_the_first_picture_says_how_many_false_detections_there_are():
    clutter = MeasuredClutter(Existence(), 2)
    first = np.full(2, np.inf)
    clutter.count(np.array([4.0, 0.0]), np.ones(2, bool), first, 0.0)
    assert clutter.density[0] == pytest.approx(4.0 * (1.0 - np.exp(-0.5)), rel=0.02)  # beside the prior of one picture
    assert clutter.density[1] == Existence().least_clutter
