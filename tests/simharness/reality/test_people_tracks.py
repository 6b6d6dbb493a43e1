"""Tracks of all people in a recording."""

from dataclasses import replace

import numpy as np
import pytest
from filmed_people import without_views
from turning_people import walkers

from mvpose import Detections
from simharness.reality.people_tracks import LIMB_JOINTS, annotated, present, track_people

NOISY = {
    "keypoints": {"scatter": 0.4, "jitter": 0.1, "miss": 0.03, "drop": {"self_occluded": 0.1, "occluded": 0.3}},
    "boxes": {"missed": 0.1, "duplicates": 0.05},
    "phantoms": {"rate": 0.3},
    "scores": {"miss": 0.3, "deviation": 0.5},
}


@pytest.fixture(scope="module")
def noisy(filmed):
    """Recording of a detector with errors of every kind."""
    return filmed.recording(**NOISY)


@pytest.fixture(scope="module")
def tracked(noisy):
    return track_people(noisy)


def errors(tracks, joints):
    """Distances (F, P, 17) of tracks from the joints (F, A, 17, 3) of their actors."""
    return np.linalg.norm(tracks.joints - joints[:, tracks.ids], axis=-1)


def test_tracks_of_perfect_detections_are_within_centimetres_of_the_truth(filmed):
    tracks = track_people(filmed.recording())
    assert sorted(tracks.ids) == [0, 1, 2]
    assert tracks.present.all()
    away = errors(tracks, filmed.sequence.joints)[..., LIMB_JOINTS]
    assert np.median(away) < 0.003
    assert np.quantile(away, 0.99) < 0.03  # smoothing over 0.06 s rounds fast movements


def test_tracks_of_a_poor_detector_are_within_centimetres_of_the_truth(filmed, tracked):
    assert sorted(tracked.ids) == [0, 1, 2]  # one track for each person, none for phantoms
    assert tracked.present.mean() > 0.97
    away = errors(tracked, filmed.sequence.joints)[..., LIMB_JOINTS][present(tracked)]
    assert np.median(away) < 0.02
    assert np.quantile(away, 0.95) < 0.06


def test_tracks_move_as_smoothly_as_people(filmed, tracked):
    """Accelerations are those of the truth: errors of single frames, of centimetres, would be many times larger."""
    true, made = (np.diff(each[:, :, LIMB_JOINTS], n=2, axis=0) for each in (filmed.sequence.joints, tracked.joints))
    assert np.nanstd(made) < 3 * np.nanstd(true)


def test_all_joints_of_a_person_are_known_or_none(tracked):
    known = np.isfinite(tracked.joints).all(axis=-1)
    assert (known.all(axis=-1) == known.any(axis=-1)).all()
    assert (known.all(axis=-1) == present(tracked)).all()


def test_people_who_are_never_annotated_have_a_track_without_an_actor(filmed):
    recording = filmed.recording()
    truth = recording.truth.copy()
    truth[:, 1] = np.nan
    tracks = track_people(replace(recording, truth=truth))
    assert sorted(tracks.ids) == [0, 2, 3]  # 3 is the first number that is no actor
    stranger = tracks.joints[:, tracks.ids == 3]
    away = np.linalg.norm(stranger[:, 0] - filmed.sequence.joints[:, 1], axis=-1)
    assert np.median(away[:, LIMB_JOINTS]) < 0.003
    assert not annotated(tracks, truth)[:, tracks.ids == 3].any()


def test_annotated_people_are_present_and_annotated_in_the_frame(filmed):
    recording = filmed.recording()
    truth = recording.truth.copy()
    truth[:50, 0] = np.nan
    truth[60, 2, 3] = np.nan
    tracks = track_people(replace(recording, truth=truth))
    found = annotated(tracks, truth)
    expected = np.ones((len(recording), 3), bool)
    expected[:50, 0] = expected[60, 2] = False
    np.testing.assert_array_equal(found, expected[:, tracks.ids])
    assert tracks.present.all()  # also where nobody annotated them


