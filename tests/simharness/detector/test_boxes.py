from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.stats import binom

from mvpose import COCO17, Camera, Detections, Rig
from mvpose.duplicates import Duplicates
from simharness.detector.boxes import DUPLICATE_SCATTER, DUPLICATE_SCORE, UPPER_BODY, apply_box_errors
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import LIMB_OF_JOINT, KeyedDraws
from simharness.detector.viewing_conditions import BOX_SHARE, overlaps
from simharness.scenario.sections.detector_section import BoxesSection
from simharness.types.truth import KeypointError
from simharness.types.views import Views, Visibility

IMAGE = (1600, 700)
SIZE = np.array([120.0, 300.0])
STEP = 0.04  # s
ALL = {
    "missed": 0.2, "missed_views": 0.5, "merged": 0.4, "split": 0.3, "duplicates": 0.4, "jitter": 0.08, "score": 0.9,
    "deviation": 0.5,
}  # fmt: skip


def crowd(frames=400, views=3, people=2, *, apart=200.0):
    """People side by side, ``apart`` pixels between neighbours, with a new pose in every frame."""
    shape = (frames, views, people)
    rig = Rig([Camera(np.diag([800.0, 800, 1]), np.eye(3), [0.5 * v, 0, 5], size=IMAGE) for v in range(views)])
    pixels, boxes = np.empty((*shape, 17, 2)), np.empty((*shape, 4))
    for v in range(views):
        for p in range(people):
            place, pose = (np.random.default_rng([v, p, k]) for k in range(2))
            corner = np.array([100 + apart * p, 150]) + place.uniform(0, 20, (frames, 2))
            pixels[:, v, p] = corner[:, None] + (0.05 + 0.9 * pose.random((frames, 17, 2))) * SIZE
            boxes[:, v, p] = np.hstack([corner, np.broadcast_to(SIZE, (frames, 2))])
    source = np.broadcast_to(np.arange(frames)[:, None], (frames, views))
    seen = np.full((*shape, 17), Visibility.VISIBLE)
    truth = Views(pixels, seen, boxes, np.zeros(shape, int), source)
    found = replace(
        DetectionBlock.empty(frames, views, people),
        present=np.ones(shape, bool),
        keypoints=pixels.copy(),
        scores=np.full((*shape, 17), 0.9),
        person=np.broadcast_to(np.arange(people), shape),
        error=np.full((*shape, 17), KeypointError.GOOD, np.int8),
    )
    return found, truth, rig


def find(world, *, seed=5, **parameters):
    people, views, rig = world
    draws = KeyedDraws(seed, STEP * np.arange(len(views)), len(rig))
    return apply_box_errors(people, views, rig, BoxesSection(**parameters), draws)


def within(events, trials, probability):
    low, high = binom.interval(1 - 1e-6, trials, probability)
    return low <= events <= high


def outcome(found, people):
    """Return who is detected, split, duplicated, and the owner of a merged detection, (T, V, P) each."""
    first, second = found.present[:, :, :people], np.zeros_like(found.present[:, :, :people])
    if found.present.shape[2] > people:
        second = found.present[:, :, people:]
    absent = (found.error[:, :, :people] == KeypointError.ABSENT).any(axis=-1)
    swap = (found.error[:, :, :people] == KeypointError.SWAP).any(axis=-1)
    return first, first & second & absent, first & second & ~absent, first & swap


def equal(a, b, where=...):
    for field in fields(DetectionBlock):
        np.testing.assert_array_equal(getattr(a, field.name)[where], getattr(b, field.name)[where], field.name)


def same(part, whole, where):
    """Check that the detections of some pictures or slots are those of the whole block in these places."""
    np.testing.assert_array_equal(part.present, whole.present[where])
    assert part.present.any()
    for field in fields(DetectionBlock):
        values, expected = getattr(part, field.name)[part.present], getattr(whole, field.name)[where][part.present]
        np.testing.assert_allclose(values, expected, rtol=1e-9, err_msg=field.name)


