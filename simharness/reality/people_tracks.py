"""Joint tracks of all people in a recording, annotated or not: who is where, in which pose, in every frame.

The method under test estimates the people of each frame from all cameras. Estimates of consecutive frames are linked to
tracks, gaps in them are filled, and each track is assigned to the actor whose annotation it follows. The joints are
those that the detector finds (its hips, for example, are above the annotated ones): the detector is measured against
the consensus of its own views, and the annotation apart from it.
"""

import itertools
import warnings
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, SHELF14, preset
from mvpose.arrays import Bools, Floats, Integers
from mvpose.recording import People
from simharness.detector.viewing_conditions import body_axes
from simharness.reality.annotated_recording import AnnotatedRecording

LIMB_JOINTS = np.arange(5, 17)
"""Joints of COCO-17 that data sets have in common, (12,): shoulders to ankles, without the face."""

SHELF14_OF_LIMBS = np.array([SHELF14.index(COCO17.joints[joint]) for joint in LIMB_JOINTS])
"""Index in SHELF14 of each limb joint of COCO-17, (12,)."""

SMOOTHING = 0.06
"""Standard deviation of the Gaussian that smooths tracks, seconds: it takes errors of single frames, not motion."""

_TRUNK = (5, 6, 11, 12)
_REACH = 0.5  # metres: largest mean distance of the joints of a person in consecutive frames of a track
_PAUSE = 1.0  # seconds: longest gap in a track; a person who is away for longer begins another one
_SHORTEST = 1.0  # seconds: shorter tracks are ghosts
_NEAR = 0.3  # metres: largest mean distance of an actor's annotation from the track of that actor
_OUTLYING = 0.25  # metres: distance of a joint from its median over _WINDOW frames from which it is replaced
_WINDOW = 0.4  # seconds


def present(people: People) -> Bools:
    """Return which people are present in which frames, (F, P)."""
    return np.asarray(people.present.any(axis=-1))


def actors_of(people: People, truth: Floats) -> Integers:
    """Return the actor of a truth (F, A, 14, 3) that each person is, (P,); -1 for a person who is never annotated."""
    return np.where(people.ids < truth.shape[1], people.ids, -1)


def annotated(people: People, truth: Floats) -> Bools:
    """Return which people are present and annotated, (F, P), given the truth (F, A, 14, 3) of the recording."""
    actor = actors_of(people, truth)
    known = np.asarray(np.isfinite(truth[:, :, SHELF14_OF_LIMBS]).all(axis=(2, 3)))
    return np.asarray(present(people) & (actor >= 0) & known[:, np.maximum(actor, 0)])


def track_people(recording: AnnotatedRecording) -> People:
    """Return all people of a recording on COCO-17; each actor is at most one of them.

    Returns:
        People in the frames of the recording, of whom all joints are known in a frame, or none. The identity of a
        person whose annotation is that of an actor is the actor's index; those of others follow (:func:`actors_of`).

    Raises:
        ValueError: nobody is found in any frame.
    """
    method = preset("full")
    people = [
        _complete_enough(method.estimate(recording.rig, found).joints, recording.truth[frame])
        for frame, found in enumerate(recording.detections)
    ]
    tracks = [track for segment in recording.segments for track in _link(people, segment, recording)]
    if not tracks:
        raise ValueError(
            f"{recording.name}: expected people whom the detections of two views agree on, got none in "
            f"{len(recording)} frames; check that calibration and detections belong together"
        )
    actors = np.array([_actor_of(track, recording.truth) for track in tracks])
    merged = [(_merge([t for t, a in zip(tracks, actors, strict=True) if a == actor]), actor) for actor in
              sorted(set(actors[actors >= 0]))]  # fmt: skip
    merged += [(track, -1) for track, actor in zip(tracks, actors, strict=True) if actor < 0]
    joints = np.stack([_filled(track, recording) for track, _ in merged], axis=1)
    others = itertools.count(recording.people)
    ids = [actor if actor >= 0 else next(others) for _, actor in merged]
    return People(recording.time, np.array(ids, np.int64), joints, numbers=recording.frames)


def _complete_enough(joints: Floats, truth: Floats) -> Floats:
    """Return the people (n, 17, 3) with a whole trunk and most limb joints, and actors (A, 14, 3) who have no estimate.

    Actors without an estimate near them are added as annotated, without a face.
    """
    known = np.isfinite(joints[:, list(_TRUNK), 0]).all(axis=1)
    known &= np.isfinite(joints[:, LIMB_JOINTS, 0]).sum(axis=1) >= len(LIMB_JOINTS) / 2
    annotated = np.full((len(truth), len(COCO17), 3), np.nan)
    annotated[:, LIMB_JOINTS] = truth[:, SHELF14_OF_LIMBS]
    annotated = annotated[np.isfinite(annotated[:, LIMB_JOINTS]).all(axis=(1, 2))]
    near = _distances(annotated, joints).min(axis=1, initial=np.inf)
    return np.concatenate([joints[known], annotated[near > _NEAR]])


def _link(people: Sequence[Floats], segment: slice, recording: AnnotatedRecording) -> list[Floats]:
    """Return the tracks in a run of frames, (F, 17, 3) each, NaN where the person is not found."""
    tracks: list[Floats] = []
    last: list[int] = []  # row in which each track was seen last
    pause = round(_PAUSE * recording.rate)
    for row in range(segment.start, segment.stop):
        open_ = [index for index, seen in enumerate(last) if row - seen <= pause]
        recent = np.array([tracks[index][last[index]] for index in open_]).reshape(-1, len(COCO17), 3)
        far = _distances(recent, people[row])
        taken = set()
        for one, other in zip(*linear_sum_assignment(np.minimum(far, 2 * _REACH)), strict=True):
            if far[one, other] < _REACH:
                tracks[open_[one]][row], last[open_[one]] = people[row][other], row
                taken.add(other)
        for other in set(range(len(people[row]))) - taken:
            track = np.full((len(people), len(COCO17), 3), np.nan)
            track[row] = people[row][other]
            tracks.append(track)
            last.append(row)
    shortest = max(1, round(_SHORTEST * recording.rate))
    return [track for track in tracks if np.isfinite(track[:, _TRUNK[0], 0]).sum() >= shortest]


