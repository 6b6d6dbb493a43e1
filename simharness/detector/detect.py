"""The simulated 2D detector: what is visible, seen with the errors of a real one.

Every draw has its own keyed stream and is made for the whole sequence before anything is masked. So turning one
dial changes no other draw, and more of one error only adds to what less of it did.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections
from mvpose.camera import Rig
from simharness.detector.delivery import arriving, delivered
from simharness.detector.phantoms import phantoms
from simharness.detector.truth import GOOD_BELOW, MISS_FROM, KeypointError, Truth
from simharness.random import stream
from simharness.rendering.views import Views
from simharness.rendering.visibility import Visibility
from simharness.scenario.models import Detector
from simharness.scene.sequence import Sequence

Floats = NDArray[np.float64]

BOX_SHARE = 0.53  # of a person's box is the person (Ronchi & Perona): OKS areas where no mask is given

# A detector places a hidden joint by the rest of the pose, so less well, and says so in its score.
_SPREAD = {Visibility.VISIBLE: 1.0, Visibility.SELF_OCCLUDED: 1.5}
_SPREAD_HIDDEN = 2.5
_SCORE = {Visibility.VISIBLE: 0.9, Visibility.SELF_OCCLUDED: 0.65}
_SCORE_HIDDEN = 0.5
_SCORE_NOISE = 0.08
_SCORE_PER_SIGMA = 0.08  # what an error of one OKS sigma costs


def detect(
    sequence: Sequence, views: Views, rig: Rig, config: Detector, *, seed: int
) -> list[tuple[Detections, Truth]]:
    """Detect the people of every frame in every view.

    A repeated picture gives the detections of the frame that it was taken in.

    Args:
        sequence: where everyone is, T frames.
        views: the same in the V pictures.
        rig: the cameras, for the sizes of their images.
        config: the error rates.
        seed: of the scenario.

    Returns:
        For every frame the detections, ordered by view and then by falling box score as detectors give them,
        and the truth about them.
    """
    keypoints, scores, error = _keypoints(views, config, seed)
    boxes, box_scores, found = _boxes(views, rig, config, seed)
    found &= (scores > 0).any(axis=-1)
    # A detector finds the same in the same picture, and nothing in one that never arrives.
    keypoints, scores, error, boxes, box_scores, found = (
        delivered(each, views.source) for each in (keypoints, scores, error, boxes, box_scores, found)
    )
    found &= (views.source >= 0)[..., None]
    ghosts = phantoms(rig, len(sequence), rate=config.phantoms, seed=seed)
    ghosts = [arriving(ghosts, sources) for sources in views.source]
    frames = []
    for t in range(len(sequence)):
        view, person = np.nonzero(found[t])
        ghost = ghosts[t]
        m = len(ghost.view)
        view = np.concatenate([view, ghost.view])
        sureness = np.concatenate([box_scores[t][found[t]], ghost.box_scores])
        order = np.lexsort((-sureness, view))
        detections = Detections(
            view[order],
            np.concatenate([keypoints[t][found[t]], ghost.keypoints])[order],
            np.concatenate([scores[t][found[t]], ghost.scores])[order],
            np.concatenate([boxes[t][found[t]], ghost.boxes])[order],
            sureness[order],
            COCO17,
        )
        truth = Truth(
            joints=sequence.joints[t],
            pixels=views.pixels[t],
            visibility=views.visibility[t],
            boxes=views.boxes[t],
            person=np.concatenate([person, np.full(m, -1)])[order],
            error=np.concatenate([error[t][found[t]], np.full((m, len(COCO17)), KeypointError.MISS)])[order],
        )
        frames.append((detections, truth))
    return frames


def _keypoints(views: Views, config: Detector, seed: int) -> tuple[Floats, Floats, NDArray[np.int8]]:
    """Keypoints (T, V, P, J, 2), scores (T, V, P, J) and error classes (T, V, P, J) of everyone in every view."""
    shape = views.visibility.shape
    seen = views.visibility == Visibility.VISIBLE
    outside = views.visibility == Visibility.OUTSIDE
    own = views.visibility == Visibility.SELF_OCCLUDED

    sigma = np.asarray(COCO17.sigmas) * np.sqrt(BOX_SHARE * views.boxes[..., 2:].prod(axis=-1))[..., None]
    spread = np.select([seen, own], [_SPREAD[Visibility.VISIBLE], _SPREAD[Visibility.SELF_OCCLUDED]], _SPREAD_HIDDEN)
    noise = config.jitter * spread[..., None] * _normal(seed, "jitter", shape, 2)
    keypoints = views.pixels + sigma[..., None] * noise
    distance = np.linalg.norm(noise, axis=-1)  # in units of sigma sqrt(area)

    chance = np.select([seen, own], [config.miss_visible, config.miss_self], config.miss_occluded)
    missed = outside | (_uniform(seed, "joint", shape) < chance)
    base = np.select([seen, own], [_SCORE[Visibility.VISIBLE], _SCORE[Visibility.SELF_OCCLUDED]], _SCORE_HIDDEN)
    scores = base + _SCORE_NOISE * _normal(seed, "score", shape) - _SCORE_PER_SIGMA * distance
    scores = np.where(missed, 0.0, np.clip(scores, 0.05, 1.0))

    error = np.select(
        [distance < GOOD_BELOW, distance < MISS_FROM],
        [KeypointError.GOOD, KeypointError.JITTER],
        KeypointError.MISS,
    )
    error = np.where(missed, KeypointError.ABSENT, error).astype(np.int8)
    return np.where(missed[..., None], np.nan, keypoints), scores, error


def _boxes(views: Views, rig: Rig, config: Detector, seed: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Boxes (T, V, P, 4), their scores (T, V, P), and who is found at all, (T, V, P)."""
    shape = views.boxes.shape[:3]
    enough = (views.visibility == Visibility.VISIBLE).sum(axis=-1) >= config.least_visible
    found = enough & (_uniform(seed, "person", shape) >= config.miss_person)
    low, size = views.boxes[..., :2], views.boxes[..., 2:]
    noise = config.box_jitter * _normal(seed, "box", shape, 4) * np.concatenate([size, size], axis=-1)
    image = np.array([camera.size for camera in rig], float)[:, None]
    corner = np.clip(low + noise[..., :2], 0, image - 1)
    opposite = np.clip(low + size + noise[..., 2:], 0, image - 1)
    boxes = np.concatenate([np.minimum(corner, opposite), np.abs(opposite - corner)], axis=-1)
    share = (views.visibility == Visibility.VISIBLE).mean(axis=-1)
    scores = np.clip(0.5 + 0.45 * share + 0.05 * _normal(seed, "box score", shape), 0.05, 1.0)
    return boxes, scores, found


def _normal(seed: int, purpose: str, shape: tuple[int, ...], *more: int) -> Floats:
    """Standard normal draws (T, V, P, ...): one stream a view and person, so that neither shifts the others."""
    return _block(seed, purpose, shape, more, "standard_normal")


def _uniform(seed: int, purpose: str, shape: tuple[int, ...]) -> Floats:
    return _block(seed, purpose, shape, (), "random")


def _block(seed: int, purpose: str, shape: tuple[int, ...], more: tuple[int, ...], draw: str) -> Floats:
    frames, views, people, *joints = shape
    result = np.empty((*shape, *more))
    for v in range(views):
        for p in range(people):
            result[:, v, p] = getattr(stream(seed, "detector", purpose, v, p), draw)((frames, *joints, *more))
    return result
