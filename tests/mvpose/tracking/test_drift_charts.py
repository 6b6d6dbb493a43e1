"""Charts of cameras: cumulative sums of log-likelihood ratios against Page's closed form, and cameras in turn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import crowd, ring

from mvpose.tracking.drift_charts import INTERVAL, STRAY, Charts, DriftTest, _close_batch, _count_people, update_charts
from mvpose.tracking.picture_shift import TERMS, ExpectedPeople
from mvpose.tracking.pose_update import MatchedRays

SMALLEST, FLOOR, INFLATION = np.array([0.02, 0.02, 0.05, 0.05]), np.array([0.01, 0.01, 0.02, 0.02]), 4.0
WEIGHT, PRIOR = 1e4, 0.05  # of a batch's keypoints, and of shifts before anything is seen
LEARNED = 60.0
ALL_STRAY, STRAY_VARIANCE = 0.6, 0.09


def charts_of(cameras: int = 1, *, learned: bool = True) -> Charts:
    """Return charts of cameras that have been looked at for a minute, or never."""
    charts = Charts.empty(cameras)
    if learned:
        charts.batches[:] = LEARNED
    return charts


def close(charts: Charts, shift=(0.0, 0.0, 0.0, 0.0), *, now: float, view=0, keypoints=100, people=(3, 0), most=1e9):
    """Close a batch of a camera whose pictures show a shift and some people, found and stray."""
    charts.keypoints[view], charts.people[view] = keypoints, people
    # The weight of the prior is added to that of the keypoints.
    charts.normal[view, :, :TERMS] = WEIGHT * np.eye(TERMS)
    charts.normal[view, :, TERMS] = (WEIGHT + PRIOR**-2) * np.array(shift)
    _close_batch(charts, view, now, DriftTest(SMALLEST, FLOOR, INFLATION, most))


def variances() -> np.ndarray:
    """Return the variances of the numbers of a batch beside the mean of a minute."""
    return (INFLATION / (WEIGHT + PRIOR**-2) + FLOOR**2) * (1 + 1 / LEARNED)


@given(st.integers(0, 1000))
def test_each_sum_is_the_greatest_evidence_for_a_shift_since_any_time(seed):
    """Page: the sum is the maximum of all sums of the latest ratios; its onset is where the greatest one begins."""
    rng = np.random.default_rng(seed)
    shifts = SMALLEST * rng.uniform(-1.0, 1.4, (12, TERMS))
    charts = charts_of()
    charts.start[0] = 0.0
    for second, shift in enumerate(shifts, 1):
        close(charts, shift, now=float(second))
    for side, sign in enumerate((1.0, -1.0)):
        ratio = SMALLEST * (sign * shifts - 0.5 * SMALLEST) / variances()
        latest = np.cumsum(ratio[::-1], axis=0)  # over the latest 1, 2, ... batches
        np.testing.assert_allclose(charts.sums[0, :TERMS, side], np.maximum(latest.max(axis=0), 0.0), rtol=1e-9)
        began = 12.0 - 1.0 - latest.argmax(axis=0)
        rising = latest.max(axis=0) > 0.0
        np.testing.assert_array_equal(charts.onset[0, :TERMS, side][rising], began[rising])
    assert not charts.sums[0, STRAY].any()
    assert charts.batches[0] == LEARNED
    assert not charts.reference.any()


def test_the_mean_deviation_forgets_a_third_in_a_batch():
    charts, shift = charts_of(), 0.3 * SMALLEST
    for second in range(1, 6):
        close(charts, shift, now=float(second))
        np.testing.assert_allclose(charts.deviation[0, :TERMS], shift * (1 - 0.7**second))


@pytest.mark.parametrize("keypoints", [0, 39])
def test_stray_people_count_in_batches_with_few_keypoints(keypoints):
    charts = charts_of()
    for second in range(1, 5):
        close(charts, 5 * SMALLEST, now=float(second), keypoints=keypoints, people=(1, 4))
    ratio = ALL_STRAY * (0.8 - 0.5 * ALL_STRAY) / (STRAY_VARIANCE * (1 + 1 / LEARNED))
    np.testing.assert_allclose(charts.sums[0, STRAY], [4 * ratio, 0.0])
    assert not charts.sums[0, :TERMS].any()  # too few to tell a shift
    assert not charts.deviation[0, :TERMS].any()


def test_the_first_batches_are_learned_and_tested_from_the_sixth_on():
    rng = np.random.default_rng(0)
    charts, shifts = charts_of(learned=False), SMALLEST * rng.uniform(-0.1, 0.1, (8, TERMS))
    shifts[2] = 3 * SMALLEST  # as of a camera that shook: no test yet
    for second, shift in enumerate(shifts[:5], 1):
        close(charts, shift, now=float(second))
    assert charts.batches[0] == 5.0
    assert not charts.sums.any()
    np.testing.assert_allclose(charts.reference[0, :TERMS], shifts[:5].mean(axis=0))
    mean = charts.reference[0].copy()
    close(charts, mean[:TERMS] + 2 * SMALLEST, now=6.0)
    ratio = SMALLEST * 1.5 * SMALLEST / (INFLATION / (WEIGHT + PRIOR**-2) + FLOOR**2) / (1 + 1 / 5)
    np.testing.assert_allclose(charts.sums[0, :TERMS, 0], ratio)
    assert charts.batches[0] == 5.0  # what raises a sum is not learned
    np.testing.assert_array_equal(charts.reference[0], mean)


def test_no_batch_counts_more_than_a_third_of_an_alarm_and_stray_people_a_thirtieth():
    charts = charts_of()
    for second in range(1, 3):
        close(charts, 50 * SMALLEST, now=float(second), people=(0, 3), most=9.0)
    np.testing.assert_allclose(charts.sums[0, :TERMS, 0], 6.0)
    np.testing.assert_allclose(charts.sums[0, STRAY, 0], 2 * 9.0 / 30.0)
    assert np.isnan(charts.alarm[0])
    close(charts, 50 * SMALLEST, now=3.0, most=9.0)
    assert charts.alarm[0] == 3.0
    assert not charts.sums.any()


@pytest.mark.parametrize("far", [1.0, 3.0, 10.0])
def test_a_camera_that_was_put_back_is_cleared_after_ten_calm_batches(far):
    charts = charts_of()
    charts.start[0] = 0.0
    second = 0
    while np.isnan(charts.alarm[0]):
        second += 1
        close(charts, (far * SMALLEST[0], 0.0, 0.0, 0.0), now=float(second), most=5.0)
    assert charts.since[0] == 0.0
    apart = charts.deviation[0, 0] / SMALLEST[0]
    calm_from = int(np.ceil(np.log(3 * apart) / np.log(1 / 0.7)))  # the first batch whose mean deviation is small
    batches = 0
    while not np.isnan(charts.alarm[0]):
        batches += 1
        close(charts, now=float(second + batches), most=5.0)
    assert batches == calm_from + 9
    assert np.isnan(charts.since[0])
    assert charts.batches[0] == LEARNED


def test_the_camera_that_has_moved_furthest_is_blamed_and_the_others_start_anew():
    charts, now = charts_of(3), 0.0
    charts.start[:] = 0.0
    while np.isnan(charts.alarm).all():
        now += 1.0
        for view, far in ((2, 0.0), (0, 1.0), (1, 2.5)):
            if np.isnan(charts.alarm).all():
                close(charts, (far * SMALLEST[0], 0.0, 0.0, 0.0), now=now, view=view, most=8.0)
    np.testing.assert_array_equal(np.isnan(charts.alarm), [True, False, True])
    assert (charts.since[1], charts.alarm[1]) == (0.0, now)
    assert not charts.sums.any()


def test_a_camera_that_is_blamed_is_trusted_again_after_ten_batches_at_the_earliest():
    charts = charts_of()
    charts.deviation[0, :2], charts.calm[0] = 0.3 * SMALLEST[:2], 9.0  # calm, while the sum is still high
    charts.sums[0, 0, 0], charts.onset[0, 0, 0] = 6.0, 0.0
    close(charts, (0.3 * SMALLEST[0], 0.0, 0.0, 0.0), now=1.0, most=5.0)
    batches = 0
    while not np.isnan(charts.alarm[0]):
        batches += 1
        close(charts, now=1.0 + batches, most=5.0)
    assert batches == 10


def look(charts: Charts, now: float, since: float, *, pictures=None, found: int = 0) -> bool:
    """Look at cameras that all see the same people, and no keypoint of them."""
    count = len(charts.alarm)
    labels, view = np.tile(np.arange(found), count), np.repeat(np.arange(count), found)
    m = len(view)
    rays = MatchedRays(labels, view, np.zeros((m, 3)), np.zeros((m, 1, 3)), np.zeros((m, 1)), np.zeros(m), np.zeros(m))
    people = ExpectedPeople(np.arange(found), np.ones(found, bool), np.zeros((found, 1, 6)))
    seen = np.ones(count, bool) if pictures is None else np.array(pictures)
    cameras, sizes = np.zeros((count, 22)), np.ones((count, 2))
    test = DriftTest(SMALLEST, FLOOR, INFLATION, 1e9)
    return update_charts(charts, now, since, seen, people, rays, np.array([0.02]), cameras, sizes, test)


def test_cameras_have_their_turn_one_after_the_other():
    charts, order = charts_of(4), []
    for k in range(12):
        assert look(charts, INTERVAL / 4 * k, INTERVAL / 4)
        order.append(int(np.argmax(charts.looked)))
    assert order == [0, 1, 2, 3] * 3
    assert look(charts, 100.0, 5.0)  # after a long time all of them
    np.testing.assert_array_equal(charts.looked, 100.0)


def test_a_camera_without_a_picture_has_no_turn_and_no_camera_two_turns_at_a_time():
    charts = charts_of(3)
    assert not look(charts, 1.0, 1.0, pictures=[False, False, False])
    assert look(charts, 1.0, 1.0, pictures=[False, True, False])
    np.testing.assert_array_equal(charts.looked, [-np.inf, 1.0, -np.inf])
    assert not look(charts, 1.0 + INTERVAL / 3, INTERVAL, pictures=[False, True, False])


@pytest.mark.parametrize("found", [4, 5])
def test_a_batch_is_full_with_five_people_after_a_second(found):
    charts = charts_of(3)
    look(charts, 0.0, 1.0, found=found)
    assert (charts.start == 0.0).all()
    np.testing.assert_array_equal(charts.people, [[found, 0]] * 3)
    charts.people[:] = 0.0  # only people of the second look count
    look(charts, 1.0, 1.0, found=found)
    assert (charts.start == (1.0 if found == 5 else 0.0)).all()
    np.testing.assert_array_equal(charts.people, [[0 if found == 5 else found, 0]] * 3)
    look(charts, 1.9, 1.0, found=5)  # less than a second after the latest batch
    assert (charts.start == (1.0 if found == 5 else 1.9)).all()


def counted(labels, view, *, groups=(0, 1), reported=(True, True), away=()) -> list[float]:
    """Return the found and stray people in the picture of camera 0 of four, which sees all but some."""
    rig = ring(4)
    people = crowd(len(groups))
    people[list(away)] += [0.0, 0.0, 50.0]
    m, counts = len(labels), np.zeros(2)
    rays = MatchedRays(
        np.array(labels), np.array(view), np.zeros((m, 3)), np.zeros((m, 17, 3)), np.ones((m, 17)), np.zeros(m),
        np.zeros(m),
    )  # fmt: skip
    state = np.concatenate([people, np.zeros_like(people)], axis=2)
    expected = ExpectedPeople(np.array(groups), np.array(reported), state)
    _count_people(counts, 0, expected, rays, rig.packed[0], np.array([1280.0, 960.0]))
    return counts.tolist()


@pytest.mark.parametrize(
    ("labels", "view", "expected"),
    [
        ([0, 0, 0, 1, 1, 1], [0, 1, 2, 0, 1, 2], [2, 0]),  # both are found
        ([0, 0, 1, 1], [1, 2, 1, 2], [0, 0]),  # this picture has no detection, as of a camera that is covered
        ([0, 0, 0, 1, 1], [0, 1, 2, 1, 2], [1, 0]),  # its only detection is the other person's
        ([0, 0, 0, 1, 1, -1], [0, 1, 2, 1, 2, 0], [1, 1]),  # one is beside its place
        ([0, 0, 1, 1, -1, -1, -1], [1, 2, 1, 2, 0, 0, 0], [0, 2]),
        ([0, 0, 1, 1, -1], [1, 2, 1, 2, 0], [0, 1]),  # one detection is nobody's: one is hidden
        ([0, 0, 1, 1, -1, -1], [1, 2, 1, 2, 3, 3], [0, 0]),  # another camera's phantoms
        ([0, 0, 1, 1, 2], [1, 2, 1, 2, 0], [0, 1]),  # a group of this picture alone
        ([0, 1, -1, -1], [1, 2, 0, 0], [0, 0]),  # one other camera is no evidence of a person
        ([0, 0, 1], [0, 1, 0], [0, 0]),
    ],
)
def test_people_whom_others_see_are_stray_where_detections_are_nobodys(labels, view, expected):
    assert counted(labels, view) == expected


def test_people_outside_of_the_picture_or_not_yet_reported_are_not_stray():
    labels, view = [0, 0, 1, 1, -1, -1], [1, 2, 1, 2, 0, 0]
    assert counted(labels, view) == [0, 2]
    assert counted(labels, view, away=[1]) == [0, 1]
    assert counted(labels, view, reported=(True, False)) == [0, 1]
    assert counted(labels, view, groups=(0, -1)) == [0, 1]
    assert counted([0, 0, 0, -1], [0, 1, 2, 0], groups=(0,), reported=(False,)) == [0, 0]
