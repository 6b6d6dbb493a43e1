"""Scores of identities over time: the columns of tables at 0.5 m on the mean joint, and the entry ``tracking`` of
``summary.json`` at every distance and place. A figure that does not apply is None.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17, SHELF14, Estimate
from mvpose.arrays import Floats
from mvpose.skeleton import HeadMapping, coco17_to_shelf14
from simharness.scoring.pairing import pair, placed_joints
from simharness.scoring.score_registry import ScoreInput, finite_mean, score, scores, shipped_scores
from simharness.scoring.tracking.identity_scores import clear_mot, hota, identity_scores, pose_figures
from simharness.scoring.tracking.tracked_frames import DISTANCES, PLACES, TrackedFrames, ids_of, tracked_frames

Figures = dict[str, float | None]
Summary = dict[str, Any]

DISTANCE = 0.5
"""Distance of the columns, metres: also the largest one at which people and estimates are paired for other scores."""

SHARES = ("hota", "deta", "assa", "loca", "idf1", "idp", "idr", "mota")
COUNTS = ("id_switches", "fragmentations", "interruptions", "switches_per_minute")

OF_SOME_PEOPLE = ("idr", "id_switches", "interruptions", "switches_per_minute")
"""Figures that hold where some people are annotated, in some frames: all others count the estimates of the rest as
false, or the other frames as gaps."""

IDENTITY_SCORES = (
    *SHARES, "pcp_tracked", "mpjpe_tracked_mm", "id_switches", "switches_per_minute", "fragmentations",
)  # fmt: skip
"""Keys of the scores that only variants with identities have."""


@scores(*(shipped_scores()[key] for key in IDENTITY_SCORES))
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


def identity_figures(frames: TrackedFrames, time: Floats, *, distance: float) -> Figures:
    """Return HOTA, DetA, AssA, LocA, IDF1, IDP, IDR and MOTA as shares, and numbers of switches and gaps.

    All are None without true people; IDP without estimates, LocA without pairs, switches a minute with one frame alone.

    Args:
        frames: people and identities.
        time: times of the frames, (T,), seconds.
        distance: distance at which the similarity is 0.5, and largest distance of a pair, metres.
    """
    people = int(frames.frames_of_people.sum())
    if not people:
        return dict.fromkeys((*SHARES, *COUNTS))
    higher = hota(frames, distance=distance)
    names = identity_scores(frames, distance=distance)
    pairs = clear_mot(frames, distance=distance)
    minutes = people * float(np.median(np.diff(time))) / 60.0 if len(time) > 1 else 0.0
    return {
        "hota": float(higher.hota.mean()),
        "deta": float(higher.detection.mean()),
        "assa": float(higher.association.mean()),
        "loca": float(higher.location.mean()) if higher.pairs.any() else None,
        "idf1": names.f1,
        "idp": names.precision if frames.frames_of_tracks.any() else None,
        "idr": names.recall,
        "mota": pairs.mota,
        "id_switches": float(pairs.switches),
        "fragmentations": float(pairs.fragmentations),
        "interruptions": float(pairs.interruptions),
        "switches_per_minute": pairs.switches / minutes if minutes else None,
    }


def tracking_summary(truth: Floats, estimates: Sequence[Estimate], time: Floats) -> Summary:
    """Return the scores over time of a variant, where all people are known.

    Args:
        truth: true joints on COCO-17, (T, P, 17, 3), metres; NaN where undefined.
        estimates: estimates, T.
        time: times of the frames, (T,), seconds.

    Returns:
        ``mean_joint`` and ``root``, each with the figures of
        :func:`simharness.scoring.tracking.identity_figures.identity_figures` by distance ("0.25", "0.5", "1" metres);
        ``pcp_tracked`` (percent) and ``mpjpe_tracked_mm``; ``velocity_mm_s``; ``jerk_m_s3``, the RMS jerk of the
        ``estimate`` and of the ``truth``. Those of identities are None without identities.
    """
    joints = [estimate.joints for estimate in estimates]
    ids = ids_of(estimates)
    found: Summary = dict.fromkeys((*PLACES, "pcp_tracked", "mpjpe_tracked_mm"))
    if ids is not None:
        for place in PLACES:
            frames = tracked_frames(truth, joints, ids, skeleton=COCO17, place=place)
            found[place] = {f"{each:g}": identity_figures(frames, time, distance=each) for each in DISTANCES}
        frames = tracked_frames(truth, joints, ids, skeleton=COCO17)
        found |= pose_figures(frames, truth, joints, distance=DISTANCE)
    paired = np.stack([placed_joints(pair(*each).estimate, each[1]) for each in zip(truth, joints, strict=True)])
    velocity, jerk = velocity_error(truth, paired, time), rms_jerk(truth, paired, time)
    return found | {
        "velocity_mm_s": None if velocity is None else 1000.0 * velocity,
        "jerk_m_s3": dict(zip(("estimate", "truth"), jerk or (None, None), strict=True)),
    }


def tracking_of_some(
    truth: Floats,
    estimates: Sequence[Estimate],
    time: Floats,
    *,
    head: HeadMapping = "voxelpose",
    actors: Sequence[int] | None = None,
) -> Summary | None:
    """Return the scores of identities where only some of the people there are annotated; None without identities.

    The estimates of the others count against no score.

    Args:
        truth: annotated joints on SHELF14, (T, P, 14, 3), metres; NaN where a person is not annotated.
        estimates: estimates on COCO-17, T.
        time: times of the frames, (T,), seconds.
        head: mapping to the head of SHELF14.
        actors: indices of the people whose PCP is averaged; None: all.

    Returns:
        ``mean_joint`` and ``root``, each with IDR, switches, interruptions and switches a minute by distance;
        ``pcp_tracked`` (percent) and ``mpjpe_tracked_mm``.
    """
    ids = ids_of(estimates)
    if ids is None:
        return None
    joints = [coco17_to_shelf14(estimate.joints, head=head) for estimate in estimates]
    found: Summary = {}
    for place in PLACES:
        frames = tracked_frames(truth, joints, ids, skeleton=SHELF14, place=place)
        figures = {f"{each:g}": identity_figures(frames, time, distance=each) for each in DISTANCES}
        found[place] = {key: {name: each[name] for name in OF_SOME_PEOPLE} for key, each in figures.items()}
    frames = tracked_frames(truth, joints, ids, skeleton=SHELF14)
    return found | pose_figures(frames, truth, joints, distance=DISTANCE, actors=actors)


def velocity(positions: ArrayLike, time: ArrayLike) -> Floats:
    """Return the velocities between frames, (T - 1, ..., 3), m/s; NaN where one of two positions is missing.

    Args:
        positions: positions over time, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    return _slopes(np.asarray(positions, float), np.asarray(time, float), 1)