class TestNoErrors:
    def test_zero_parameters_change_nothing(self):
        people, views, rig = crowd(apart=20.0)
        views.visibility.flags.writeable = True
        views.visibility[..., :5] = Visibility.SELF_OCCLUDED
        found = find((people, views, rig), life=0.5)
        share = np.full(people.present.shape, 12 / 17)
        equal(found, replace(people, boxes=views.boxes, box_scores=share))

    def test_the_score_of_a_whole_visible_person(self):
        np.testing.assert_allclose(find(crowd(20), score=0.8).box_scores, 0.8)
        scores = find(crowd(), score=0.8, deviation=0.5).box_scores
        logit = np.log(scores / (1 - scores))
        np.testing.assert_allclose([logit.mean(), logit.std()], [np.log(4), 0.5], atol=0.05)  # 2400 draws

    def test_the_input_is_not_changed(self):
        world, again = crowd(apart=20.0), crowd(apart=20.0)
        find(world, **ALL)
        equal(world[0], again[0])

    def test_without_people_there_are_no_detections(self):
        assert find(crowd(people=0), **ALL).present.shape == (400, 3, 0)


class TestMissed:
    @pytest.mark.parametrize("hidden", [0, 6, 17])
    def test_hidden_people_are_missed_more_often(self, hidden):
        people, views, rig = crowd(2000)
        seen = views.visibility.copy()
        seen[..., :hidden] = Visibility.OCCLUDED_BY_PERSON
        shares = [0.05, 0.1, 0.2, 0.4, 0.8]
        share = 1 - 0.9 * (1 - np.interp(hidden / 17, [0, 0.25, 0.5, 0.75, 1], shares))
        world = people, replace(views, visibility=seen), rig
        present = find(world, missed=0.1, missed_hidden=shares).present
        assert within((~present).sum(), present.size, share)
        fewer = find(world, missed=0.1).present
        assert (fewer >= present).all()  # people who are missed stay missed

    def test_self_occluded_joints_do_not_hide_a_person(self):
        people, views, rig = crowd(20)
        world = people, replace(views, visibility=np.full_like(views.visibility, Visibility.SELF_OCCLUDED)), rig
        assert find(world, missed_hidden=[0.0, 1.0, 1.0, 1.0, 1.0]).present.all()

    def test_people_are_missed_at_the_configured_rate(self):
        present = find(crowd(2000), missed=0.15).present
        assert within((~present).sum(), present.size, 0.15)
        assert not find(crowd(20), missed=1.0).present.any()

    def test_misses_may_be_shared_by_all_views(self):
        alike = find(crowd(2000), missed=0.3, missed_views=1.0).present
        assert (alike == alike[:, :1]).all()
        assert within((~alike[:, 0]).sum(), alike[:, 0].size, 0.3)
        some, none = (find(crowd(2000), missed=0.3, missed_views=share).present for share in (0.5, 0.0))
        both = [np.mean(~each[:, 0] & ~each[:, 1]) for each in (some, none)]
        assert both[0] > 0.13  # 0.157 by the bivariate normal distribution; 0.09 if independent
        assert within(round(both[1] * 4000), 4000, 0.09)

    def test_people_with_too_few_visible_joints_are_not_detected(self):
        people, views, rig = crowd(50)
        views.visibility.flags.writeable = True
        views.visibility[:, :, 0, :13] = Visibility.OCCLUDED_BY_CLUTTER
        for least, found in ((4, True), (5, False)):
            present = find((people, views, rig), least_visible=least).present
            assert (present[..., 0] == found).all()
            assert present[..., 1].all()
        people.present[:, 1, 1] = False
        present = find((people, views, rig)).present
        assert not present[:, 1, 1].any()
        assert present[:, [0, 2], 1].all()

    @pytest.mark.parametrize("life", [0.1, 0.6])
    def test_misses_last(self, life):
        """A state ends with probability 1 - exp(-step / life) and is drawn as a miss again with 0.3: geometric runs."""
        missed = ~find(crowd(20_000, 2, 2), missed=0.3, life=life).present
        assert missed.mean() == pytest.approx(0.3, abs=0.03)
        ends = missed[:-1] & ~missed[1:]
        mean = missed[:-1].sum() / ends.sum() * STEP
        assert mean == pytest.approx(STEP / (-np.expm1(-STEP / life) * 0.7), rel=0.12)


