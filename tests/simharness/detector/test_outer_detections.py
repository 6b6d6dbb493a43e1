"""Simulated detections of feet and hands: they follow ankles and wrists."""

import numpy as np
import pytest
from worlds import world

from mvpose.wholebody import skeleton_by_name
from simharness.detector.detect import detect
from simharness.detector.viewing_conditions import BOX_SHARE
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.outer_joints import OuterTruth, OuterViews
from simharness.types.truth import KeypointError
from simharness.types.views import Views, Visibility

SKELETON = skeleton_by_name("halpe26")
OUTER = SKELETON.joints[17:]
FEET = [k for k, name in enumerate(OUTER) if "toe" in name or "heel" in name]
ANKLE = [15 if OUTER[k].startswith("left") else 16 for k in FEET]


def outer_of(where, visibility=Visibility.VISIBLE):
    """Return feet near the ankles of everybody in a world."""
    away = np.random.default_rng(5).uniform(5, 25, (*where.views.pixels.shape[:3], len(OUTER), 2))
    pixels = where.views.pixels[:, :, :, [15] * len(OUTER)] + away
    pixels[:, :, :, FEET] = where.views.pixels[:, :, :, ANKLE] + away[:, :, :, FEET]
    frames, _, people = pixels.shape[:3]
    joints = np.random.default_rng(6).random((frames, people, len(OUTER), 3))
    return OuterTruth(SKELETON, joints, OuterViews(pixels, np.full(pixels.shape[:4], visibility, np.int8)))


def found(where, outer, **detector):
    """Return keypoints (T, V, P, 26, 2) and scores of everybody; NaN where not detected."""
    detected = detect(
        where.sequence, where.views, where.rig, DetectorSection.model_validate(detector), seed=2, outer=outer
    )
    keypoints = np.full((*where.views.pixels.shape[:3], 26, 2), np.nan)
    scores = np.zeros(keypoints.shape[:-1])
    for frame, each in enumerate(detected):
        rows = frame, each.whole.detections.view, each.truth.person
        keypoints[rows], scores[rows] = each.whole.detections.keypoints, each.whole.detections.scores
    return keypoints, scores, detected


def test_a_perfect_detector_reports_the_true_pixels_and_the_body_unchanged():
    where = world(frames=5)
    outer = outer_of(where)
    keypoints, scores, detected = found(where, outer)
    np.testing.assert_allclose(keypoints[..., 17:, :], outer.views.pixels, atol=1e-9)
    assert (scores == 1).all()
    for frame in detected:
        np.testing.assert_array_equal(frame.whole.detections.keypoints[:, :17], frame.detections.keypoints)
        np.testing.assert_array_equal(frame.whole.joints[:, :17], frame.truth.joints)


def test_nothing_of_the_body_depends_on_feet():
    where = world(frames=20, together=True)
    config = DetectorSection.model_validate(
        {
            "keypoints": {"scatter": 0.3, "miss": 0.1, "swap": 0.2, "drop": {"visible": 0.1}},
            "boxes": {"merged": 0.3, "split": 0.1, "duplicates": 0.1},
            "phantoms": {"rate": 1.0},
        }
    )
    arguments = where.sequence, where.views, where.rig, config
    with_feet = detect(*arguments, seed=4, outer=outer_of(where))
    for one, other in zip(detect(*arguments, seed=4), with_feet, strict=True):
        for key in ("view", "keypoints", "scores", "boxes", "box_scores"):
            np.testing.assert_array_equal(getattr(one.detections, key), getattr(other.detections, key))
        assert one.whole is None
        assert np.isnan(other.whole.detections.keypoints[other.truth.person < 0, 17:]).all()  # phantoms have no feet


