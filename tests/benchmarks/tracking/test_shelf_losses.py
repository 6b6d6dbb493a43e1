"""Losses of pictures, trajectories of estimates, and the table of the tracker on Shelf."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.tracking.shelf import LOSSES, Figures, Loss, Shelf, without
from benchmarks.tracking.trajectories import link, second_differences, short_ghosts
from mvpose import Camera, Detections, Estimate, Rig, preset
from mvpose.skeleton import coco17_to_shelf14
from mvpose.tracking import Tracker
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.recording_file import read_recording

BODY = np.random.default_rng(0).normal(size=(17, 3)) * [0.2, 0.2, 0.5]
SHELF = Path(__file__).parents[4] / "shared" / "data" / "shelf"


def people(*places: tuple[float, float], ids: list[int] | None = None) -> Estimate:
    """Return people of one shape at places on the floor."""
    joints = np.array([BODY + [x, y, 0.0] for x, y in places]).reshape(-1, 17, 3)
    estimate = Estimate.of_joints(joints)
    return estimate if ids is None else replace(estimate, ids=np.array(ids))


def recording(frames: int, views: int = 3) -> AnnotatedRecording:
    """Return frames at 25 Hz in which every camera has one detection."""
    rig = Rig(
        [Camera(np.diag([500.0, 500.0, 1.0]), np.eye(3), [float(v), 0, 0], size=(640, 480)) for v in range(views)]
    )
    keypoints = np.random.default_rng(1).uniform(0, 400, (views, 17, 2))
    given = Detections.from_keypoints(np.arange(views), keypoints, np.ones((views, 17)))
    return AnnotatedRecording(rig, np.full((frames, 1, 14, 3), np.nan), (given,) * frames, np.arange(frames))


def test_people_are_linked_to_the_nearest_of_the_latest_frame_with_people():
    frames = [people((0, 0), (2, 0)), people((2.3, 0), (0.3, 0)), people(), people((2.4, 0), (5, 5))]
    assert [each.ids.tolist() for each in link(frames)] == [[0, 1], [1, 0], [], [1, 2]]


def test_second_differences_are_those_of_a_parabola_and_none_across_a_gap():
    fall = [people((0, 0.5 * 9.81 * (0.1 * k) ** 2), ids=[3]) for k in range(4)]
    np.testing.assert_allclose(second_differences(fall), np.full(2 * 17, 9.81 * 0.01))
    assert not len(second_differences([fall[0], fall[1], people(ids=[]), fall[2], fall[3]]))


def test_ghosts_of_short_life_are_estimates_of_nobody_under_five_frames():
    truth = np.array([coco17_to_shelf14(people((0, 0)).joints)] * 10)
    lives = {1: range(10), 2: range(4), 3: range(5)}  # a person, a flash and a ghost that stays
    places = {1: (0, 0), 2: (3, 0), 3: (6, 0)}
    frames = []
    for k in range(10):
        here = [each for each in lives if k in lives[each]]
        frames.append(people(*(places[each] for each in here), ids=here))
    assert short_ghosts(truth, frames) == 0.4


@pytest.mark.slow
def test_a_loss_keeps_the_first_frame_and_loses_its_share_of_the_pictures():
    given = recording(1000)
    left = Loss("half", chance=0.5).of(given, draw=0)
    lost = np.array([np.isnan(each.time) for each in left.detections])
    assert not lost[0].any()
    assert lost[1:].mean() == pytest.approx(0.5, abs=0.03)
    for gone, each in zip(lost, left.detections, strict=True):
        assert each.view.tolist() == np.flatnonzero(~gone).tolist()
    black = Loss("black", black=True).of(given, draw=0)
    dark = [len(each) == 0 for each in black.detections]
    assert np.flatnonzero(dark)[:25].tolist() == list(range(50, 75))
    assert np.mean(dark) == pytest.approx(1 / 3, abs=0.02)
    assert len(Loss("slow", step=12).of(given, draw=0)) == 84
    assert len(Loss("two", views=(0, 2)).of(given, draw=0).rig) == 2


def test_pictures_without_times_cannot_be_lost():
    with pytest.raises(ValueError, match="time of each camera's picture"):
        without(recording(1).detections[0], np.zeros(3, bool))


def test_the_table_marks_what_misses_its_figure():
    def row(method: str, lag: float, pcp: float, switches: int) -> Figures:
        asked = (None, None) if method == "full" else (96.5, 0)
        return Figures(LOSSES[1].name, method, lag, 5, pcp + 1, pcp, asked[0], switches, asked[1], 0.0, 1.0, 2.0)

    columns = [("full", 0.0), ("track", 0.2), ("track", 0.0), ("track-fast", 0.2), ("track-fast", 0.0)]
    rows = [row(*column, 90.0 + 3 * k, 2 - k) for k, column in enumerate(columns)]
    text = Shelf(SHELF).table_of(rows)
    pcp, switches = text.splitlines()[2:4]
    assert [mark for mark in pcp if mark in "✓✗"] == ["✗", "✗", "✓", "✓"]
    assert [mark for mark in switches if mark in "✓✗"] == ["✗", "✓", "✓", "✓"]


@pytest.mark.slow
@pytest.mark.skipif(not SHELF.exists(), reason="real Shelf is not here")
def test_nobody_is_exchanged_on_shelf_with_lost_pictures():
    rows = Shelf(SHELF).measure(quick=True)
    assert [row.switches for row in rows if row.method != "full"] == [0] * 8


def _turned(given: AnnotatedRecording, view: int, degrees: float, *, after: float) -> AnnotatedRecording:
    """Return the detections as if one camera had turned by an angle about its vertical axis after some seconds."""
    K, angle = given.rig[view].K, np.radians(degrees)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    homography, frames = K @ turn @ np.linalg.inv(K), []
    for detections, time in zip(given.detections, given.time, strict=True):
        keypoints = detections.keypoints.copy()
        if time - given.time[0] >= after:
            there = detections.view == view
            points = (
                np.concatenate([keypoints[there], np.ones((*keypoints[there].shape[:2], 1))], axis=2) @ homography.T
            )
            keypoints[there] = points[..., :2] / points[..., 2:]
        frames.append(replace(detections, keypoints=keypoints))
    return replace(given, detections=tuple(frames))


@pytest.mark.slow
@pytest.mark.skipif(not SHELF.exists(), reason="real Shelf is not here")
def test_a_camera_of_shelf_that_turns_is_named_and_none_that_stands():
    given = read_recording("shelf", SHELF)
    for turned, expected in ((given, []), (_turned(given, 1, 1.0, after=6.0), [1])):
        tracker = Tracker(preset("fast"))
        for detections in turned.timed_detections:
            tracker.advance(given.rig, detections)
        assert [drift.view for drift in tracker.drifts] == expected