class TestBoxes:
    def test_the_noise_of_sides_has_the_configured_deviation(self):
        world = crowd(2000)
        found = find(world, jitter=0.07)
        sides = [np.concatenate([b[..., :2], b[..., :2] + b[..., 2:]], axis=-1) for b in (found.boxes, world[1].boxes)]
        noise = (sides[0] - sides[1]) / np.tile(SIZE, 2)
        np.testing.assert_allclose(noise.std(axis=(0, 1, 2)), 0.07, rtol=0.03)  # 12000 draws: 0.6 % a deviation
        np.testing.assert_allclose(noise.mean(axis=(0, 1, 2)), 0, atol=0.004)
        correlation = np.corrcoef(noise.reshape(len(noise), -1).T)  # of views, people and sides
        np.testing.assert_allclose(correlation, np.eye(3 * 2 * 4), atol=0.12)

    def test_boxes_are_in_the_image_and_never_empty(self):
        people, views, rig = crowd(500, people=4, apart=440.0)  # the last one at the right border
        views.boxes.flags.writeable = True
        views.boxes[:, :, 0, 0] = -0.5
        views.boxes[:, :, 1, 1] = IMAGE[1] - 0.5 - SIZE[1]
        found = find((people, views, rig), **{**ALL, "jitter": 0.5, "missed": 0.0})
        boxes = found.boxes[found.present]
        low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
        assert (low >= -0.5).all()
        assert (high <= np.array(IMAGE) - 0.5 + 1e-9).all()
        assert (boxes[:, 2:] > 0).all()
        assert (np.isclose(low[:, 0], -0.5)).sum() > 100
        assert (np.isclose(high[:, 1], IMAGE[1] - 0.5)).sum() > 100


class TestDuplicates:
    def test_people_are_duplicated_at_the_configured_rate(self):
        world = crowd(1500)
        found = find(world, duplicates=0.1)
        first, split, twice, merged = outcome(found, 2)
        assert first.all()
        assert within(twice.sum(), twice.size, 0.1)
        assert not split.any()
        assert not merged.any()
        again = np.s_[:, :, 2:]
        assert (found.person[again] == np.arange(2)).all()
        assert (found.error[again][twice] == KeypointError.GOOD).all()
        np.testing.assert_allclose(found.scores[again][twice], DUPLICATE_SCORE * 0.9)
        np.testing.assert_allclose(found.box_scores[again][twice], DUPLICATE_SCORE)
        unit = np.sqrt(BOX_SHARE * SIZE.prod()) * np.array(COCO17.sigmas)[:, None]
        off = (found.keypoints[again][twice] - world[1].pixels[twice]) / unit
        np.testing.assert_allclose(off.std(axis=0), DUPLICATE_SCATTER, rtol=0.15)  # 900 draws

    def test_the_method_recognises_duplicates(self):
        found = find(crowd(100), duplicates=0.5, jitter=0.05)
        kept = total = 0
        for frame in range(100):
            view, slot = np.nonzero(found.present[frame])
            row = (frame, view, slot)
            once = Duplicates()(
                Detections(view, found.keypoints[row], found.scores[row], found.boxes[row], found.box_scores[row])
            )
            assert (slot[once] < 2).all()
            kept, total = kept + once.sum(), total + len(once)
        assert (kept, within(total - kept, 600, 0.5)) == (600, True)

    def test_duplicates_have_separate_boxes(self):
        found = find(crowd(300), duplicates=0.5, jitter=0.05)
        both = found.present[:, :, 2:]
        noise = [found.boxes[:, :, s][both] for s in (slice(0, 2), slice(2, 4))]
        size = noise[0][:, 2:] / SIZE, noise[1][:, 2:] / SIZE
        assert abs(np.corrcoef(size[0][:, 0], size[1][:, 0])[0, 1]) < 0.2

    def test_duplicates_stay_in_the_image(self):
        people, views, rig = crowd(200)
        people.keypoints[..., 0] = IMAGE[0] - 0.6
        found = find((people, views, rig), duplicates=1.0)
        assert all(camera.inside(found.keypoints[:, v]).all() for v, camera in enumerate(rig))
        assert (found.keypoints[:, :, 2:, :, 0] < IMAGE[0] - 0.6).any()


