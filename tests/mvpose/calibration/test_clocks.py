"""Clocks from people who walk: offsets, lost and repeated pictures, and what cannot be known."""

import numpy as np
import pytest
from moving_people import disturbed, walk
from people import ring

from mvpose import COCO17, Detections
from mvpose.calibration.clocks import estimate_clocks
from mvpose.calibration.picture_order import repeated_pictures
from mvpose.calibration.sightings import Sightings

RIG = ring(4)
PERIOD, FINE = 0.04, 0.005  # s: of frames, and of the true motion
FRAMES, MARGIN = 200, 140  # frames; steps of the true motion before the first frame
OFFSETS = np.array([0.060, -0.085, 0.015, 0.010])  # s


@pytest.fixture(scope="module")
def motion():
    return walk(2, frames=2 * MARGIN + round(FRAMES * PERIOD / FINE), period=FINE)


def steps_of(offsets):
    """Steps of the true motion at which pictures are taken, (F, V)."""
    frames = np.arange(FRAMES)[:, None] * round(PERIOD / FINE)
    return MARGIN + frames + np.round(np.asarray(offsets) / FINE).astype(int)


def seen(motion, steps, *, noise=3.0, missing=0.1, seed=0):
    """Sightings of the pictures taken at steps (F, V) of the motion, as if they were all taken in time."""
    rng = np.random.default_rng(seed)
    frame, view, person, joint = (
        index.ravel() for index in np.indices((FRAMES, len(RIG), motion.shape[1], len(COCO17)))
    )
    pixels = np.stack([RIG[v].project(motion[steps[:, v]]) for v in range(len(RIG))], axis=1).reshape(-1, 2)
    pixels = pixels + noise * rng.standard_normal(pixels.shape)
    kept = rng.random(len(frame)) >= missing
    times = np.tile(PERIOD * np.arange(FRAMES)[:, None], (1, len(RIG)))
    columns = (each[kept] for each in (frame, view, person, joint, pixels))
    return Sightings(*columns, np.full(kept.sum(), noise), times, COCO17)


def test_offsets_are_found_to_milliseconds_with_a_rig_that_is_off(motion):
    rig = disturbed(RIG, 0.5, 0.02, seed=1)
    clocks = estimate_clocks(rig, seen(motion, steps_of(OFFSETS)))
    truth = OFFSETS - OFFSETS[list(clocks.reference)].mean()
    assert clocks.determined.all()
    assert not clocks.steps
    np.testing.assert_allclose(clocks.offsets, truth, atol=0.003)
    assert np.diff(clocks.interval, axis=1).max() < 0.012


def test_half_a_second_is_found(motion):
    clocks = estimate_clocks(RIG, seen(motion, steps_of([0.0, 0.0, 0.5, 0.0]), missing=0.0))
    np.testing.assert_allclose(clocks.offsets, [0.0, 0.0, 0.5, 0.0], atol=0.004)
    assert clocks.reference == (0, 1, 3)
    (finding,) = (each for each in clocks.findings() if each.severity == "alarm")
    assert (finding.kind, finding.camera) == ("clock-offset", RIG[2].name)
    low, high = finding.interval["ms"]
    assert low < 500.0 < high


def test_synchronised_cameras_raise_no_alarm(motion):
    clocks = estimate_clocks(RIG, seen(motion, steps_of(np.zeros(4))))
    np.testing.assert_allclose(clocks.offsets, 0.0, atol=0.003)
    assert not [each for each in clocks.findings() if each.severity != "note"]


def test_people_who_stand_still_tell_nothing():
    motion = walk(2, frames=2 * MARGIN + round(FRAMES * PERIOD / FINE), period=FINE, still=True)
    clocks = estimate_clocks(RIG, seen(motion, steps_of(OFFSETS)))
    assert not clocks.determined.any()
    assert (clocks.offsets == 0.0).all()
    assert {each.severity for each in clocks.findings()} == {"unknown"}


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 3])
def test_lost_pictures_are_found_where_they_were_lost(motion, lost):
    steps = steps_of(np.zeros(4))
    steps[120:, 2] += lost * round(PERIOD / FINE)
    clocks = estimate_clocks(RIG, seen(motion, steps))
    (step,) = clocks.steps
    assert (step.view, step.frames) == (2, lost)
    assert abs(step.frame - 120) <= 8
    truth = PERIOD / 8 * (steps - MARGIN)
    assert np.abs(clocks.times - truth)[np.abs(np.arange(FRAMES) - 120) > 8].max() < 0.004
    assert "dropped-pictures" in {each.kind for each in clocks.findings()}
    assert np.diff(clocks.times[:, 2]).argmax() + 1 == step.frame  # the first frame behind it has its true time already


def test_a_long_recording_is_judged_by_its_busiest_part(motion, monkeypatch):
    steps = steps_of(OFFSETS)
    steps[120:, 2] += round(PERIOD / FINE)
    whole = seen(motion, steps)
    quiet = whole.select(whole.frame >= 60)
    monkeypatch.setattr("mvpose.calibration.clocks._MOST_FRAMES", 140)
    clocks = estimate_clocks(RIG, quiet)
    (step,) = clocks.steps
    assert abs(step.frame - 120) <= 8
    truth = PERIOD / 8 * (steps - MARGIN)
    away = (clocks.times - truth)[np.abs(np.arange(FRAMES) - 120) > 8]
    assert np.ptp(away) < 0.008  # all clocks may be off by the same


def test_repeated_pictures_are_those_that_show_the_same(motion):
    sightings = seen(motion, steps_of(np.zeros(4)))
    repeats = np.zeros((FRAMES, 4), bool)
    repeats[[20, 21, 90, 150], [1, 1, 3, 0]] = True
    for frame, view in np.argwhere(repeats):
        sightings = repeat(sightings, frame, view)
    np.testing.assert_array_equal(repeated_pictures(sightings), repeats)
    clocks = estimate_clocks(RIG, sightings)
    assert clocks.times[21, 1] == clocks.times[19, 1]
    sizes = {each.camera: each.size["pictures"] for each in clocks.findings() if each.kind == "repeated-pictures"}
    assert sizes == {RIG[0].name: 1, RIG[1].name: 2, RIG[3].name: 1}


def repeat(sightings, frame, view):
    """The sightings with a picture in place of which the one before is delivered again."""
    before = sightings.select((sightings.frame == frame - 1) & (sightings.view == view))
    rest = sightings.select((sightings.frame != frame) | (sightings.view != view))
    columns = {
        key: np.concatenate([getattr(rest, key), getattr(before, key)])
        for key in ("view", "person", "joint", "pixels", "sigma")
    }
    frames = np.concatenate([rest.frame, np.full(len(before), frame)])
    return Sightings(frame=frames, times=sightings.times, skeleton=COCO17, **columns)


def test_corrected_frames_have_the_corrected_times(motion):
    clocks = estimate_clocks(RIG, seen(motion, steps_of(OFFSETS)))
    frames = clocks.corrected([Detections.empty()] * FRAMES)
    np.testing.assert_array_equal([each.time for each in frames], clocks.times)
    np.testing.assert_allclose(clocks.times - PERIOD * np.arange(FRAMES)[:, None], [clocks.offsets] * FRAMES)
