"""Starts of cameras seconds apart: found, independent of what files count from, and refused where nothing tells."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import ring

from mvpose import Detections
from mvpose.calibration.starts import against_chance, find_starts

RIG = ring(4)
PERIOD = 0.08
STARTS = np.array([0, 25, -31, 12])  # frames
JOINTS = walk(2, frames=210, period=PERIOD, seed=4)


def apart(frames, starts, *, length=140, first=35):
    """Frames of cameras that begin so many frames after one of them; all count from 0."""
    result = []
    for k in range(length):
        parts = [
            frames[first + start + k].select(frames[first + start + k].view == v) for v, start in enumerate(starts)
        ]
        columns = [np.concatenate([getattr(each, key) for each in parts]) for key in ("view", "keypoints", "scores")]
        result.append(replace(Detections.from_keypoints(*columns), time=np.full(len(starts), k * PERIOD)))
    return result


@pytest.fixture(scope="module")
def frames():
    return apart(film(RIG, JOINTS)[0], STARTS)


@pytest.fixture(scope="module")
def found(frames):
    return find_starts(RIG, frames)


def test_starts_are_found_within_a_frame(found):
    np.testing.assert_allclose(found, PERIOD * STARTS, atol=PERIOD / 2)


def test_a_clock_that_is_set_anew_moves_its_start_alone(found, frames):
    again = find_starts(RIG, [replace(each, time=each.time + [0.0, 0.0, 4.0, 0.0]) for each in frames])
    np.testing.assert_allclose(again - found, [0.0, 0.0, -4.0, 0.0], atol=1e-9)


def test_cameras_that_are_off_by_half_a_degree_change_nothing(frames):
    moved = find_starts(disturbed(RIG, 0.5, 0.02, seed=1), frames)
    np.testing.assert_allclose(moved, PERIOD * STARTS, atol=PERIOD)


def test_lost_pictures_cost_a_frame_at_most(frames):
    lost = [each.select(each.view != k % 7) for k, each in enumerate(frames)]
    times = [np.where(np.arange(4) == k % 7, np.nan, each.time) for k, each in enumerate(frames)]
    some = [replace(each, time=time) for each, time in zip(lost, times, strict=True)]
    np.testing.assert_allclose(find_starts(RIG, some), PERIOD * STARTS, atol=1.01 * PERIOD)


def test_people_who_stand_still_are_refused():
    still = apart(film(RIG, walk(2, frames=210, period=PERIOD, still=True))[0], STARTS)
    with pytest.raises(ValueError, match="cannot tell when camera"):
        find_starts(RIG, still)


def test_people_who_do_the_same_again_are_refused():
    again = np.concatenate([JOINTS[:60]] * 4)
    with pytest.raises(ValueError, match="or always alike"):
        find_starts(RIG, apart(film(RIG, again)[0], STARTS))


def test_a_share_that_all_shifts_have_is_no_evidence():
    most = np.full((100, 5), 200.0)
    alike, windows, short = against_chance(0.97 * most, most)
    assert (alike <= 0.0).all()
    np.testing.assert_array_equal(windows, 5)
    np.testing.assert_allclose(short, 5 * 0.03 * 200.0)
    share = np.where(np.arange(100)[:, None] == 40, 0.97, 0.35)
    evidence = against_chance(share * most, most)[0]
    assert evidence[40] > 10.0
    assert np.delete(evidence, 40).max() < 0.0


@pytest.mark.parametrize("other", [3, 0])
def test_a_camera_that_films_other_people_is_refused(frames, other):
    strangers = apart(film(RIG, walk(2, frames=210, period=PERIOD, seed=11, radius=0.5))[0], STARTS)
    mixed = []
    for a, b in zip(frames, strangers, strict=True):
        parts = a.select(a.view != other), b.select(b.view == other)
        columns = (np.concatenate([getattr(each, key) for each in parts]) for key in ("view", "keypoints", "scores"))
        mixed.append(Detections.from_keypoints(*columns))
    with pytest.raises(ValueError, match=f"camera \\S*{other} began"):
        find_starts(RIG, mixed, period=PERIOD)


def test_a_camera_that_sees_nobody_is_named(frames):
    with pytest.raises(ValueError, match=r"camera .*2 began .* sees nobody"):
        find_starts(RIG, [each.select(each.view != 2) for each in frames])
