"""Who has come back: the joint assignment of newcomers to lost people, bodies, jumps, and false detections."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, ring
from walking_people import film, identities

import mvpose
from mvpose import COCO17, Detections
from mvpose.affinity import AppearanceAffinity
from mvpose.reconstruction.poses import Poses
from mvpose.tracking import Tracker
from mvpose.tracking.bones import bone_prior
from mvpose.tracking.frame_kernels import update_tracks
from mvpose.tracking.motion import MotionModel, transition
from mvpose.tracking.pose_update import MatchedRays, PlacedPeople
from mvpose.tracking.reappearance import Reappearance
from mvpose.tracking.tracks import Tracks

MOTION, MODEL = MotionModel(), Reappearance()
OF_JOINTS = MOTION.of_joints(COCO17)
RATE = 25.0


def _tracks(places, *, sizes=1.0, raised=0.0, seen=0.0):
    """Tracks of people of these sizes whose trunks are at places (n, 2), last seen at these times."""
    places = np.reshape(places, (-1, 2))
    n = len(places)
    size = np.broadcast_to(sizes, n)[:, None, None]
    trunk = STANDING[OF_JOINTS.trunk].mean(axis=0)
    joints = trunk + size * (STANDING - trunk) + np.array([0.0, 0.0, 1.0]) * np.broadcast_to(raised, n)[:, None, None]
    joints[:, :, :2] += (places - trunk[:2])[:, None]
    scores = np.ones((n, 17))
    poses = Poses(joints, scores, np.tile(1e-4 * np.eye(3), (n, 17, 1, 1)), scores)
    speed, bones = MOTION.of_newcomers(COCO17), bone_prior(COCO17)
    tracks = Tracks.born(poses, ids=np.arange(n), time=0.0, span=0.04, speed=speed, bones=bones, cameras=2)
    return replace(tracks, found=np.repeat(np.broadcast_to(np.asarray(seen, float), n)[:, None], 2, axis=1))


def _match(born, lost, time):
    return MODEL.match(
        born, lost, time=time, motion=MOTION, trunk=OF_JOINTS.trunk, present=_tracks([]),
        witnesses=np.zeros(len(born), np.int64), scale=AppearanceAffinity(),
    )  # fmt: skip


def _cost(way2, gone, size):
    """Twice the negative log-likelihood ratio against somebody new, of a return after a time; 0 for somebody new."""
    variance = transition(gone, *MOTION.trunk)[2] + MODEL.deviation**2
    ratio = MODEL.returns / (2.0 * np.pi * variance) / (MODEL.arrivals / MODEL.room)
    return way2 / variance - min(2.0 * np.log(ratio), MODEL.gate) + (np.log(size) / 0.05) ** 2


def _total(cost, columns):
    return sum(cost[row, column] for row, column in enumerate(columns) if column >= 0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 4))
def test_the_assignment_is_the_likeliest_of_all(seed, newcomers, missing):
    rng = np.random.default_rng(seed)
    here, there = rng.uniform(-2.0, 2.0, (newcomers, 2)), rng.uniform(-2.0, 2.0, (missing, 2))
    sizes, others, seen = (
        rng.uniform(0.9, 1.1, newcomers),
        rng.uniform(0.9, 1.1, missing),
        rng.uniform(0.0, 5.0, missing),
    )
    cost = np.array([
        [_cost(((here[i] - there[k]) ** 2).sum(), 6.0 - seen[k], sizes[i] / others[k]) for k in range(missing)]
        for i in range(newcomers)
    ])  # fmt: skip
    cost[cost >= 0.0] = np.inf
    found = _match(_tracks(here, sizes=sizes), _tracks(there, sizes=others, seen=seen), 6.0)
    known = found[found >= 0]
    assert len(set(known)) == len(known)
    choices = product(range(-1, missing), repeat=newcomers)
    least = min(_total(cost, each) for each in choices if len({*each} - {-1}) == sum(k >= 0 for k in each))
    assert _total(cost, found) == pytest.approx(least, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_other_names_and_another_order_change_nobody(seed):
    rng = np.random.default_rng(seed)
    born = _tracks(rng.uniform(-2.0, 2.0, (4, 2)), sizes=rng.uniform(0.9, 1.1, 4))
    lost = _tracks(rng.uniform(-2.0, 2.0, (5, 2)), sizes=rng.uniform(0.9, 1.1, 5), seen=rng.uniform(0.0, 4.0, 5))
    rows, columns = rng.permutation(4), rng.permutation(5)
    renamed = replace(lost.select(columns), ids=rng.permutation(100)[:5])
    found, again = _match(born, lost, 6.0), _match(born.select(rows), renamed, 6.0)
    np.testing.assert_array_equal(np.where(again >= 0, columns[again], -1), found[rows])


@given(st.floats(0.01, 9.9), st.floats(0.0, 40.0))
def test_nobody_comes_back_faster_than_people_run(gone, way):
    found = _match(_tracks([way, 0.0]), _tracks([0.0, 0.0]), gone)
    if found[0] >= 0:
        assert way < 4.0 * gone + 4.0 * MODEL.deviation
    assert found[0] == 0 or way > 0.3


def test_a_body_of_another_size_or_height_is_somebody_else():
    lost = _tracks([0.0, 0.0])
    for size, raised, same in (
        (1.0, 0.0, True),
        (0.95, 0.0, True),
        (0.6, 0.0, False),
        (1.0, -0.4, True),
        (1.0, 0.9, False),
    ):
        assert (_match(_tracks([0.3, 0.0], sizes=size, raised=raised), lost, 2.0)[0] >= 0) == same


@pytest.mark.parametrize("way", [0.05, 0.2, 0.8, 3.0])
def test_a_track_does_not_jump_to_where_rays_meet(way):
    """A step of 50 ms: what is too far is left to a birth, and the track stays as it was."""
    tracks, rig = _tracks([0.0, 0.0]), ring(5)
    tracks.covariance[:, :, :3, :3] = 0.03**2 * np.eye(3)
    pixels = STANDING + [way, 0.0, 0.0] - STANDING[OF_JOINTS.trunk].mean(axis=0) * [1.0, 1.0, 0.0]
    centers = rig.centers
    ways = pixels - centers[:, None]
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    one = np.zeros(5, np.int64)
    rays = MatchedRays(one, np.arange(5), centers, ways, np.full((5, 17), 0.9), np.full(5, 1e-3), np.zeros(5))
    nobody = PlacedPeople(np.array([-1]), np.empty((0, 17, 3)), np.empty((0, 17, 3, 3)), np.empty((0, 17)), 1.0)
    before = tracks.state.copy()
    ends = bone_prior(COCO17).ends
    owner, fresh, count = update_tracks(
        tracks.poses, np.array([0]), rays, np.full(17, 0.03), 0.01, OF_JOINTS, nobody, ends, 0.05, 0.9
    )  # fmt: skip
    if way == 0.8:
        assert (count, *owner, *fresh) == (1, *[-1] * 5, *one)
        np.testing.assert_array_equal(tracks.state, before)
    else:  # by far rays a track is not moved in the first place
        assert (count, *owner, *fresh) == (0, *one, *[-1] * 5)
    moved = (tracks.state - before)[0, OF_JOINTS.trunk, :3].mean(axis=0)
    assert np.linalg.norm(moved) < 0.45


def _with_ghost(rig, frame, body, views):
    """Return a frame with one false detection more in each of some views."""
    keypoints = np.concatenate([frame.keypoints, [rig[view].project(body) for view in views]])
    given = Detections.from_keypoints([*frame.view, *views], keypoints, np.full(keypoints.shape[:2], 0.9))
    return replace(given, time=frame.time)


def _hidden(first, last):
    """Film of a person who stands and is hidden in these frames, and of one who walks."""
    paths = [(0.0, 0.0, 0.0, 0.0), (1.5, 0.6, -0.4, -0.3)]
    return film(
        paths, np.arange(last + 20) / RATE, hidden=lambda frame, view, person: person == 0 and first <= frame < last
    )


@pytest.mark.parametrize("dark", [False, True])
def test_who_is_gone_from_the_pictures_is_soon_lost_and_who_has_no_pictures_is_followed(dark):
    rig, frames, _ = film([(0.0, 0.0, 0.0, 0.0)], np.arange(40) / RATE,
                          hidden=lambda frame, *_: frame >= 20, lost=lambda frame, _: dark and frame >= 20)  # fmt: skip
    tracker = Tracker(mvpose.preset("fast"))
    for frame in frames:
        tracker.estimate(rig, frame)
    assert (tracker.state().followed, tracker.state().lost) == ((1, 0) if dark else (0, 1))


def test_a_ghost_keeps_nobodys_identity():
    """Two false detections meet near where somebody was lost, before this person comes back and a little longer."""
    rig, frames, truth = _hidden(12, 72)
    for k in range(70, 74):
        frames[k] = _with_ghost(rig, frames[k], truth[12, 0] + [0.5, 0.4, 0.0], [0, 3])
    tracker = Tracker(mvpose.preset("fast"))
    ids = identities([tracker.estimate(rig, frame) for frame in frames], truth)
    assert (ids[-5:] == ids[0]).all()
