"""What makes a track a person, and which track a detection belongs to: few cameras, each of which sees people alone."""

import numpy as np
import pytest
from people import STANDING, look_at, ring
from walking_people import film, identities

from mvpose import COCO17, Detections, Rig, preset
from mvpose.rays import viewing_rays
from mvpose.reconstruction.error_scale import SHARED
from mvpose.tracking import Tracker, TrackingModel
from mvpose.tracking.association import TrackAffinity
from mvpose.tracking.existence import Existence, MeasuredClutter, gather_evidence, in_image, log_odds
from mvpose.tracking.frame_kernels import vagueness_of

RATE = 25.0


def test_lasting_false_detections_agree_anew_as_rarely_as_people_come():
    """Both are rates once they have lasted: the odds do not depend on how many pictures a second has."""
    rates = Existence(statues=1e-12).rates
    both, hits, misses, clutter = np.ones(2, np.bool_), np.full(2, 8.0), np.full(2, 0.5), np.full(2, 0.8)
    often, rare = (log_odds(span, both, hits, misses, 0.0, clutter, 1e-12, rates) for span in (0.005, 0.05))
    assert often == pytest.approx(rare, abs=0.02)
    # At the start all those who came in the latest minute are there, but only as many false detections as ever.
    start = log_odds(60.0, both, hits, misses, 0.0, clutter, 1e-12, rates)
    assert start - rare == pytest.approx(np.log(60.0 / (Existence().memory / 2.0)), abs=0.02)


def test_a_scene_full_of_false_detections_is_known_after_a_second():
    clutter = MeasuredClutter(Existence(), 2)
    every, step = np.ones(2, np.bool_), np.full(2, 0.1)
    for _ in range(10):
        clutter.count(np.array([4.0, 0.0]), every, step, 0.1)
    assert clutter.density[0] == pytest.approx(4.0, rel=0.25)  # that of the plain mean with the prior: 4 x 1.0 / 1.2 s
    assert clutter.density[1] == Existence().least_clutter
    for _ in range(300):
        clutter.count(np.array([1.0, 0.0]), every, step, 0.1)
    assert clutter.density[0] == pytest.approx(1.0, rel=0.02)  # the memory is bounded: what was is forgotten


def test_a_vague_track_does_not_take_a_person_from_a_certain_one():
    rig, frames, truth = film([(0.0, 0.0, 0.0, 0.0)], [0.0], noise=0.0)
    frame, rays = frames[0], viewing_rays(rig, frames[0])
    state = np.zeros((2, 17, 6))
    state[:, :, :3] = truth[0, 0]
    state[:, :, 0] += 0.06
    covariance = np.zeros((2, 17, 6, 6))
    for track, deviation in ((0, 0.03), (1, 0.4)):
        covariance[track, :, range(3), range(3)] = deviation**2
    m = len(frame)

    def affinities(*tracks):
        tracks = list(tracks)
        joined, views = TrackAffinity().join(
            np.zeros((m, m)), frame.view, rays, state[tracks], covariance[tracks], np.zeros(m)
        )
        assert (views[m:] > frame.view.max()).all()
        np.testing.assert_array_equal(joined, joined.T)
        return joined[m:, :m]

    both = affinities(0, 1)
    assert (both[0] > both[1]).all()
    assert (both[1] > 0.5).all()  # but likelier than nobody
    np.testing.assert_array_equal(both, affinities(1, 0)[::-1])
    np.testing.assert_array_equal(affinities(0)[0], both[0])
    assert (affinities(1)[0] > both[0]).all()  # nobody else claims the person


@pytest.mark.parametrize("seconds", [0.08, 0.24])
def test_who_was_taken_for_a_ghost_is_a_person_once_two_cameras_agree(seconds):
    """A false detection lies where one camera sees a person: their ghost is a child half as far away, for a moment.

    The camera follows the ghost on, so that the person's own detections, when the other camera sees them, belong to a
    track that this camera missed for two seconds.
    """
    rig = Rig([ring(6)[0], ring(6)[2]])
    times = np.arange(90) / RATE
    paths = [(0.6, 0.4, 0.1, 0.1), (-1.2, -1.0, 0.0, 0.05), (0.2, -1.4, 0.05, 0.0)]
    paths += [(-1.4, 0.6, 0.05, 0.0), (1.3, -0.9, 0.0, 0.1)]  # all but the first: seen by one camera each

    def hidden(frame, view, person):
        return frame < 65 and view == 0 if person == 0 else view != person % 2

    _, frames, truth = film(paths, times, rig=rig, noise=1.0, hidden=hidden)
    center = rig[1].center
    for k in range(20, 20 + round(seconds * RATE)):
        small = center + 0.6 * (truth[k, 0] - center)
        given = frames[k]
        keypoints = np.concatenate([[rig[0].project(small)], given.keypoints])
        frames[k] = Detections.from_keypoints([0, *given.view], keypoints, np.full(keypoints.shape[:2], 0.9))
        frames[k] = _timed(frames[k], times[k])
    tracker = Tracker(preset("fast"), model=TrackingModel())
    estimates = [tracker.estimate(rig, frame) for frame in frames]
    there = identities(estimates, truth)[:, 0] >= 0
    assert not there[:65].any()
    assert there[72:].all()


def _timed(frame, time):
    return Detections(
        frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, time=np.full(2, float(time))
    )


def standing_in_line(*distances):
    """A rig, and states (n, 17, 6) of people who stand one behind the other as its first camera sees them."""
    rig = Rig([look_at([0.0, 0.0, 1.0], [1.0, 0.0, 1.0]), look_at([3.0, 9.0, 1.0], [3.0, 0.0, 1.0])])
    state = np.zeros((len(distances), 17, 6))
    state[..., :3] = [STANDING + [away, 0.0, 0.0] for away in distances]
    return rig, state


