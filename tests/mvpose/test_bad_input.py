"""Damaged input to the whole method: a clear ValueError, or all other people are still found."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from people import crowd, look_at, ring
from scipy.optimize import linear_sum_assignment

import mvpose
from mvpose import COCO17, SHELF14, Camera, Detections, Rig
from mvpose.presets import NEED_DESCRIPTORS, PRESETS
from mvpose.skeleton import PANOPTIC19

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

SEEING = [name for name in PRESETS if name not in NEED_DESCRIPTORS]
MIDDLES = {"neck": ("left_shoulder", "right_shoulder"), "mid_hip": ("left_hip", "right_hip")}
PANOPTIC = [MIDDLES.get(joint, (joint,)) for joint in PANOPTIC19.joints]  # the joints of COCO-17 it is amid
BARREL = [-0.37, 0.15, 0.0, 0.0, 0.0]
WEBCAM = [0.115, -0.219, 0.0012, 0.0086, 0.113]
WILD = [np.nan, np.inf, -np.inf, 1e4, -1e6, 1e6, 1e12, 1e300, -1.7e308]


@dataclass(frozen=True)
class Frame:
    """Arrays to be damaged, as a careless caller might pass them, and the true people.

    ``person`` is the person of each detection, -1 for none; ``touched`` are the people with a damaged detection.
    """

    rig: Rig
    people: np.ndarray
    view: np.ndarray
    person: np.ndarray
    keypoints: np.ndarray
    scores: np.ndarray
    touched: frozenset = frozenset()

    def detections(self):
        return Detections.from_keypoints(self.view, self.keypoints, self.scores)

    def of(self, rows, **changes):
        """Return the frame with changes to the detections of some rows."""
        who = set(self.person[rows].tolist()) - {-1}
        return replace(self, touched=self.touched | who, **changes)

    def without(self, rows):
        rest = np.delete(np.arange(len(self.view)), rows)
        fields = ("view", "person", "keypoints", "scores")
        return self.of(rows, **{key: getattr(self, key)[rest] for key in fields})

    def with_more(self, view, person, keypoints):
        return replace(
            self,
            view=np.append(self.view, view),
            person=np.append(self.person, person),
            keypoints=np.concatenate([self.keypoints, keypoints]),
            scores=np.concatenate([self.scores, np.full((len(keypoints), 17), 0.9)]),
        )


def clean(seed, rig=None, *, count=3, noise=3.0):
    rng = np.random.default_rng(seed)
    rig = ring(5) if rig is None else rig
    people = crowd(count, seed=seed)
    pixels = rig.project(people)
    view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
    keypoints = pixels[view, person] + noise * rng.standard_normal((len(view), 17, 2))
    return Frame(rig, people, view, person, keypoints, np.full((len(view), 17), 0.9))


def _pick(frame, rng, count=1):
    return rng.choice(len(frame.view), count, replace=False)


def joints_gone_wild(frame, rng):
    """Some joints of two detections are not finite, or have any floating-point value."""
    rows, keypoints = _pick(frame, rng, 2), frame.keypoints.copy()
    for row in rows:
        joints = rng.choice(17, rng.integers(1, 5), replace=False)
        keypoints[row, joints, rng.integers(2)] = rng.choice(WILD, len(joints))
    return frame.of(rows, keypoints=keypoints)


def all_joints_wild(frame, rng):
    rows, keypoints = _pick(frame, rng), frame.keypoints.copy()
    keypoints[rows] = rng.choice(WILD, (1, 17, 2))
    return frame.of(rows, keypoints=keypoints)


def scores_of_nothing(frame, rng):
    rows, scores = _pick(frame, rng), frame.scores.copy()
    scores[rows] = rng.choice([0.0, np.nan, 1e-300])
    return frame.of(rows, scores=scores)


def garbage_instead(frame, rng):
    rows, keypoints = _pick(frame, rng), frame.keypoints.copy()
    keypoints[rows] = rng.uniform(0, 1280, 2) + rng.choice([0.0, 5.0, 80.0, 1e5]) * rng.standard_normal((1, 17, 2))
    return frame.of(rows, keypoints=keypoints)


def garbage_besides(frame, rng):
    """Two in one view, because in two views they could agree on a place by chance and form a person."""
    middle, spread = rng.uniform(0, 960, (2, 1, 2)), rng.choice([0.0, 5.0, 80.0, 1e5], (2, 1, 1))
    view = np.full(2, rng.integers(len(frame.rig)))
    return frame.with_more(view, [-1, -1], middle + spread * rng.standard_normal((2, 17, 2)))


def repeated(frame, rng):
    """Detections repeated once or twice, exactly or with errors of half a pixel."""
    rows = np.repeat(_pick(frame, rng, 4), rng.integers(1, 3))
    off = rng.choice([0.0, 0.5]) * rng.standard_normal((len(rows), 17, 2))
    return frame.with_more(frame.view[rows], frame.person[rows], frame.keypoints[rows] + off)


def view_empty(frame, rng):
    return frame.without(np.flatnonzero(frame.view == rng.integers(len(frame.rig))))


def view_blind(frame, rng):
    """All detections of a view are present, but without keypoints."""
    rows, keypoints = np.flatnonzero(frame.view == rng.integers(len(frame.rig))), frame.keypoints.copy()
    keypoints[rows] = np.nan
    return frame.of(rows, keypoints=keypoints)


DAMAGE = [
    joints_gone_wild,
    all_joints_wild,
    scores_of_nothing,
    garbage_instead,
    garbage_besides,
    repeated,
    view_empty,
    view_blind,
]


def twins(distortion):
    """Five cameras, two of which stand in one point with slightly different directions."""
    rig = ring(5, distortion=distortion)
    twin = look_at(rig[0].center, [0.1, 0.2, 0.9], distortion=distortion, name="twin")
    return Rig([rig[0], twin, *rig.cameras[2:]])


def far_from_the_origin(distortion):
    """Survey coordinates: 500 km east, 5300 km north."""
    shift = np.array([5.0e5, 5.3e6, 400.0])
    return Rig(
        [Camera(c.K, c.R, c.t - c.R @ shift, c.distortion, c.size) for c in ring(5, distortion=distortion)]
    ), shift


def estimated(preset, frame, detections=None):
    """Estimate, after checking the properties that hold for any input."""
    detections = frame.detections() if detections is None else detections
    estimate = mvpose.preset(preset).estimate(frame.rig, detections)
    placed = estimate.scores > 0
    assert ((estimate.scores >= 0) & (estimate.scores <= 1)).all()
    np.testing.assert_array_equal(np.isfinite(estimate.joints).all(axis=2), placed)
    if estimate.covariance is not None and placed.any():
        assert np.isfinite(estimate.covariance[placed]).all()
        assert np.linalg.eigvalsh(estimate.covariance[placed]).min() > 0
    labels = estimate.matching.labels
    assert labels.shape == (len(detections),)
    pairs = np.column_stack([labels, detections.view])[labels >= 0]
    assert len(np.unique(pairs, axis=0)) == len(pairs)  # at most one detection of a view in a person
    return estimate


def distances(estimate, people):
    """Joint errors of every true person and its assigned estimate, (P, J), metres; infinite without an estimate."""
    off = np.linalg.norm(estimate.joints[None] - people[:, None], axis=3)  # (P, n, J)
    result = np.full(people.shape[:2], np.inf)
    cost = np.nan_to_num(np.median(np.nan_to_num(off, nan=9.0), axis=2), posinf=9.0)
    for true, index in zip(*linear_sum_assignment(cost), strict=True):
        result[true] = np.nan_to_num(off[true, index], nan=np.inf)
    return result


def assert_found(estimate, frame):
    """Check every joint of undamaged people, and the median joint of the others."""
    off = distances(estimate, frame.people)
    untouched = [person for person in range(len(frame.people)) if person not in frame.touched]
    assert (np.median(off, axis=1) < 0.05).all()
    assert (off[untouched] < 0.15).all()


@pytest.mark.parametrize("preset", SEEING)
@pytest.mark.parametrize("damage", DAMAGE, ids=lambda damage: damage.__name__)
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_one_kind_of_damage_loses_no_person(preset, damage, seed):
    frame = damage(clean(seed), np.random.default_rng(seed + 1))
    estimate = estimated(preset, frame)
    assert_found(estimate, frame)
    assert len(estimate) == 3


@pytest.mark.parametrize("preset", SEEING)
@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    damages=st.lists(st.sampled_from(DAMAGE), min_size=2, max_size=2),
    distortion=st.sampled_from([None, BARREL, WEBCAM]),
    world=st.sampled_from(["ring", "twins", "far"]),
)
def test_two_kinds_of_damage_on_an_unusual_rig_lose_no_person(preset, seed, damages, distortion, world):
    lost = sum(damage in (view_empty, view_blind) for damage in damages)
    assume(world != "twins" or lost < 2)  # two points of view and noise: too little for everybody
    rng = np.random.default_rng(seed)
    rig = twins(distortion) if world == "twins" else ring(5, distortion=distortion)
    frame = clean(seed, rig, count=2)
    if world == "far":
        rig, shift = far_from_the_origin(distortion)
        frame = replace(frame, rig=rig, people=frame.people + shift)
    for damage in damages:
        frame = damage(frame, rng)
    assert_found(estimated(preset, frame), frame)


@pytest.mark.parametrize("preset", SEEING)
@pytest.mark.parametrize("wild", WILD)
def test_one_wild_keypoint_does_not_lose_its_joint(preset, wild):
    frame = clean(7)
    frame.keypoints[5, 9] = [wild, 300.0]
    frame.keypoints[0, 15] = [wild, wild]
    estimate = estimated(preset, frame)
    assert len(estimate) == 3
    assert (distances(estimate, frame.people) < 0.15).all()


anything = st.floats(width=64) | st.sampled_from([0.0, 1e6, -1e9, 640.0, np.nan, np.inf])
EVERYWHERE = 1 / 3 * np.array([[0, 0, 0], [0, 0, 0], [1, 2, 5], [1e-5, 0, 0]])


@st.composite
def nonsense(draw):
    """Arrays of the right shape with any values, and a barely valid rig."""
    count = draw(st.integers(0, 5))
    view = draw(arrays.arrays(np.int64, count, elements=st.integers(0, 3)))
    keypoints = draw(arrays.arrays(float, (count, 17, 2), elements=anything))
    scores = draw(arrays.arrays(float, (count, 17), elements=st.floats(0, 1) | st.just(np.nan)))
    lens = draw(st.sampled_from([None, BARREL, WEBCAM, [3.0, -9.0, 1.0, 1.0, 30.0]]))
    cameras = [look_at(center, [0, 4, 1], distortion=lens, size=(640, 480)) for center in EVERYWHERE]
    return Rig(cameras), view, keypoints, scores


@pytest.mark.slow
@pytest.mark.parametrize("preset", SEEING)
@settings(max_examples=25)
@given(nonsense())
def test_random_arrays_give_a_valid_estimate(preset, given):
    rig, view, keypoints, scores = given
    detections = Detections.from_keypoints(view, keypoints, scores)
    frame = Frame(rig, np.zeros((0, 17, 3)), view, view, keypoints, scores)
    estimated(preset, frame, detections)


@pytest.mark.parametrize("preset", SEEING)
def test_the_same_garbage_in_every_view_gives_a_valid_estimate(preset):
    """All joints in one pixel, poses in one column, poses without extent: zero areas, bones and baselines."""
    for rig in (ring(4), twins(BARREL)):
        views = len(rig)
        for pose in (np.full((17, 2), 600.0), np.linspace([600, 100], [600, 900], 17), rig[0].K[:2, 2] + np.eye(17, 2)):
            keypoints = np.repeat(pose[None], 2 * views, axis=0)
            frame = Frame(rig, np.zeros((0, 17, 3)), np.tile(np.arange(views), 2), None, keypoints, None)
            for scores in (np.ones((2 * views, 17)), np.full((2 * views, 17), 1e-6)):
                estimated(preset, frame, Detections.from_keypoints(frame.view, keypoints, scores))


@pytest.mark.parametrize("preset", SEEING)
def test_missing_keypoints_give_no_people(preset):
    frame = clean(0)
    for changes in ({"keypoints": np.full_like(frame.keypoints, np.nan)}, {"scores": np.zeros_like(frame.scores)}):
        assert len(estimated(preset, replace(frame, **changes))) == 0
    assert len(estimated(preset, frame, Detections.empty())) == 0
    alone = frame.without(np.flatnonzero(frame.view != 2))
    assert len(estimated(preset, alone)) == 0  # one view says nothing of where


@pytest.mark.parametrize("preset", SEEING)
def test_inconsistent_input_is_refused(preset):
    frame = clean(0)
    estimate = mvpose.preset(preset).estimate
    with pytest.raises(ValueError, match="names view 4, but the rig has 3 cameras"):
        estimate(ring(3), frame.detections())
    with pytest.raises(ValueError, match=r"keypoints must be \(15, 14, 2\), got \(15, 17, 2\): skeleton 'shelf14'"):
        estimate(frame.rig, Detections.from_keypoints(frame.view, frame.keypoints, frame.scores, skeleton=SHELF14))
    with pytest.raises(ValueError, match=r"scores must lie in 0\.\.1"):
        estimate(frame.rig, replace(frame, scores=100 * frame.scores).detections())
    with pytest.raises(ValueError, match="one point"):
        estimate(Rig([frame.rig[0]] * 5), frame.detections())


@pytest.mark.parametrize("preset", SEEING)
def test_other_skeletons_work(preset):
    """No stage assumes a number or order of joints."""
    frame, rows = clean(0), [16, 14, 12, 11, 13, 15, 10, 8, 6, 5, 7, 9, 0, 1]
    keypoints, scores = frame.keypoints[:, rows], frame.scores[:, rows]
    detections = Detections.from_keypoints(frame.view, keypoints, scores, skeleton=SHELF14)
    estimate = estimated(preset, frame, detections)
    assert len(estimate) == 3
    limbs = distances(estimate, frame.people[:, rows])[:, :12]
    assert (limbs < 0.15).all()


@pytest.mark.parametrize("preset", SEEING)
def test_a_skeleton_with_bones_of_unknown_length_has_all_its_joints(preset):
    """The distance from neck to mid-hip is not published, so that bone is not constrained."""
    frame = clean(0, noise=1.0)

    def panoptic(joints):
        """Map COCO-17 (..., 17, k) to PANOPTIC19, with midpoints taken in the picture as in space."""
        return np.stack([joints[..., [COCO17.index(end) for end in ends], :].mean(axis=-2) for ends in PANOPTIC], -2)

    keypoints, people = panoptic(frame.keypoints), panoptic(frame.people)
    detections = Detections.from_keypoints(
        frame.view, keypoints, np.full(keypoints.shape[:2], 0.9), skeleton=PANOPTIC19
    )
    estimate = estimated(preset, frame, detections)
    assert len(estimate) == len(people)
    assert (distances(estimate, people) < 0.1).all()
