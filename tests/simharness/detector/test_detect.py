from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi

from mvpose import COCO17, Camera, Rig
from simharness.detector.detect import BOX_SHARE, detect
from simharness.detector.truth import KeypointError
from simharness.humans.landmarks import LANDMARKS
from simharness.rendering.views import Views
from simharness.rendering.visibility import Visibility
from simharness.scenario.models import Detector
from simharness.scene.sequence import Sequence

PERFECT = {
    "jitter": 0.0, "miss_visible": 0.0, "miss_self": 0.0, "miss_occluded": 0.0, "miss_person": 0.0, "phantoms": 0.0,
    "box_jitter": 0.0,
}  # fmt: skip


def scene(frames=60, views=3, people=2, *, visibility=Visibility.VISIBLE, height=300.0):
    """People as pictures only: what a detector errs about does not depend on how the views were made."""
    rig = Rig([Camera(np.diag([800.0, 800, 1]), np.eye(3), [0.5 * v, 0, 5], size=(800, 600)) for v in range(views)])
    rng = np.random.default_rng(0)
    shape = (frames, views, people)
    corner = rng.uniform(50, 250, (*shape, 1, 2))
    size = np.array([0.4 * height, height])
    pixels = corner + rng.random((*shape, 17, 2)) * size
    boxes = np.concatenate([corner[..., 0, :], np.broadcast_to(size, (*shape, 2))], axis=-1)
    seen = np.full((*shape, 17), visibility) if np.isscalar(visibility) else visibility
    area = np.zeros(shape, int)
    sequence = Sequence(rng.random((frames, people, len(LANDMARKS), 3)), np.arange(people), 0.1 * np.arange(frames))
    source = np.broadcast_to(np.arange(frames)[:, None], (frames, views))
    return sequence, Views(pixels, seen, boxes, area, source), rig


def run(world, *, seed=3, **dials):
    sequence, views, rig = world
    return detect(sequence, views, rig, Detector(**{**PERFECT, **dials}), seed=seed)


def within(count, trials, chance):
    low, high = binom.interval(1 - 1e-6, trials, chance)
    return low <= count <= high


def by_person(frames, views, people):
    """Keypoints of real detections as (T, V, P, 17, 2), NaN where absent."""
    result = np.full((len(frames), views, people, 17, 2), np.nan)
    for t, (detections, truth) in enumerate(frames):
        real = truth.person >= 0
        result[t, detections.view[real], truth.person[real]] = detections.keypoints[real]
    return result


def test_a_perfect_detector_sees_the_exact_projections():
    world = scene()
    frames = run(world)
    np.testing.assert_array_equal(by_person(frames, 3, 2), world[1].pixels)
    for detections, truth in frames:
        assert len(detections) == 6
        assert (truth.error == KeypointError.GOOD).all()
        np.testing.assert_allclose(detections.boxes, truth.boxes[detections.view, truth.person])


@pytest.mark.parametrize(
    ("dial", "visibility"),
    [
        ("miss_visible", Visibility.VISIBLE),
        ("miss_self", Visibility.SELF_OCCLUDED),
        ("miss_occluded", Visibility.OCCLUDED_BY_PERSON),
        ("miss_occluded", Visibility.OCCLUDED_BY_CLUTTER),
    ],
)
def test_joints_are_missed_at_the_asked_rate(dial, visibility):
    seen = np.full((60, 3, 2, 17), visibility)
    seen[..., :8] = Visibility.VISIBLE  # enough for the person to be detected
    which = slice(0, 8) if visibility == Visibility.VISIBLE else slice(8, 17)
    found = np.isfinite(by_person(run(scene(visibility=seen), **{dial: 0.3}), 3, 2)[..., 0])
    missed = ~found[..., which]
    assert within(missed.sum(), missed.size, 0.3)
    if visibility != Visibility.VISIBLE:
        assert found[..., :8].all()


def test_joints_outside_the_image_are_never_detected():
    seen = np.full((60, 3, 2, 17), Visibility.VISIBLE)
    seen[..., 15:] = Visibility.OUTSIDE
    keypoints = by_person(run(scene(visibility=seen), jitter=0.5), 3, 2)
    assert np.isnan(keypoints[..., 15:, :]).all()
    assert np.isfinite(keypoints[..., :15, :]).all()


def test_people_are_missed_at_the_asked_rate_and_when_hardly_seen():
    frames = run(scene(frames=200), miss_person=0.2)
    assert within(sum(len(d) for d, _ in frames), 200 * 3 * 2, 0.8)
    seen = np.full((60, 3, 2, 17), Visibility.OCCLUDED_BY_CLUTTER)
    seen[:, :, 0, :5] = Visibility.VISIBLE
    seen[:, :, 1, :4] = Visibility.VISIBLE
    assert all((truth.person == 0).all() and len(truth.person) == 3 for _, truth in run(scene(visibility=seen)))
    assert all(len(detections) == 0 for detections, _ in run(scene(), miss_person=1.0))


@pytest.mark.parametrize("height", [80.0, 320.0])
def test_jitter_scales_with_the_person_and_the_joint(height):
    world = scene(frames=300, height=height)
    error = by_person(run(world, jitter=0.5), 3, 2) - world[1].pixels
    expected = 0.5 * np.array(COCO17.sigmas) * np.sqrt(BOX_SHARE * 0.4 * height * height)
    np.testing.assert_allclose(error.std(axis=(0, 1, 2, 4)), expected, rtol=0.08)  # 3600 draws: 1.2 % a deviation


