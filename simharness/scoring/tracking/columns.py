"""Columns of tables: scores of identities at 0.5 m on the mean joint, and of motion."""

from __future__ import annotations

from collections.abc import Mapping

from mvpose import COCO17
from simharness.scoring.score_registry import ScoreInfo, ScoreInput, score, scores
from simharness.scoring.tracking.figures import SHARES, identity_figures
from simharness.scoring.tracking.motion_scores import jerk_ratio, velocity_error
from simharness.scoring.tracking.tracked_frames import ids_of, tracked_frames
from simharness.scoring.tracking.tracked_poses import pose_figures

DISTANCE = 0.5
"""Distance of the columns, metres: also the largest one at which people and estimates are paired for other scores."""

_SHARES = {
    "hota": ("HOTA", "people found and kept under one identity, mean over 19 thresholds"),
    "deta": ("DetA", "part of HOTA: people found; ghosts and missed people lower it"),
    "assa": ("AssA", "part of HOTA: agreement of tracks with people over the whole time"),
    "loca": ("LocA", "part of HOTA: similarity of pairs, 100 at no distance, 50 at 0.5 m"),
    "idf1": ("IDF1", "harmonic mean of IDP and IDR"),
    "idp": ("IDP", "estimates within 0.5 m of the person that their identity stands for"),
    "idr": ("IDR", "people with the estimate of their identity within 0.5 m"),
    "mota": ("MOTA", "100 less missed people, ghosts and switches per true person"),
    "pcp_tracked": ("PCP tracked", "PCP where estimates under another identity are missed"),
}

_ERRORS = (
    ScoreInfo("mpjpe_tracked_mm", "MPJPE tracked", "mm", "MPJPE of people found under their identity", "lower", 1),
    ScoreInfo("id_switches", "Switches", "", "changes of identity of people in the whole recording", "lower", 0),
    ScoreInfo("switches_per_minute", "Switch rate", "/min", "changes of identity per minute and person", "lower", 2),
    ScoreInfo("fragmentations", "Fragmentations", "", "people found again after frames without them", "lower", 0),
)

_IDENTITIES = (*(ScoreInfo(key, title, "%", about, "higher", 1) for key, (title, about) in _SHARES.items()), *_ERRORS)

IDENTITY_SCORES = tuple(info.key for info in _IDENTITIES)
"""Keys of the scores that only variants with identities have."""


@scores(*_IDENTITIES)
def identity_columns(given: ScoreInput) -> Mapping[str, float | None]:
    """Return the scores of identities; all None without identities."""
    ids = ids_of(given.estimates)
    if ids is None:
        return dict.fromkeys(IDENTITY_SCORES)
    joints = [estimate.joints for estimate in given.estimates]
    frames = tracked_frames(given.truth, joints, ids, skeleton=COCO17)
    figures = identity_figures(frames, given.recording.time, distance=DISTANCE)
    percents = {key: 100.0 * share for key in SHARES if (share := figures[key]) is not None}
    return figures | percents | pose_figures(frames, given.truth, joints, distance=DISTANCE)


_VELOCITY = "mean error of the velocity of joints of people found, from frame to frame"


@score(ScoreInfo("velocity_mm_s", "Velocity error", "mm/s", _VELOCITY, "lower", 0))
def velocity_column(given: ScoreInput) -> float | None:
    """Return the mean error of velocities, mm/s."""
    error = velocity_error(given.truth, given.paired, given.recording.time)
    return None if error is None else 1000.0 * error


_JERK = "RMS jerk of joints of people found over that of the truth; 1 is as smooth as people are"


@score(ScoreInfo("jerk_ratio", "Jerk", "", _JERK, "lower", 2, target=1.0))
def jerk_column(given: ScoreInput) -> float | None:
    """Return the ratio of the jerk of the estimates to that of the truth."""
    return jerk_ratio(given.truth, given.paired, given.recording.time)