def test_a_foot_is_reported_only_with_its_ankle_and_not_outside_the_picture():
    where = world(frames=40)
    keypoints, scores, _ = found(where, outer_of(where), keypoints={"drop": {"visible": {"ankles": 0.4}}})
    ankles = np.isfinite(keypoints[..., ANKLE, 0])
    feet = np.isfinite(keypoints[..., 17:, 0])[..., FEET]
    assert not (feet & ~ankles).any()
    assert feet.sum() / ankles.sum() == pytest.approx(0.6, abs=0.05)  # of those with an ankle
    assert ((scores > 0) == np.isfinite(keypoints[..., 0])).all()
    hidden, _, _ = found(where, outer_of(where, Visibility.OUTSIDE))
    assert np.isnan(hidden[..., 17:, :]).all()


def test_an_inverted_ankle_has_the_feet_of_the_other_side():
    where = world(frames=10)
    outer = outer_of(where)
    keypoints, _, detected = found(where, outer, keypoints={"inversion": {"ankles": 1.0}})
    other = {"left": "right", "right": "left"}
    counterpart = [OUTER.index(f"{other[side]}_{part}") for side, part in (OUTER[k].split("_", 1) for k in FEET)]
    feet, theirs = keypoints[..., 17:, :][..., FEET, :], outer.views.pixels[..., counterpart, :]
    for t, frame in enumerate(detected):
        inverted = frame.truth.error[:, ANKLE] == KeypointError.INVERSION  # not where both ankles are too near
        rows = frame.detections.view, frame.truth.person
        assert inverted.any()
        np.testing.assert_allclose(feet[t][rows][inverted], theirs[t][rows][inverted])


def test_a_missed_ankle_takes_its_foot_along():
    where = world(frames=10)
    outer = outer_of(where)
    keypoints, _, _ = found(where, outer, keypoints={"miss": {"ankles": 1.0}})
    moved = keypoints[..., ANKLE, :] - where.views.pixels[..., ANKLE, :]
    assert np.linalg.norm(moved, axis=-1).min() > 10
    np.testing.assert_allclose(keypoints[..., 17:, :][..., FEET, :] - outer.views.pixels[..., FEET, :], moved)


def test_swapped_ankles_have_the_feet_of_the_other_person():
    where = world(frames=10, together=True)
    outer = outer_of(where)
    keypoints, _, detected = found(where, outer, keypoints={"swap": {"ankles": 1.0}})
    feet = keypoints[..., 17:, :][..., FEET, :]
    theirs = outer.views.pixels[:, :, ::-1][..., FEET, :]
    for t, frame in enumerate(detected):
        swapped = frame.truth.error[:, ANKLE] == KeypointError.SWAP
        rows = frame.detections.view, frame.truth.person
        assert swapped.any()
        np.testing.assert_allclose(feet[t][rows][swapped], theirs[t][rows][swapped])


def test_scatter_is_that_of_the_ankle_in_units_of_the_foot():
    where = world(frames=400, views=2, people=1)
    outer = outer_of(where)
    keypoints, _, _ = found(where, outer, keypoints={"scatter": {"ankles": 0.25}})
    unit = np.sqrt(BOX_SHARE * where.views.boxes[..., 2] * where.views.boxes[..., 3])[..., None]
    for k in FEET:
        away = (keypoints[..., 17 + k, :] - outer.views.pixels[..., k, :]) / (unit * SKELETON.sigmas[17 + k])
        assert np.std(away) == pytest.approx(0.25, rel=0.07)  # 1.14 truncates it hardly


def test_a_repeated_picture_repeats_its_feet():
    where = world(frames=6)
    source = np.array(where.views.source)
    source[3, 1] = 2
    fields = {key: np.array(getattr(where.views, key)) for key in ("pixels", "visibility", "boxes", "area_visible")}
    outer = outer_of(where)
    pixels = np.array(outer.views.pixels)
    for array in (*fields.values(), pixels):
        array[3, 1] = array[2, 1]
    late = type(where)(where.sequence, Views(**fields, source=source), where.rig)
    truth = OuterTruth(SKELETON, outer.joints, OuterViews(pixels, outer.views.visibility))
    keypoints, _, _ = found(late, truth, keypoints={"scatter": 0.3})
    np.testing.assert_array_equal(keypoints[3, 1], keypoints[2, 1])
    assert not np.array_equal(keypoints[3, 0], keypoints[2, 0])