class TestSplit:
    def test_two_halves_make_the_whole(self):
        world = crowd(1500)
        found = find(world, split=0.1)
        first, split, twice, merged = outcome(found, 2)
        assert within(split.sum(), split.size, 0.1)
        assert first.all()
        assert not (twice | merged).any()
        upper, lower = found.keypoints[:, :, :2][split], found.keypoints[:, :, 2:][split]
        assert np.isfinite(upper[:, UPPER_BODY]).all()
        assert np.isnan(upper[:, ~UPPER_BODY]).all()
        np.testing.assert_array_equal(np.where(np.isnan(upper), lower, upper), world[1].pixels[split])
        for half, joints in ((np.s_[:, :, :2], UPPER_BODY), (np.s_[:, :, 2:], ~UPPER_BODY)):
            assert ((found.scores[half][split] > 0) == joints).all()
            assert ((found.error[half][split] == KeypointError.ABSENT) == ~joints).all()
            assert (found.person[half] == np.arange(2)).all()
            np.testing.assert_allclose(found.box_scores[half][split], joints.mean())
        np.testing.assert_array_equal(found.boxes[:, :, :2][~split], world[1].boxes[~split])

    def test_each_half_has_the_box_of_its_joints(self):
        people, views, rig = crowd(200)
        standing = np.linspace(0.1, 0.4, 11), np.linspace(0.5, 0.95, 6)
        people.keypoints[..., 1] = 200 + SIZE[1] * np.concatenate(standing)
        views = replace(views, pixels=people.keypoints)
        views.boxes.flags.writeable = True
        views.boxes[..., 1] = 200
        found = find((people, views, rig), split=1.0)
        sides = np.concatenate([found.boxes[..., :2], found.boxes[..., :2] + found.boxes[..., 2:]], axis=-1)
        upper, lower = sides[:, :, :2], sides[:, :, 2:]
        whole = np.concatenate([np.minimum(upper, lower)[..., :2], np.maximum(upper, lower)[..., 2:]], axis=-1)
        expected = np.concatenate([views.boxes[..., :2], views.boxes[..., :2] + views.boxes[..., 2:]], axis=-1)
        np.testing.assert_allclose(whole, expected)
        # 10 % of the box is above the nose, 5 % below the ankles: the boxes of the halves have the same margins.
        np.testing.assert_allclose(upper[..., [1, 3]], np.broadcast_to([200, 200 + 0.45 * 300], (200, 3, 2, 2)))
        np.testing.assert_allclose(lower[..., [1, 3]], np.broadcast_to([200 + 0.40 * 300, 500], (200, 3, 2, 2)))
        for half, joints in ((upper, UPPER_BODY), (lower, ~UPPER_BODY)):
            points = views.pixels[..., joints, :]
            assert (points >= half[..., None, :2]).all()
            assert (points <= half[..., None, 2:]).all()

    def test_a_half_without_joints_is_not_detected(self):
        people, views, rig = crowd(50)
        for values, nothing in ((people.keypoints, np.nan), (people.scores, 0.0), (people.error, KeypointError.ABSENT)):
            values[:, :, :, ~UPPER_BODY] = nothing
        pixels = np.where((LIMB_OF_JOINT == 2)[:, None], np.nan, views.pixels)  # behind the camera
        found = find((people, replace(views, pixels=pixels), rig), split=1.0)
        assert found.present[:, :, :2].all()
        assert not found.present[:, :, 2:].any()
        assert np.isfinite(found.boxes).all()


