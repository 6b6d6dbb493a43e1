"""Causes of a lost score: what mending one changes and what it leaves, shares that add up, and a single cause."""

import json

import numpy as np
import pytest

from simharness.scenario.load import load
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.statistics.intervals import Interval
from simharness.study.causes.blame_text import conclusion, heading, points
from simharness.study.causes.cause_catalogue import CAUSES, MendedTrial, causes_by_name, present_causes
from simharness.study.causes.cause_shares import EXACT, Blame, blame, difference_interval
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility

SMALL = (
    "people.count=3",
    "people.area=1.2",
    "duration=0.3",
    "cameras.count=3",
    'rendering.renderer="rays"',
    'detector.profile="poor"',
    "detector.boxes.duplicates=0",
)


@pytest.fixture(scope="module")
def trial():
    """A trial with most causes."""
    return MendedTrial(load("quickstart", overrides=SMALL), "fast")


def keypoints(detected):
    """Return the keypoints of people by frame, view and person: only first detections, of any order."""
    return {
        (frame, int(view), int(person)): row
        for frame, each in enumerate(detected.frames)
        for view, person, row in zip(each.detections.view, each.truth.person, each.detections.keypoints, strict=True)
        if person >= 0
    }


def classes(detected):
    return np.concatenate([each.truth.error.ravel() for each in detected.frames])


def test_mending_swaps_moves_swapped_joints_only(trial):
    before, after = keypoints(trial.detected(())), keypoints(trial.detected(causes_by_name(["swaps"])))
    moved = same = 0
    errors = {
        (frame, int(view), int(person)): row
        for frame, each in enumerate(trial.detected(()).frames)
        for view, person, row in zip(each.detections.view, each.truth.person, each.truth.error, strict=True)
    }
    for key in before.keys() & after.keys():
        changed = ~np.isclose(before[key], after[key], equal_nan=True).all(axis=-1)
        moved += changed.sum()
        same += (~changed).sum()
        confused = np.isin(errors[key], [KeypointError.INVERSION, KeypointError.SWAP])
        near = errors[key] <= KeypointError.JITTER  # an inversion of joints that nearly coincide leads nowhere
        assert (confused | near)[changed].all()
        assert not (near & ~confused)[changed].sum() > 3
    assert moved
    assert same > 20 * moved
    assert not np.isin(classes(trial.detected(causes_by_name(["swaps"]))), [KeypointError.INVERSION]).any()


def test_mending_phantoms_leaves_the_detections_of_people(trial):
    before, after = trial.detected(()), trial.detected(causes_by_name(["phantoms"]))
    assert any((each.truth.person < 0).any() for each in before.frames)
    assert not any((each.truth.person < 0).any() for each in after.frames)
    one, other = keypoints(before), keypoints(after)
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[key], other[key], equal_nan=True) for key in one)


def test_with_all_errors_mended_keypoints_are_the_true_pixels(trial):
    detector = ["dropped-joints", "gross-errors", "swaps", "noise", "bias", "boxes", "phantoms", "scores"]
    for each in trial.detected(causes_by_name(detector)).frames:
        rows = each.truth.pixels[each.detections.view, each.truth.person]
        inside = each.truth.visibility[each.detections.view, each.truth.person] != Visibility.OUTSIDE
        assert np.array_equal(np.isfinite(each.detections.keypoints).all(axis=-1), inside)
        np.testing.assert_allclose(each.detections.keypoints[inside], rows[inside], atol=1e-9)
    assert trial.worth([*detector, "hidden-by-people", "hidden-by-things", "matching"]) == 100


def test_one_more_camera_leaves_the_others(trial):
    before, after = keypoints(trial.detected(())), keypoints(trial.detected(causes_by_name(["one-more-camera"])))
    old = {key: row for key, row in after.items() if key[1] < 3}
    assert len(after) > len(old)
    assert old.keys() == before.keys()
    assert all(np.array_equal(before[key], old[key], equal_nan=True) for key in old)


def test_revealed_people_keep_their_true_visibility(trial):
    before, after = trial.detected(()), trial.detected(causes_by_name(["hidden-by-people", "hidden-by-things"]))
    for one, other in zip(before.frames, after.frames, strict=True):
        assert np.array_equal(one.truth.visibility, other.truth.visibility)
    missing = [(classes(each) == KeypointError.ABSENT).mean() for each in (before, after)]
    assert missing[1] < missing[0]


def test_a_perfect_scenario_has_few_causes():
    scenario = load("quickstart", overrides=['detector.profile="perfect"'])
    assert [cause.name for cause in present_causes(scenario, labelled=False)] == [
        "hidden-by-people",
        "hidden-by-things",
        "one-more-camera",
    ]