def test_short_gaps_are_filled_along_the_movement(filmed):
    recording = filmed.recording()
    gap = range(80, 90)  # 0.4 s
    holes = replace(
        recording,
        truth=np.where(np.isin(np.arange(len(recording)), gap)[:, None, None, None], np.nan, recording.truth),
        detections=tuple(Detections.empty() if row in gap else found for row, found in enumerate(recording.detections)),
    )
    tracks = track_people(holes)
    assert tracks.present.all()
    away = errors(tracks, filmed.sequence.joints)[list(gap)][..., LIMB_JOINTS]
    assert np.median(away) < 0.05


@pytest.mark.slow
def test_people_who_leave_and_come_back_are_absent_in_between_and_keep_their_actor(filmed):
    """Actor 1 is away for 2 s, twice as long as a gap that is filled."""
    recording = filmed.recording()
    away = range(70, 120)
    person = 1

    def is_away(frame, view, keypoints):
        pixels = filmed.views.pixels[frame, view]
        far = np.nanmedian(np.linalg.norm(pixels - keypoints, axis=-1), axis=-1)
        return frame in away and int(np.argmin(far)) == person

    left = without_views(recording, is_away)
    truth = recording.truth.copy()
    truth[list(away), person] = np.nan
    tracks = track_people(replace(left, truth=truth))
    assert sorted(tracks.ids) == [0, 1, 2]
    here = present(tracks)[:, list(tracks.ids).index(person)]
    assert not here[list(away)].any()
    assert here[: away[0]].all()
    assert here[away[-1] + 1 :].all()
    assert tracks.present[:, tracks.ids != person].all()


def test_gaps_between_frames_are_not_bridged(filmed):
    """Frames 0 to 79 and 1000 to 1119: tracks are not smoothed across the gap, and actors keep theirs."""
    recording = filmed.recording()
    frames = np.concatenate([np.arange(80), 1000 + np.arange(120)])
    order = np.concatenate([np.arange(80), 199 - np.arange(120)])  # the second part runs backwards, from another place
    cut = replace(
        recording,
        frames=frames,
        truth=recording.truth[order],
        detections=tuple(recording.detections[row] for row in order),
    )
    tracks = track_people(cut)
    assert sorted(tracks.ids) == [0, 1, 2]
    away = errors(tracks, filmed.sequence.joints[order])[..., LIMB_JOINTS]
    assert away[[78, 79, 80, 81]].mean() < 0.01
    whole = track_people(recording.during(range(80)))
    order = [list(whole.ids).index(actor) for actor in tracks.ids]
    np.testing.assert_allclose(tracks.joints[:80], whole.joints[:, order], atol=1e-9)


@pytest.mark.slow
def test_actors_without_any_estimate_are_taken_from_the_annotation(filmed):
    """Nobody detects actor 0: the person is where the annotation is, and hides others all the same."""
    recording = filmed.recording()

    def is_first(frame, view, keypoints):
        far = np.nanmedian(np.linalg.norm(filmed.views.pixels[frame, view] - keypoints, axis=-1), axis=-1)
        return int(np.argmin(far)) == 0

    tracks = track_people(without_views(recording, is_first))
    assert sorted(tracks.ids) == [0, 1, 2]
    away = errors(tracks, filmed.sequence.joints)[:, tracks.ids == 0][..., LIMB_JOINTS]
    assert np.quantile(away, 0.99) < 0.03


def test_ghosts_that_last_less_than_a_second_are_no_people(filmed):
    """A person is added to 20 frames of 0.8 s."""
    recording = filmed.recording()
    some = filmed.detections()
    moved = [camera.project(filmed.sequence.joints[:, 0] + [2.0, 2.0, 0.0]) for camera in recording.rig]
    frames = []
    for row, found in enumerate(some):
        if row not in range(100, 120):
            frames.append(found)
            continue
        keypoints = np.concatenate([found.keypoints, [view[row] for view in moved]])
        scores = np.concatenate([found.scores, np.full((len(moved), 17), 0.9)])
        view = np.concatenate([found.view, np.arange(len(moved))])
        frames.append(Detections.from_keypoints(view, keypoints, scores))
    assert sorted(track_people(replace(recording, detections=tuple(frames))).ids) == [0, 1, 2]


def test_recordings_in_which_nobody_is_found_are_refused():
    nobody = walkers(frames=30)
    nobody = replace(nobody, detections=(Detections.empty(),) * 30, truth=np.full(nobody.truth.shape, np.nan))
    with pytest.raises(ValueError, match="expected people whom the detections of two views agree on, got none in 30"):
        track_people(nobody)