class TestMerged:
    def test_overlapping_pairs_merge_at_the_configured_rate(self):
        world = crowd(1500, apart=25.0)
        near = overlaps(world[1].boxes)[..., 0, 1] > 0.6
        assert 0.1 < near.mean() < 0.9
        found = find(world, merged=0.3, merged_overlap=0.6)
        one = found.present.sum(axis=-1) == 1
        assert within(one.sum(), near.sum(), 0.3)
        assert not one[~near].any()
        assert (found.present.any(axis=-1)).all()
        assert find(crowd(apart=200.0), merged=1.0).present.all()

    def test_each_limb_is_of_one_of_the_two_people(self):
        world = crowd(1500, apart=5.0)
        world[0].error[:, :, 1, 3] = KeypointError.JITTER
        found = find(world, merged=0.4)
        merged = found.present.sum(axis=-1) == 1
        slot = found.present[merged].argmax(axis=-1)
        row = np.arange(len(slot))
        owner, other = (world[1].pixels[merged][row, each] for each in (slot, 1 - slot))
        keypoints, error = found.keypoints[merged][row, slot], found.error[merged][row, slot]
        kept = (keypoints == owner).all(axis=-1)
        assert (kept ^ (keypoints == other).all(axis=-1)).all()
        assert ((error == KeypointError.SWAP) == ~kept).all()
        np.testing.assert_array_equal(error[kept], world[0].error[merged][row, slot][kept])
        assert (kept.sum(axis=-1) > 17 / 2).all()
        np.testing.assert_array_equal(found.rivals[merged][row, slot], np.where(kept[..., None], other, owner))
        for limb in range(3):
            joints = kept[:, limb == LIMB_OF_JOINT]
            assert (joints == joints[:, :1]).all()
            firsts = joints[:, 0] == (slot == 0)  # of the first of the pair
            assert within(firsts.sum(), len(firsts), 0.5)
        # Limbs are independent: all of one person in a quarter of all cases.
        assert within(kept.all(axis=-1).sum(), len(kept), 0.25)
        assert (found.person[merged][row, slot] == slot).all()

    def test_the_box_contains_both(self):
        people, views, rig = crowd(300, apart=30.0)
        found = find((people, views, rig), merged=1.0, merged_overlap=0.4, jitter=0.05, score=0.9)
        alone = find((people, views, rig), jitter=0.05, score=0.9)
        merged = found.present.sum(axis=-1) == 1
        assert merged.sum() > 100
        slot = found.present[merged].argmax(axis=-1)
        boxes, both = found.boxes[merged][np.arange(len(slot)), slot], alone.boxes[merged]
        low, high = both[..., :2].min(axis=1), (both[..., :2] + both[..., 2:]).max(axis=1)
        np.testing.assert_allclose(boxes, np.hstack([low, high - low]))
        equal(found, alone, ~merged)

    def test_no_person_merges_twice_and_a_higher_rate_only_adds(self):
        world = crowd(600, people=5, apart=4.0)
        few, many = (find(world, merged=share, merged_overlap=0.3) for share in (0.15, 0.6))
        lost = []
        for found in (few, many):
            taken = ~found.present
            owner = (found.keypoints != world[1].pixels).any(axis=(-1, -2)) & found.present
            assert (taken.sum(axis=-1) <= 2).all()  # of five, at most two pairs
            assert (owner.sum(axis=-1) <= taken.sum(axis=-1)).all()
            lost.append(taken)
        assert (lost[0] <= lost[1]).all()
        assert 0 < lost[0].sum() < 0.6 * lost[1].sum()
        everyone = find(world, merged=1.0, merged_overlap=0.3)
        assert (everyone.present.sum(axis=-1) == 3).mean() > 0.95  # 5 people, all near: two pairs and one

    def test_mergers_last(self):
        found = find(crowd(4000, 2, apart=2.0), merged=0.5, life=0.4)
        one = found.present.sum(axis=-1) == 1
        assert one.mean() == pytest.approx(0.5, abs=0.08)
        ends = one[:-1] & ~one[1:]
        assert one[:-1].sum() / ends.sum() * STEP == pytest.approx(STEP / (-np.expm1(-STEP / 0.4) * 0.5), rel=0.15)


