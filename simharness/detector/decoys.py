"""Decoys taken for people: posters, mannequins, coats on stands, people in mirrors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mvpose import COCO17
from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.detector.conditions import BOX_SHARE
from simharness.detector.correlation import Chances
from simharness.detector.detection_block import Found, Origin
from simharness.detector.false_positives import LEAST, box_about, reported, sureness
from simharness.detector.phantom_poses import DRAWS, postures, seen_from
from simharness.scenario.sections.detector import DecoyHits
from simharness.types.views import Views

_SCATTER = 0.2  # deviation of keypoints that are the thing's own, in units of OKS sigma x sqrt(area)


def decoy_hits(views: Views, rig: Rig, config: DecoyHits, chances: Chances) -> Found:
    """Draw which decoys are taken for people, a slot for each of the D lookalikes.

    A decoy can be where at least ``LEAST`` of its joints are seen in a view, and then is with the chance
    ``config.share``. Of those taken a share ``config.consistent`` show the thing's own joints, as far as they are
    seen; the others have a pose by themselves in the box about these, another in each view, for as long as it lasts.

    Args:
        views: the truth in the pictures, T frames of V cameras.
        rig: the cameras that take the pictures, for their images' sizes.
        config: the dials.
        chances: of the sequence.
    """
    names = views.lookalikes.names if config.share > 0 else ()
    if not names:
        return Found.nothing(len(views), len(rig), 0)
    hits = [hit for slot in range(len(names)) for hit in _of_one(views, config, chances, slot)]
    frame, view, slot, keypoints, scores = (np.concatenate(column) for column in zip(*hits, strict=True))
    where = (frame, view, slot)
    return reported(rig, len(views), where, keypoints, scores, origin=Origin.DECOY, number=slot)


def _of_one(views: Views, config: DecoyHits, chances: Chances, decoy: int) -> Iterator[tuple[NDArray, ...]]:
    """Of each view the frames in which one is taken for a person, view, slot, keypoints and scores, (r, ...)."""
    key = ("decoy", views.lookalikes.names[decoy])
    seen, pixels = views.lookalikes.visible[:, :, decoy], views.lookalikes.pixels[:, :, decoy]
    taken = ndtr(chances.states(*key, life=config.life, shared=config.views)) < config.share
    taken &= seen.sum(axis=-1) >= LEAST
    held = chances.lasting(*key, life=config.life)
    for view in range(chances.views):
        frame = np.flatnonzero(taken[:, view])
        since = frame if held is None else held[frame]  # what is drawn then holds as long as the thing is taken for one
        keypoints = np.where(seen[frame, view, :, None], pixels[frame, view], np.nan)
        fresh = chances.normal(*key, "fresh", view, shape=(17, 3))[frame] if len(frame) else np.zeros((0, 17, 3))
        low, high = box_about(keypoints)
        unit = np.sqrt(BOX_SHARE * (high - low).prod(axis=-1))[:, None, None] * np.reshape(COCO17.sigmas, (-1, 1))
        keypoints += _SCATTER * unit * fresh[..., :2]
        if config.consistent < 1 and len(frame):
            other = ndtr(chances.normal(*key, "own", view)[since]) >= config.consistent
            poses = chances.normal(*key, "posture", view, shape=(DRAWS + 2,))[since[other]]
            keypoints[other] = _fitted(poses, low[other], high[other])
        scores = sureness(config.score, config.deviation, chances.normal(*key, "score", view)[since], fresh[..., 2])
        yield frame, np.full_like(frame, view), np.full_like(frame, decoy), keypoints, scores


def _fitted(normals: Floats, low: Floats, high: Floats) -> Floats:
    """Poses (r, 17, 2) that fill boxes, from normal numbers (r, DRAWS + 2)."""
    heading, tilt = ndtr(normals[:, DRAWS:]).T
    poses = seen_from(postures(normals[:, :DRAWS]), 2 * np.pi * heading, 0.5 * tilt)
    least, most = poses.min(axis=1, keepdims=True), poses.max(axis=1, keepdims=True)
    return low[:, None] + (poses - least) / (most - least) * (high - low)[:, None]