def jerk(positions: ArrayLike, time: ArrayLike) -> Floats:
    """Return the third derivative of positions, (T - 3, ..., 3), m/s³; NaN where one of four positions is missing.

    It is six times the third divided difference: exact for cubic motion, at any times.

    Args:
        positions: positions over time, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    positions, time = np.asarray(positions, float), np.asarray(time, float)
    for order in (1, 2, 3):
        positions = order * _slopes(positions, time, order)
    return positions


def velocity_error(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> float | None:
    """Return the mean length of the difference of velocities, m/s; None without two frames in a row.

    Args:
        truth: true positions, (T, ..., 3), metres; NaN where undefined.
        estimate: estimated positions, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    return finite_mean(np.linalg.norm(velocity(estimate, time) - velocity(truth, time), axis=-1))


def rms_jerk(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> tuple[float, float] | None:
    """Return the RMS of the jerk of the estimate and of the truth, m/s³, where both are known in four frames in a row.

    Args:
        truth: true positions, (T, ..., 3), metres; NaN where undefined.
        estimate: estimated positions, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.

    Returns:
        Both, or None without four such frames.
    """
    squares = [(jerk(each, time) ** 2).sum(axis=-1) for each in (estimate, truth)]
    both = np.isfinite(squares).all(axis=0)
    if not both.any():
        return None
    found, true = (float(np.sqrt(each[both].mean())) for each in squares)
    return found, true


_STILL = 1e-3  # m/s³, a thousandth of a slow walk's: positions of nobody who moves differ by rounding alone


def jerk_ratio(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> float | None:
    """Return the RMS jerk of the estimate over that of the truth; None without four frames, or if nobody moves.

    The arguments are those of :func:`rms_jerk`.
    """
    rms = rms_jerk(truth, estimate, time)
    return rms[0] / rms[1] if rms and rms[1] > _STILL else None


@score(shipped_scores()["velocity_mm_s"])
def velocity_column(given: ScoreInput) -> float | None:
    """Return the mean error of velocities, mm/s."""
    error = velocity_error(given.truth, given.paired, given.recording.time)
    return None if error is None else 1000.0 * error


@score(shipped_scores()["jerk_ratio"])
def jerk_column(given: ScoreInput) -> float | None:
    """Return the ratio of the jerk of the estimates to that of the truth."""
    return jerk_ratio(given.truth, given.paired, given.recording.time)


def _slopes(values: Floats, time: Floats, apart: int) -> Floats:
    """Return the differences of values over the time between frames that are ``apart``, (n - 1, ...)."""
    steps = time[apart:] - time[:-apart]
    return np.diff(values, axis=0) / steps.reshape(-1, *[1] * (values.ndim - 1))
