"""Shrinking: nothing that is left can be left out, numbers are round, and the frame fails as it did."""

from functools import partial

import pytest
from crowded_frames import crowd
from hypothesis import given
from hypothesis import strategies as st

from mvpose import preset
from simharness.hunt.frozen_frame import freeze
from simharness.hunt.properties import Violation
from simharness.hunt.shrinking import LEAST_CAMERAS, Judge, fresh_noise, minimal, shrink


@given(st.integers(0, 60), st.sets(st.integers(0, 59)))
def test_what_fails_by_some_items_together_is_these_items(count, needed):
    needed = {each for each in needed if each < count}
    assert set(minimal(range(count), lambda some: needed <= set(some))) == needed


@given(st.integers(1, 30), st.integers(2, 7), st.randoms(use_true_random=False))
def test_no_item_can_be_left_out_of_what_fails_in_any_way(count, classes, random):
    of = [random.randrange(classes) for _ in range(count)]

    def fails(some):  # one item of each class: many minimal sets
        return {of[each] for each in some} == set(of)

    left = minimal(range(count), fails)
    assert fails(left)
    assert not any(fails(left[:k] + left[k + 1 :]) for k in range(len(left)))


@pytest.fixture(scope="module")
def judge():
    return Judge(preset("full"))


def failing_frames(judge):
    recording, found = crowd(), {}
    for k in range(len(recording)):
        frame = freeze(recording.rig, recording.detections[k], recording.truth[k])
        for each in judge.violations(frame, ("merged", "ghost", "missed", "swapped_limb")):
            found.setdefault(each.property, (frame, each))
    return found


@pytest.mark.slow
def test_shrunk_frames_are_minimal_and_fail_as_before(judge):
    found = failing_frames(judge)
    assert len(found) >= 2
    for frame, violation in found.values():
        fails = partial(judge.fails, violation)
        small = shrink(frame, fails)
        assert fails(small)
        assert shrink(frame, fails) == small == shrink(small, fails)
        assert len(small.errors) < 0.1 * len(frame.errors)
        for error in small.errors:
            assert not fails(small.with_errors(each for each in small.errors if each != error))
        for person in small.people:
            assert not fails(small.of(people=[each for each in small.people if each != person]))
        assert len(small.cameras) == LEAST_CAMERAS or not any(
            fails(small.of(cameras=[each for each in small.cameras if each != camera])) for camera in small.cameras
        )
        assert all(round(value, 3) == value for person in small.people for joint in person.joints for value in joint)
        assert {error.model_dump()["kind"] for error in small.errors} <= {error.kind for error in frame.errors}


def test_a_frame_that_does_not_fail(judge):
    recording = crowd()
    frame = freeze(recording.rig, recording.detections[0], recording.truth[0]).with_errors(())
    with pytest.raises(ValueError, match="does not"):
        shrink(frame, partial(judge.fails, Violation("ghost", -1, "")))


def test_fresh_noise_counts_the_seeds_at_which_a_frame_fails():
    recording = crowd()
    frame = freeze(recording.rig, recording.detections[0], recording.truth[0]).with_errors(())
    seen = []

    def fails(noisy):
        seen.append(noisy)
        return len(seen) % 4 == 0

    assert fresh_noise(frame, fails, seeds=8) == 2
    offsets = [[each.offset for each in noisy.errors] for noisy in seen]
    assert len({str(each) for each in offsets}) == 8
    assert 1.8 < (sum(x * x for x, _ in offsets[0]) / len(offsets[0])) ** 0.5 < 2.2
