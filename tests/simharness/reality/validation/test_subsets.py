"""Subsets of cameras."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from turning_people import walkers

from simharness.reality.validation.evidence import Evidence
from simharness.reality.validation.passes import CameraSubset, Unchanged, annotated, run_passes
from simharness.reality.validation.variant_comparison import camera_subsets, compare_subsets, subset_curve
from simharness.scoring.frame_scores import RULES


def test_five_cameras_have_26_subsets():
    subsets = camera_subsets(5)
    assert len(subsets) == 26 == len(set(subsets))
    assert set(subsets) == {each for k in range(2, 6) for each in itertools.combinations(range(5), k)}


def test_subsets_of_many_cameras_are_sampled():
    subsets = camera_subsets(12, most=40)
    for count in range(2, 13):
        of = [each for each in subsets if len(each) == count]
        assert len(of) == len(set(of)) == min(40, math.comb(12, count))
        assert all(list(each) == sorted(set(each)) and max(each) < 12 for each in of)
    assert subsets == camera_subsets(12, most=40)


@pytest.fixture(scope="module")
def passes():
    changes = [Unchanged(), *map(CameraSubset, camera_subsets(4))]
    recordings = [walkers(frames=4), walkers(frames=4, noise=25.0, seed=1), walkers(frames=4, noise=25.0, seed=2)]
    return recordings, run_passes(recordings, changes, variants=("full", "fast"))


def test_exact_detections_give_exact_people_with_every_subset(passes):
    for of_variant in passes[1][0].values():
        for tally in of_variant.values():
            assert tally.total().pcp() == 100.0
            assert tally.total().mpjpe() < 1.0
            assert tally.total().ghosts() == 0.0


def test_the_curve_is_the_mean_over_subsets(passes):
    sums = {change: {name: each.total() for name, each in of.items()} for change, of in passes[1][1].items()}
    curve = subset_curve(sums, "fast", rule=RULES[1])
    for count in (2, 3, 4):
        expected = [
            sums[CameraSubset(views)]["fast"].pcp(RULES[1]) for views in itertools.combinations(range(4), count)
        ]
        assert curve[count] == pytest.approx(np.mean(expected))
    assert curve[2] < 100.0


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_workers():
    recordings, changes = [walkers(frames=3, noise=4.0)], [Unchanged(), *map(CameraSubset, camera_subsets(3))]
    alone, shared = (run_passes(recordings, changes, variants=("fast",), workers=workers)[0] for workers in (1, 2))
    assert list(alone) == list(shared)
    for change in alone:
        np.testing.assert_array_equal(alone[change]["fast"].correct, shared[change]["fast"].correct)
        np.testing.assert_array_equal(alone[change]["fast"].error, shared[change]["fast"].error)


def test_a_recording_is_its_own_best_twin(passes):
    recordings, results = passes
    own = compare_subsets(Evidence.of_tallies(recordings[1], results[1], [results[1]]), 4, ("full", "fast"))
    assert all(figure.difference == 0 for curve in own.curves.values() for figure in curve.values())
    assert all(gain.difference == 0 for gain in own.gains.values())
    assert own.ranks["fast"].mean == pytest.approx(1.0)
    other = compare_subsets(Evidence.of_tallies(recordings[0], results[0], results[1:]), 4, ("full", "fast"))
    assert other.curves[2]["fast"].difference < 0
    assert other.sampled == ()


def test_only_annotated_frames_are_scored():
    recording = walkers(frames=6)
    truth = recording.truth.copy()
    truth[[0, 3]] = np.nan
    rest = annotated(replace(recording, truth=truth))
    assert rest.frames.tolist() == [1, 2, 4, 5]
    assert annotated(replace(recording, truth=truth), every=3).frames.tolist() == [1, 5]
