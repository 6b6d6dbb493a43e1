"""Power of a validation in a small form: twins of people on a floor, right ones and wrong ones."""

from dataclasses import replace

import numpy as np
import pytest
from turning_people import walkers

from benchmarks.validation.power import Power, distance_from, measured
from benchmarks.validation.wrong_twins import SIZES, WRONG, turned
from simharness.reality.twin import TwinModel
from simharness.reality.validation.whole_comparison import compare_whole
from simharness.scenario.presets import read_profile

TWINS = 6


def filmed(seeds, *, noise=4.0, change=lambda recording, seed: recording):
    """Recordings of a frame each second, without a detector: noise alone."""
    recordings = [replace(walkers(frames=16, cameras=4, noise=noise, seed=seed), rate=1.0) for seed in seeds]
    return measured([change(*each) for each in zip(recordings, seeds, strict=True)], every=1)


@pytest.fixture(scope="module")
def power():
    (real,) = filmed([100])
    return Power(real, filmed(range(TWINS)), filmed(range(200, 206)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrong",
    [{"noise": 2.0}, {"noise": 8.0}, {"change": turned(0.25).recording}],
    ids=["scatter x 0.5", "scatter x 2", "calibration turned"],
)
def test_wrong_twins_are_noticed(power, wrong):
    found = power.noticed(filmed(range(TWINS), **wrong))
    assert found.share >= 5 / 6
    assert found.p_value <= 0.05
    assert found.ratio > 2.0


@pytest.mark.slow
def test_right_twins_are_not(power):
    found = power.noticed(filmed(range(300, 300 + TWINS)))
    assert found.share <= 2 / 6
    assert found.p_value > 0.01
    assert found.fails == 0


@pytest.mark.slow
def test_distances_from_some_twins_are_those_of_their_own_comparison(power):
    figures = compare_whole(power.real, [*power.right, *power.others]).figures
    alone = compare_whole(power.real, power.right).distance
    assert distance_from(figures, range(TWINS)).value == pytest.approx(alone.value)
    assert distance_from(figures, range(TWINS)).p_value == pytest.approx(alone.p_value)
    other = distance_from(figures, range(TWINS), recording=TWINS)
    assert other.value != pytest.approx(alone.value, rel=1e-3)


def test_each_wrong_twin_changes_what_its_name_says():
    detector = read_profile("typical")
    model = TwinModel(None, None, detector, None)
    scatter = {name: WRONG[name].model(model).detector for name in ("scatter × 0.5", "scatter × 2")}
    for factor, changed in zip((0.5, 2.0), scatter.values(), strict=True):
        assert changed.keypoints.scatter.elbows == pytest.approx(factor * detector.keypoints.scatter.elbows)
        assert changed.keypoints.miss == detector.keypoints.miss
    gross = WRONG["gross errors × 2"].model(model).detector.keypoints
    assert gross.inversion.knees == pytest.approx(min(1.0, 2 * detector.keypoints.inversion.knees))
    memory = WRONG["no correlation in time"].model(model).detector
    assert (memory.correlation.life, memory.correlation.scatter_life, memory.boxes.life) == (0.0, 0.0, 0.0)
    missed = WRONG["nobody missed"].model(model).detector.boxes
    assert missed.missed == max(missed.missed_hidden) == 0.0
    assert set(SIZES).isdisjoint(WRONG)


def test_exchanged_cameras_have_the_detections_of_each_other():
    twin = walkers(frames=2, cameras=3)
    exchanged = WRONG["two cameras exchanged"].recording(twin, 0)
    np.testing.assert_array_equal(exchanged.rig.P, twin.rig.P)
    one, other = exchanged.detections[0], twin.detections[0]
    np.testing.assert_array_equal(one.keypoints[one.view == 0], other.keypoints[other.view == 2])
    np.testing.assert_array_equal(exchanged.truth, twin.truth)
