"""Hostile input to the whole method: an estimate, or one clear ValueError, in bounded time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import crowd, detect, look_at, ring

import mvpose
from mvpose import Camera, Detections, Rig
from mvpose.detections import MOST_DETECTIONS
from mvpose.presets import NEED_DESCRIPTORS, PRESETS

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

SEEING = [name for name in PRESETS if name not in NEED_DESCRIPTORS]
HUGE = [1e300, -1e300, 1.7e308, 1e155, 1e-300, 5e-324]


def attempt(preset, make):
    """Return the estimate of ``make() -> (rig, detections)``; None where a ValueError of one short line refuses it."""
    refusal = None
    try:
        rig, detections = make()
        estimate = mvpose.preset(preset).estimate(rig, detections)
    except ValueError as error:
        refusal = str(error)
    if refusal is not None:
        assert 10 < len(refusal) < 400
        assert "\n" not in refusal
        return None
    assert estimate.matching.labels.shape == (len(detections),)
    np.testing.assert_array_equal(np.isfinite(estimate.joints).all(axis=2), estimate.scores > 0)
    return estimate


def uniform(count, views, seed=0):
    rng = np.random.default_rng(seed)
    return Detections.from_keypoints(
        np.arange(count) % views, rng.uniform(0, 960, (count, 17, 2)), np.full((count, 17), 0.9)
    )


@pytest.mark.parametrize("preset", SEEING)
def test_more_detections_than_a_frame_has_are_refused_at_once(preset):
    with pytest.raises(ValueError, match=r"at most 2000 detections, got 10000; pass one frame at a time"):
        mvpose.preset(preset).estimate(ring(5), uniform(10_000, 5))


def test_the_largest_frame_is_estimated():
    assert attempt("fast", lambda: (ring(40), uniform(MOST_DETECTIONS, 40))) is not None


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["full", "fast"])
def test_two_hundred_views_of_two_people(preset):
    rig, people = ring(200), crowd(2)
    estimate = attempt(preset, lambda: (rig, detect(rig, people, noise=1.0)[0]))
    assert estimate is not None
    assert len(estimate) == 2
    centers = np.sort(np.nanmean(estimate.joints[..., 0], axis=1))
    np.testing.assert_allclose(centers, np.sort(people[..., 0].mean(axis=1)), atol=0.02)


@pytest.mark.parametrize("preset", SEEING)
def test_rigs_that_cannot_triangulate(preset):
    rig = ring(5)
    one = Detections.from_keypoints([0], np.full((1, 17, 2), 600.0), np.ones((1, 17)))
    assert attempt(preset, lambda: (Rig([]), Detections.empty())) is None
    assert attempt(preset, lambda: (Rig([rig[0]] * 2), one)) is None  # one point
    estimate = attempt(preset, lambda: (Rig([rig[0]]), one))
    assert estimate is None or len(estimate) == 0


@pytest.mark.parametrize(
    "change",
    [
        {"K": np.zeros((3, 3))},
        {"K": np.diag([800.0, 0.0, 1.0])},
        {"K": np.full((3, 3), np.nan)},
        {"K": np.diag([1e300, 1e300, 1.0])},
        {"K": np.diag([1e-300, 1e-300, 1.0])},
        {"R": np.zeros((3, 3))},
        {"R": np.diag([1.0, 1.0, -1.0])},
        {"t": np.array([np.inf, 0, 0])},
        {"t": np.array([1e300, 0, 0])},
        {"distortion": np.array([1e300, 0, 0, 0, 0])},
        {"distortion": np.array([np.nan, 0, 0, 0, 0])},
        {"size": (0, 0)},
        {"size": (-5, 10**12)},
    ],
    ids=str,
)
def test_cameras_out_of_this_world(change):
    rig = ring(3)
    given = {"K": rig[0].K, "R": rig[0].R, "t": rig[0].t, "distortion": rig[0].distortion, "size": rig[0].size}
    detections, _ = detect(rig, crowd(2))

    def make():
        return Rig([Camera(**{**given, **change}), rig[1], rig[2]]), detections

    for preset in ("full", "fast", "no-matching"):
        attempt(preset, make)


@pytest.mark.parametrize("preset", SEEING)
@settings(max_examples=10)
@given(
    value=st.sampled_from(HUGE) | st.floats(width=64, allow_nan=False, allow_infinity=False),
    where=st.sampled_from(["keypoints", "boxes", "camera", "world"]),
    seed=st.integers(0, 2**31),
)
def test_huge_and_tiny_numbers(preset, value, where, seed):
    rng = np.random.default_rng(seed)
    rig = ring(4)
    clean, _ = detect(rig, crowd(2), seed=seed)
    keypoints, boxes = clean.keypoints.copy(), clean.boxes.copy()

    def make():
        cameras = rig
        if where == "keypoints":
            keypoints[rng.integers(len(keypoints), size=3), rng.integers(17, size=3), rng.integers(2, size=3)] = value
        elif where == "boxes":
            boxes[rng.integers(len(boxes))] = [value, -value, abs(value), abs(value)]
        elif where == "camera":
            cameras = Rig([Camera(rig[0].K, rig[0].R, rig[0].t + value, size=rig[0].size), *rig.cameras[1:]])
        else:  # all cameras far from the origin
            with np.errstate(over="ignore", invalid="ignore"):
                cameras = Rig([Camera(c.K, c.R, c.t - c.R @ np.full(3, value), size=c.size) for c in rig])
        return cameras, Detections(clean.view, keypoints, clean.scores, boxes, clean.box_scores)

    attempt(preset, make)


@pytest.mark.parametrize("preset", SEEING)
def test_boxes_without_extent(preset):
    rig, people = ring(5), crowd(2)
    clean, _ = detect(rig, people)
    boxes = np.zeros((len(clean), 4))
    estimate = attempt(
        preset, lambda: (rig, Detections(clean.view, clean.keypoints, clean.scores, boxes, np.zeros(len(clean))))
    )
    assert estimate is not None
    assert len(estimate) == 2


@pytest.mark.parametrize("score", [-0.1, 1.0001, 100.0, np.inf])
def test_scores_outside_their_range_are_refused(score):
    clean, _ = detect(ring(3), crowd(1))
    with pytest.raises(ValueError, match=r"scores must lie in 0\.\.1"):
        Detections.from_keypoints(clean.view, clean.keypoints, np.full((3, 17), score))


@settings(max_examples=20)
@given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 1e-4))
def test_cameras_almost_at_one_point(center, apart):
    detections, _ = detect(ring(3), crowd(2))

    def make():
        return Rig([look_at(np.add(center, [k * apart, 0, 9]), [0.1 * k, 0.3, 0]) for k in range(3)]), detections

    for preset in ("full", "fast", "no-matching"):
        attempt(preset, make)