def test_error_classes_follow_the_distance():
    frames = run(scene(frames=200), jitter=1.0)
    error = np.concatenate([truth.error for _, truth in frames])
    distance = chi(2)  # of a standard normal offset in the plane, in units of sigma sqrt(area)
    for kind, share in (
        (KeypointError.GOOD, distance.cdf(1.14)),
        (KeypointError.JITTER, distance.cdf(2.35) - distance.cdf(1.14)),
        (KeypointError.MISS, distance.sf(2.35)),
    ):
        assert within((error == kind).sum(), error.size, share)


def test_phantoms_come_at_the_asked_rate_and_more_only_adds():
    few, many = run(scene(frames=400), phantoms=0.3), run(scene(frames=400), phantoms=0.9)
    for frames, rate in ((few, 0.3), (many, 0.9)):
        counts = np.array([(truth.person < 0).sum() for _, truth in frames])
        assert abs(counts.sum() - 1200 * rate) < 5 * np.sqrt(1200 * rate)
        assert (np.concatenate([t.error[t.person < 0] for _, t in frames]) == KeypointError.MISS).all()
    for (a, truth_a), (b, truth_b) in zip(few, many, strict=True):
        kept = {keypoints.tobytes() for keypoints in b.keypoints[truth_b.person < 0]}
        assert all(keypoints.tobytes() in kept for keypoints in a.keypoints[truth_a.person < 0])


def test_one_dial_leaves_every_other_draw_alone():
    world = scene()
    before = by_person(run(world, jitter=0.4), 3, 2)
    for dial, value in (("phantoms", 1.0), ("miss_visible", 0.2), ("miss_person", 0.3), ("box_jitter", 0.1)):
        after = by_person(run(world, jitter=0.4, **{dial: value}), 3, 2)
        both = np.isfinite(after)
        assert both.any()
        np.testing.assert_array_equal(after[both], before[both])


def test_one_seed_is_one_result_and_another_is_another():
    world = scene(frames=5)
    first, again, other = (run(world, jitter=0.4, phantoms=0.5, seed=seed) for seed in (0, 0, 1))
    for (a, _), (b, _) in zip(first, again, strict=True):
        assert a.keypoints.tobytes() == b.keypoints.tobytes()
        assert a.boxes.tobytes() == b.boxes.tobytes()
    assert any(a.keypoints.tobytes() != c.keypoints.tobytes() for (a, _), (c, _) in zip(first, other, strict=True))


def test_the_order_of_detections_does_not_give_the_people_away():
    orders = {tuple(truth.person[detections.view == 0].tolist()) for detections, truth in run(scene())}
    assert orders == {(0, 1), (1, 0)}
    for detections, _ in run(scene(), phantoms=1.0):
        assert (np.diff(detections.view) >= 0).all()


def test_boxes_stay_on_the_image_and_scores_in_range():
    for detections, _ in run(scene(), box_jitter=0.5, jitter=1.0, phantoms=1.0):
        assert (detections.boxes[:, 2:] >= 0).all()
        assert ((detections.scores >= 0) & (detections.scores <= 1)).all()


def test_surer_scores_mean_smaller_errors():
    world = scene(frames=100)
    frames = run(world, jitter=1.0)
    error = np.linalg.norm(by_person(frames, 3, 2) - world[1].pixels, axis=-1) / np.array(COCO17.sigmas)
    scores = np.empty(error.shape)
    for t, (detections, truth) in enumerate(frames):
        scores[t, detections.view, truth.person] = detections.scores
    assert np.corrcoef(scores.ravel(), error.ravel())[0, 1] < -0.3


def test_nobody_and_phantoms_only():
    frames = run(scene(people=0), phantoms=2.0)
    assert all((truth.person == -1).all() and truth.joints.shape == (0, 17, 3) for _, truth in frames)
    assert sum(len(detections) for detections, _ in frames) > 100


class TestDelivery:
    """A detector works on the pictures that arrive."""

    @staticmethod
    def late(source):
        sequence, views, rig = scene(frames=6, views=2)
        return sequence, replace(views, source=np.array(source)), rig

    def test_a_repeated_picture_gives_the_same_detections(self):
        source = [[0, 0], [0, 1], [2, 2], [2, 3], [2, 4], [5, 5]]
        dials = {"jitter": 0.5, "phantoms": 1.5, "miss_visible": 0.2, "miss_person": 0.3, "box_jitter": 0.1}
        frozen, live = run(self.late(source), **dials), run(scene(frames=6, views=2), **dials)
        for t, row in enumerate(source):
            for v, frame in enumerate(row):
                (got, told), (expected, true) = frozen[t], live[frame]
                mine, theirs = got.view == v, expected.view == v
                np.testing.assert_array_equal(got.keypoints[mine], expected.keypoints[theirs])
                np.testing.assert_array_equal(got.boxes[mine], expected.boxes[theirs])
                np.testing.assert_array_equal(told.person[mine], true.person[theirs])
                np.testing.assert_array_equal(told.error[mine], true.error[theirs])
        assert any((got.view == 0).any() for got, _ in frozen)

    def test_nothing_is_found_in_a_picture_that_never_arrives(self):
        source = [[0, -1], [-1, 1], [-1, -1], [3, 3], [4, -1], [5, -1]]
        found = run(self.late(source), phantoms=3.0)
        for (detections, _), row in zip(found, source, strict=True):
            assert set(detections.view.tolist()) == {v for v, frame in enumerate(row) if frame >= 0}