class TestParameters:
    def test_each_rate_is_of_the_people_left(self):
        world = crowd(2000, people=3, apart=10.0)
        parameters = {"missed": 0.2, "merged": 0.3, "split": 0.25, "duplicates": 0.4}
        found = find(world, **parameters)
        present = find(world, missed=0.2).present
        paired = find(world, missed=0.2, merged=0.3)
        left = present & paired.present & (paired.error != KeypointError.SWAP).all(axis=-1)
        whole = (paired.keypoints == world[1].pixels).all(axis=(-1, -2)) & np.isnan(paired.rivals).all(axis=(-1, -2))
        left &= whole
        _, split, twice, _ = outcome(found, 3)
        assert within((~present).sum(), present.size, 0.2)
        assert not (split | twice)[~left].any()
        assert within(split.sum(), left.sum(), 0.25)
        assert within(twice.sum(), (left & ~split).sum(), 0.4)
        assert (np.where(np.isin(found.scores, [0, 0.9]), 0, 1)[:, :, 3:].any(axis=-1) == twice)[split | twice].all()

    @pytest.mark.parametrize("parameter", ["missed", "split", "duplicates"])
    def test_a_higher_rate_only_adds(self, parameter):
        low, high = (find(crowd(), life=0.1, **{parameter: share}) for share in (0.1, 0.4))
        events = [~each.present[:, :, :2] if parameter == "missed" else each.present[:, :, 2:] for each in (low, high)]
        assert (events[0] <= events[1]).all()
        assert 0 < events[0].sum() < events[1].sum()

    @pytest.mark.parametrize(
        ("parameter", "value"),
        [("missed", 0.6), ("merged", 0.9), ("split", 0.8), ("duplicates", 0.9), ("jitter", 0.0), ("deviation", 0.0)],
    )
    def test_a_parameter_changes_no_other_draw(self, parameter, value):
        """People with the same errors before and after have the same values, except those of the parameter."""
        world = crowd(300, people=3, apart=15.0)
        before, after = find(world, life=0.2, **ALL), find(world, life=0.2, **{**ALL, parameter: value})
        same = before.present & after.present & (before.error == after.error).all(axis=-1)
        same &= (before.scores == after.scores).all(axis=-1)
        with_same = np.isclose(before.rivals, after.rivals, atol=0, rtol=0, equal_nan=True)
        same &= with_same.all(axis=(-1, -2))
        assert same[:, :, :3].sum() > 150
        assert same[:, :, 3:].sum() > 30
        np.testing.assert_array_equal(before.keypoints[same], after.keypoints[same])
        single = same & np.isnan(before.rivals).all(axis=(-1, -2))
        for name, noise in (("boxes", "jitter"), ("box_scores", "deviation")):
            a, b = getattr(before, name)[single], getattr(after, name)[single]
            assert (a == b).all() == (parameter != noise)
        kept = find(world, life=0.2, missed=0.2, missed_views=0.5).present
        if parameter != "missed":
            assert not (after.present[:, :, :3] & ~kept).any()

    def test_more_frames_or_views_change_no_other_detection(self):
        parameters = {**ALL, "life": 0.2}
        whole = find(crowd(200, 3, 2, apart=20.0), **parameters)
        for frames, views in ((150, 3), (200, 2)):
            same(find(crowd(frames, views, 2, apart=20.0), **parameters), whole, np.s_[:frames, :views])

    def test_more_people_change_no_other_detection(self):
        parameters = {**ALL, "life": 0.2}
        few, many = (find(crowd(200, 3, people), **parameters) for people in (2, 3))
        same(few, many, np.s_[:, :, [0, 1, 3, 4]])
        assert few.present[:, :, 2:].any()