def gathered(rig, state, owners, *, steps=1, step=0.2, memory=1e9, fresh=False):
    """Hits and misses (n,) by pictures of the first camera, a step apart, which show the tracks ``owners``."""
    n, model = len(state), Existence()
    origin, found = np.zeros((n, 2), np.bool_), np.full((n, 2), -np.inf)
    hits, misses, absent = np.zeros((3, n, 2))
    sizes = np.array([camera.size for camera in rig], float)
    for k in range(steps):
        taken = rig.packed, sizes, np.array([True, False]), np.array([step, 0.0])
        gather_evidence(
            (origin, hits, misses, absent, found), taken, np.full(n, fresh), state, np.array(owners, np.int64),
            np.zeros(len(owners), np.int64), k * step, model.independent, memory,
        )  # fmt: skip
    return hits[:, 0], misses[:, 0]


@pytest.mark.parametrize("turned", [False, True])
def test_only_who_stands_before_somebody_hides_the_person(turned):
    """The farther of two on one line of sight may be missed; the nearer one cannot be hidden by the farther."""
    rig, state = standing_in_line(2.0, 3.5)
    near, far = (1, 0) if turned else (0, 1)
    state = state[::-1].copy() if turned else state
    assert gathered(rig, state, [near])[1][far] == 0.0
    assert gathered(rig, state, [far])[1][near] == pytest.approx(1.0)
    assert gathered(rig, state, [])[1] == pytest.approx([1.0, 1.0])  # nobody is seen: nobody hides another


def test_pictures_that_found_a_person_and_that_missed_one_are_forgotten_alike():
    """Evidence is a geometric sum: each picture counts exp(-age / memory) times as much as a new one."""
    rig, state = standing_in_line(2.0)
    memory, step, steps = 3.0, 0.5, 40
    weights = np.exp(-np.arange(steps) * step / memory).sum()
    hits, none = gathered(rig, state, [0], steps=steps, step=step, memory=memory)
    nothing, misses = gathered(rig, state, [], steps=steps, step=step, memory=memory)
    assert (none[0], nothing[0]) == (0.0, 0.0)
    assert hits[0] == pytest.approx(weights)
    assert misses[0] == pytest.approx(weights)


def test_the_vagueness_of_a_track_is_the_deviation_of_its_best_known_joint():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(5, 6, 6))
    covariance, state = half @ half.swapaxes(1, 2), rng.normal(size=(5, 6))
    of_joints = np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2) / 3.0)
    state[of_joints.argmin()] = np.nan  # an unknown joint does not count
    assert vagueness_of(state, covariance) == pytest.approx(np.sort(of_joints)[1])
    assert vagueness_of(np.full((5, 6), np.nan), covariance) == np.inf


def test_a_joint_that_all_cameras_see_is_known_to_between_the_shared_and_the_whole_error_of_a_keypoint():
    rig, frames, _ = film([(0.2, 0.1, 0.3, 0.2)], np.arange(25) / RATE, noise=1.0)
    tracker = Tracker(preset("fast"))
    estimate = [tracker.estimate(rig, frame) for frame in frames][-1]
    sigmas = tracker.model.noise.sigmas(COCO17)
    variances = np.linalg.eigvalsh(estimate.covariance[0])
    assert (variances.min(axis=1) > (SHARED * sigmas) ** 2).all()
    assert (variances.max(axis=1) < sigmas**2).all()


def test_pictures_that_miss_who_has_just_come_count_in_full_and_later_ones_by_their_time():
    rig, state = standing_in_line(2.0)
    quarter = 0.25 * Existence().independent
    assert gathered(rig, state, [], step=quarter, fresh=True)[1] == pytest.approx([1.0])
    assert gathered(rig, state, [], step=quarter)[1] == pytest.approx([0.25])
    assert gathered(rig, state, [0], step=quarter, fresh=True)[0] == pytest.approx([0.0])  # born from it


@pytest.mark.parametrize(
    ("pixels", "inside"),
    [
        ([(0.0, 0.0)] * 3, True),  # the first pixel, exactly
        ([(-0.5, 10.0)] * 3, False),
        ([(10.0, -0.5)] * 3, False),
        ([(64.0, 10.0)] * 3, False),  # one behind the last
        ([(10.0, 48.0)] * 3, False),
        ([(63.5, 47.5)] * 3, True),
        ([(10.0, 10.0), (10.0, 10.0), (90.0, 10.0)], True),  # most joints
        ([(10.0, 10.0), (90.0, 10.0), (90.0, 10.0)], False),
        ([(10.0, 10.0), (90.0, 10.0), None], False),  # one of two known joints
        ([(10.0, 10.0), None, None], True),
        ([None, None, None], False),
    ],
)
@pytest.mark.parametrize("depth", [2.0, -2.0])
def test_a_person_is_in_the_image_with_most_known_joints(pixels, inside, depth):
    """The camera looks along z from the origin; its focal lengths are 16 and 8 pixels, its centre is (32, 24)."""
    camera = np.array([16.0, 0.0, 32.0, 8.0, 24.0, *np.eye(3).ravel(), *np.zeros(8)])
    places = [
        (np.nan,) * 3 if p is None else ((p[0] - 32) / 16 * depth, (p[1] - 24) / 8 * depth, depth) for p in pixels
    ]
    state = np.concatenate([places, np.zeros((3, 3))], axis=1)
    assert in_image(camera, np.array([64.0, 48.0]), state) == (inside and depth > 0)
    beside_camera = np.full((3, 6), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not in_image(camera, np.array([64.0, 48.0]), beside_camera)