@pytest.mark.parametrize(
    ("key", "cause"),
    [
        ("detector.keypoints.drop.visible=0.5", "dropped-joints"),
        ("detector.keypoints.miss=0.5", "gross-errors"),
        ("detector.keypoints.guess.occluded=0.5", "gross-errors"),
        ("detector.keypoints.inversion=0.5", "swaps"),
        ("detector.keypoints.scatter=0.5", "noise"),
        ("detector.bias.hips=[0.0, 0.05, 0.0]", "bias"),
        ("detector.boxes.missed=0.5", "boxes"),
        ("detector.phantoms.rate=0.5", "phantoms"),
        ("detector.decoys.share=0.5", "phantoms"),
        ("detector.scores.overconfident=0.5", "scores"),
        ("faults.rotation=0.5", "calibration"),
        ("faults.clock_offset=0.1", "clocks"),
        ('cameras.trigger="free"', "clocks"),
        ("faults.dropped=0.5", "lost-pictures"),
        ("cameras.every=[1, 2]", "lost-pictures"),
    ],
)
def test_every_error_of_a_scenario_has_its_cause(key, cause):
    scenario = load("quickstart", overrides=['detector.profile="perfect"', key])
    changes = [each.name for each in CAUSES if each.change(scenario) != scenario]
    assert changes == [cause]
    mended = causes_by_name([cause])[0].change(scenario)
    perfect = load("quickstart", overrides=['detector.profile="perfect"'])
    for section in (*DetectorSection.model_fields.keys() - {"name"},):
        assert getattr(mended.detector, section) == getattr(perfect.detector, section)
    assert (mended.faults, mended.cameras) == (perfect.faults, perfect.cameras)


def test_a_single_cause_takes_the_whole_loss():
    """With perfect detections of one person, a wrong calibration loses all that is lost; without it nothing is."""
    overrides = (
        *SMALL[:5], 'detector.profile="perfect"', "people.count=1", "faults.rotation=3.0", "clutter.boxes=0",
        "clutter.shelves=0",
    )  # fmt: skip
    scenario = load("quickstart", overrides=overrides)
    found = blame(scenario, variant="full", seeds=2, causes=["calibration", "matching", "phantoms"])
    shares = {each.cause: each for each in found.shares}
    assert found.before.mean < 90
    assert found.after.mean == 100
    assert found.rest.mean == 0
    assert shares["calibration"].share.mean == pytest.approx(100 - found.before.mean)
    assert shares["calibration"].share.mean == pytest.approx(shares["calibration"].alone.mean)
    assert shares["matching"].share.mean == 0
    assert found.absent == ("phantoms",)
    assert found.mending.causes == ("calibration",)
    assert found.mending.restored == 1


@pytest.mark.slow
def test_shares_add_up_to_the_loss_and_are_paired():
    scenario = load("quickstart", overrides=SMALL)
    found = blame(scenario, variant="fast", seeds=1)
    assert len(found.shares) > EXACT  # shares come from random orders
    assert sum(each.share.mean for each in found.shares) == pytest.approx(found.after.mean - found.before.mean)
    assert found.after.mean + found.rest.mean == pytest.approx(100)
    assert [each.share.mean for each in found.shares] == sorted(
        (each.share.mean for each in found.shares), reverse=True
    )
    data = json.loads(json.dumps(found.json(), allow_nan=False))
    assert Blame.of_json(data).json() == data
    mending = found.mending
    assert mending.gain.mean == pytest.approx(mending.restored * (found.after.mean - found.before.mean))
    assert mending.score.mean == pytest.approx(found.before.mean + mending.gain.mean)
    assert {*mending.causes} <= {each.cause for each in found.shares[:4]}
    assert heading(found).startswith("PCP ")
    assert mending.about[0].title in conclusion(found)
    again = blame(scenario, variant="fast", seeds=1, causes=["swaps", "phantoms"])
    assert again.before.mean == found.before.mean  # the same draws
    alone = {each.cause: each.alone.mean for each in found.shares}
    assert {each.cause: each.alone.mean for each in again.shares}.items() <= alone.items()


def test_intervals_of_differences_stay_within_what_a_score_allows():
    assert difference_interval(np.array([10.0, 30.0]), "%").high == 100
    assert difference_interval(np.array([10.0, 30.0]), "mm").high > 100


def test_numbers_as_text():
    assert points(Interval(2.54, -1.37, 6.87, 4)) == "2.5 (−1.4 to 6.9)"
    assert points(Interval(2.54, np.nan, np.nan, 1)) == "2.5"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"score": "beauty"}, "score 'beauty': no such score"),
        ({"variant": "slow"}, "unknown"),
        ({"causes": ["luck"]}, "causes: luck: no such cause; expected some of dropped-joints"),
        ({"causes": ["calibration"]}, "causes: quickstart has none of calibration"),
        ({"seeds": []}, "blame needs one seed or more"),
    ],
)
def test_wrong_requests(options, message):
    with pytest.raises(ValueError, match=message):
        blame(load("quickstart"), **options)


@pytest.mark.parametrize(
    ("key", "cause"),
    [
        pytest.param("faults.clock_offset=0.1", "clocks", marks=pytest.mark.slow),
        pytest.param("faults.rotation_drift=60.0", "calibration", marks=pytest.mark.slow),
        ("faults.dropped=0.3", "lost-pictures"),
    ],
)
def test_a_mended_fault_gives_the_trial_without_the_fault(key, cause):
    """Pictures are taken again where a fault of the rig changes them; nothing else changes."""
    small = (*SMALL, "people.count=2", "duration=0.2")
    faulty = MendedTrial(load("quickstart", overrides=[*small, key]), "fast")
    plain = MendedTrial(load("quickstart", overrides=small), "fast").detected(())
    before, mended = faulty.detected(()), faulty.detected(causes_by_name([cause]))
    pixels = [np.stack([each.truth.pixels for each in detected.frames]) for detected in (before, mended, plain)]
    assert not np.array_equal(pixels[0], pixels[2], equal_nan=True)
    assert np.array_equal(pixels[1], pixels[2], equal_nan=True)
    one, other = keypoints(mended), keypoints(plain)
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[key], other[key], equal_nan=True) for key in one)
    assert all(np.array_equal(a.P, b.P) for a, b in zip(mended.rig, plain.rig, strict=True))
