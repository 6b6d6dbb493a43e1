"""Scores over time of one variant, at every distance and place: the entry ``tracking`` of ``summary.json``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mvpose import COCO17, SHELF14, Estimate
from mvpose.arrays import Floats
from mvpose.skeleton import HeadMapping, coco17_to_shelf14
from simharness.scoring.pairing import pair
from simharness.scoring.tracking.columns import DISTANCE
from simharness.scoring.tracking.figures import OF_SOME_PEOPLE, identity_figures
from simharness.scoring.tracking.motion_scores import rms_jerk, velocity_error
from simharness.scoring.tracking.tracked_frames import DISTANCES, PLACES, ids_of, tracked_frames
from simharness.scoring.tracking.tracked_poses import pose_figures

Summary = dict[str, Any]


def tracking_summary(truth: Floats, estimates: Sequence[Estimate], time: Floats) -> Summary:
    """Return the scores over time of a variant, where all people are known.

    Args:
        truth: true joints on COCO-17, (T, P, 17, 3), metres; NaN where undefined.
        estimates: estimates, T.
        time: times of the frames, (T,), seconds.

    Returns:
        ``mean_joint`` and ``root``, each with the figures of
        :func:`simharness.scoring.tracking.figures.identity_figures` by distance ("0.25", "0.5", "1" metres);
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
    paired = np.full(truth.shape, np.nan)
    for row, true, estimated in zip(paired, truth, joints, strict=True):
        partner = pair(true, estimated).estimate
        row[partner >= 0] = estimated[partner[partner >= 0]]
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