def _distances(one: Floats, other: Floats) -> Floats:
    """Return mean distances of the limb joints that both have, (n, m); infinite where they share none."""
    away = np.linalg.norm(one[:, None, LIMB_JOINTS] - other[None, :, LIMB_JOINTS], axis=-1)
    known = np.isfinite(away)
    total = np.where(known, away, 0.0).sum(axis=-1)
    return np.where(known.any(axis=-1), total / np.maximum(known.sum(axis=-1), 1), np.inf)


def _actor_of(track: Floats, truth: Floats) -> int:
    """Return the actor that a track (F, 17, 3) is nearest to in most annotated frames; -1 if in none."""
    away = np.linalg.norm(truth[:, :, SHELF14_OF_LIMBS] - track[:, None, LIMB_JOINTS], axis=-1)
    known = np.isfinite(away)
    far = np.where(known, away, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
    votes = (known.any(axis=-1) & (far < _NEAR)).sum(axis=0)
    return int(votes.argmax()) if votes.size and votes.max() > 0 else -1


def _merge(tracks: Sequence[Floats]) -> Floats:
    """Return one track with the frames of several of the same person; the longest has priority."""
    ordered = sorted(tracks, key=lambda track: -int(np.isfinite(track[:, _TRUNK[0], 0]).sum()))
    result = ordered[0].copy()
    for track in ordered[1:]:
        absent = ~np.isfinite(result[:, _TRUNK[0], 0])
        result[absent] = track[absent]
    return result


def _filled(track: Floats, recording: AnnotatedRecording) -> Floats:
    """Return a track (F, 17, 3) without outliers, short gaps or missing joints, smoothed."""
    result = track.copy()
    pause = max(1, round(_PAUSE * recording.rate))
    usual = _usual_pose(track)
    for segment in recording.segments:
        piece = result[segment]
        rows = np.flatnonzero(np.isfinite(piece[:, _TRUNK[0], 0]))
        for run in np.split(rows, np.flatnonzero(np.diff(rows) > pause) + 1):
            if len(run):
                whole = slice(run[0], run[-1] + 1)
                piece[whole] = _fill_run(piece[whole], usual, recording.rate)
    return result


def _fill_run(run: Floats, usual: Floats, rate: float) -> Floats:
    """Return a run of frames (t, 17, 3), in which single joints and frames may be missing, complete and smooth."""
    t, half = np.arange(len(run)), max(1, round(_WINDOW * rate / 2))
    if len(run) > 2 * half:
        padded = np.pad(run, ((half, half), (0, 0), (0, 0)), constant_values=np.nan)
        windows = np.stack([padded[shift : shift + len(run)] for shift in range(2 * half + 1)])
        # Windows are shorter near both ends, so that a fast movement is in their middle there, too.
        shift = np.abs(np.arange(-half, half + 1))[:, None]
        windows[shift > np.minimum(t, len(run) - 1 - t)] = np.nan
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # joints that are missing in a whole window
            usual_place = np.nanmedian(windows, axis=0)
        run = np.where((np.linalg.norm(run - usual_place, axis=-1) > _OUTLYING)[..., None], np.nan, run)
    result = np.empty_like(run)
    for joint in [*_TRUNK, *(j for j in range(len(COCO17)) if j not in _TRUNK)]:
        known = np.isfinite(run[:, joint, 0])
        if joint == next(j for j in range(len(COCO17)) if j not in _TRUNK):
            middle, axes = result[:, list(_TRUNK)].mean(axis=1), body_axes(result)
        if known.any() and (joint in _TRUNK or known.mean() > 0.5):
            result[:, joint] = np.stack([np.interp(t, t[known], run[known, joint, c]) for c in range(3)], axis=-1)
        elif joint in _TRUNK:
            result[:, joint] = np.nanmean(run[:, list(_TRUNK)], axis=1)
        else:  # mostly unknown: where it usually is relative to the trunk, where not seen
            guess = middle + np.einsum("k,tkc->tc", usual[joint], axes)
            result[:, joint] = np.where(known[:, None], run[:, joint], guess)
    return np.asarray(gaussian_filter1d(result, SMOOTHING * rate, axis=0, mode="nearest"))


def _usual_pose(track: Floats) -> Floats:
    """Return the median place of each joint in the frame of the trunk, (17, 3): forward, left and up, metres."""
    offset = track - track[:, list(_TRUNK)].mean(axis=1, keepdims=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # joints that the track never has
        usual = np.nanmedian(np.einsum("tjc,tkc->tjk", offset, body_axes(track)), axis=0)
    return np.where(np.isfinite(usual), usual, _STANDING)


# Joints of a standing person in the frame of the trunk, metres: used for a joint that a track never has.
_STANDING = np.array([
    [.12, 0, .48], [.1, .03, .52], [.1, -.03, .52], [.02, .07, .5], [.02, -.07, .5], [0, .18, .25], [0, -.18, .25],
    [0, .25, -.05], [0, -.25, -.05], [.05, .27, -.28], [.05, -.27, -.28], [0, .1, -.25], [0, -.1, -.25],
    [0, .1, -.65], [0, -.1, -.65], [-.02, .1, -1.05], [-.02, -.1, -1.05],
])  # fmt: skip
