"""Decoys taken for people: posters, mannequins, coat stands, mirror images."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mvpose import COCO17
from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.draws import KeyedDraws
from simharness.detector.false_positives import (
    MIN_JOINTS,
    NORMALS,
    bounding_box,
    false_positive_block,
    keypoint_scores,
    postures,
    project_upright,
)
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import BOX_SHARE
from simharness.scenario.sections.detector_section import DecoyHitsSection
from simharness.types.views import Views

_SCATTER = 0.2  # deviation of keypoints at the decoy's true joints, in units of OKS sigma x sqrt(area)


@step("decoys", stage=StepStage.FALSE_POSITIVES, sections=("decoys",))
def add_decoy_hits(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Append the decoys that are taken for people."""
    hits = draw_decoy_hits(context.views, context.rig, context.config.decoys, context.draws)
    return DetectionBlock.concatenate([block, hits])


def draw_decoy_hits(views: Views, rig: Rig, config: DecoyHitsSection, draws: KeyedDraws) -> DetectionBlock:
    """Draw which decoys are taken for people, in one slot for each of the D lookalikes.

    A decoy can be detected in a view where at least ``MIN_JOINTS`` of its joints are seen, and is then detected with
    the probability ``config.share``. A share ``config.consistent`` of the hits shows the decoy's true joints as far as
    they are seen. The others have an upright pose in the box around these joints, a different one in each view, for as
    long as the hit lasts.

    Args:
        views: ground truth in the pictures, T frames of V cameras.
        rig: true rig, for the sizes of the images.
        config: parameters of decoy hits.
        draws: draws of the sequence.
    """
    names = views.lookalikes.names if config.share > 0 else ()
    if not names:
        return DetectionBlock.empty(len(views), len(rig), 0)
    hits = [hit for slot in range(len(names)) for hit in _hits_of_decoy(views, config, draws, slot)]
    frame, view, slot, keypoints, scores = (np.concatenate(column) for column in zip(*hits, strict=True))
    where = (frame, view, slot)
    return false_positive_block(rig, len(views), where, keypoints, scores, origin=Origin.DECOY, number=slot)


def _hits_of_decoy(
    views: Views, config: DecoyHitsSection, draws: KeyedDraws, decoy: int
) -> Iterator[tuple[NDArray, ...]]:
    """Yield for each view the frame, view, slot, keypoints and scores of the hits of one decoy, (r, ...) each."""
    key = ("decoy", views.lookalikes.names[decoy])
    seen, pixels = views.lookalikes.visible[:, :, decoy], views.lookalikes.pixels[:, :, decoy]
    taken = ndtr(draws.states(*key, life=config.life, shared=config.views)) < config.share
    taken &= seen.sum(axis=-1) >= MIN_JOINTS
    held = draws.held_frames(*key, life=config.life)
    for view in range(draws.views):
        frame = np.flatnonzero(taken[:, view])
        since = frame if held is None else held[frame]  # draws of this frame hold as long as the hit lasts
        keypoints = np.where(seen[frame, view, :, None], pixels[frame, view], np.nan)
        fresh = draws.normal(*key, "fresh", view, shape=(17, 3))[frame] if len(frame) else np.zeros((0, 17, 3))
        low, high = bounding_box(keypoints)
        unit = np.sqrt(BOX_SHARE * (high - low).prod(axis=-1))[:, None, None] * np.reshape(COCO17.sigmas, (-1, 1))
        keypoints += _SCATTER * unit * fresh[..., :2]
        if config.consistent < 1 and len(frame):
            inconsistent = ndtr(draws.normal(*key, "own", view)[since]) >= config.consistent
            normals = draws.normal(*key, "posture", view, shape=(NORMALS + 2,))[since[inconsistent]]
            keypoints[inconsistent] = _poses_in_boxes(normals, low[inconsistent], high[inconsistent])
        common = draws.normal(*key, "score", view)[since]
        scores = keypoint_scores(config.score, config.deviation, common, fresh[..., 2])
        yield frame, np.full_like(frame, view), np.full_like(frame, decoy), keypoints, scores


def _poses_in_boxes(normals: Floats, low: Floats, high: Floats) -> Floats:
    """Return poses (r, 17, 2) that fill boxes, from standard normal numbers (r, NORMALS + 2)."""
    heading, tilt = ndtr(normals[:, NORMALS:]).T
    poses = project_upright(postures(normals[:, :NORMALS]), 2 * np.pi * heading, 0.5 * tilt)
    least, most = poses.min(axis=1, keepdims=True), poses.max(axis=1, keepdims=True)
    return low[:, None] + (poses - least) / (most - least) * (high - low)[:, None]
