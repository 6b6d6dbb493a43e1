"""False positives of every kind: their postures, scores and boxes, and their place in a block of detections.

Postures are upright people in space, each from a few standard normal numbers. They stand for what a detector sees in
shadows and coats, so they need not be exact. Lengths are shares of stature (Drillis & Contini, Body segment parameters,
1966).

Those of decoys (posters, mannequins, coat stands, mirror images) are made here, phantoms in
:mod:`simharness.detector.phantoms`.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mvpose import COCO17
from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.draws import KeyedDraws, logistic
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import BOX_SHARE
from simharness.scenario.sections.detector_section import DecoyHitsSection
from simharness.types.views import Views

MIN_JOINTS = 6
"""Fewest joints in a picture that a detector takes for a person."""

_COMMON = np.sqrt(0.5)  # half the variance of scores lasts as long as the detection, half is drawn for each joint

NORMALS = 20
"""Number of standard normal numbers that determine one posture."""

_SEATED = 0.15  # share of half-seated postures
_THIGH, _SHANK, _ANKLE = 0.245, 0.246, 0.039
_UPPER_ARM, _FOREARM, _TRUNK = 0.186, 0.146, 0.288
_HIP, _SHOULDER = 0.050, 0.115  # half the distance between the centres of the two joints
# Nose, eyes and ears relative to the middle of the shoulders, of a person who looks along x.
_FACE = np.array(
    [(0.062, 0.0, 0.100), (0.052, 0.018, 0.118), (0.052, -0.018, 0.118), (0.0, 0.043, 0.110), (0.0, -0.043, 0.110)]
)


def keypoint_scores(usual: float, deviation: float, common: Floats, separate: Floats) -> Floats:
    """Return keypoint scores about a usual score, (..., J).

    Args:
        usual: usual score.
        deviation: standard deviation on the logit scale.
        common: standard normal numbers of the detections, (...).
        separate: standard normal numbers of their joints, (..., J).
    """
    return logistic(usual, deviation * _COMMON * (common[..., None] + separate))


def bounding_box(points: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and the highest coordinates, (..., 2) each, of the finite points of (..., J, 2).

    Both are NaN where no point is finite.
    """
    known = np.isfinite(points)
    low, high = np.where(known, points, np.inf).min(axis=-2), np.where(known, points, -np.inf).max(axis=-2)
    some = low <= high
    return np.where(some, low, np.nan), np.where(some, high, np.nan)


def inside(rig: Rig, view: Integers, keypoints: Floats) -> NDArray[np.bool_]:
    """Return which keypoints (r, J, 2) in the pictures of views (r,) lie on the image, (r, J)."""
    size = np.array([camera.size for camera in rig], float)[view][:, None]
    return np.all((keypoints >= -0.5) & (keypoints < size - 0.5), axis=-1)


def false_positive_block(
    rig: Rig,
    frames: int,
    where: tuple[Integers, Integers, Integers],
    keypoints: Floats,
    scores: Floats,
    *,
    origin: Origin,
    number: Integers,
) -> DetectionBlock:
    """Return a block with r false positives.

    Keypoints off the image are absent; the box spans the others, and its score is the mean of theirs.

    Args:
        rig: cameras, for the sizes of their images.
        frames: T.
        where: frame, view and slot of each detection, (r,) each.
        keypoints: pixels, (r, J, 2), NaN where absent.
        scores: scores of the keypoints, (r, J).
        origin: origin of all of them.
        number: number of each among the detections of this origin, (r,).
    """
    _, view, slot = where
    block = DetectionBlock.empty(frames, len(rig), int(slot.max(initial=-1)) + 1)
    seen = inside(rig, view, keypoints) & (scores > 0)
    keypoints, scores = np.where(seen[..., None], keypoints, np.nan), np.where(seen, scores, 0.0)
    low, high = bounding_box(keypoints)
    count = seen.sum(axis=-1)
    block.present[where] = count > 0
    block.keypoints[where], block.scores[where] = keypoints, scores
    block.origin[where], block.number[where] = origin, number
    block.boxes[where] = np.where(count[:, None] > 0, np.concatenate([low, high - low], axis=-1), 0.0)
    block.box_scores[where] = scores.sum(axis=-1) / np.maximum(count, 1)
    return block


def postures(normals: Floats) -> Floats:
    """Return COCO-17 joints (n, 17, 3), metres, from standard normal numbers (n, NORMALS).

    The people stand on z = 0 at the origin and face along x: upright or half seated, arms hanging, bent or raised.
    """
    stature = np.clip(1.70 + 0.10 * normals[:, 0], 1.45, 1.95)
    seated = (ndtr(normals[:, 1]) < _SEATED)[:, None]
    legs, arms = normals[:, 6:12].reshape(-1, 2, 3), normals[:, 12:18].reshape(-1, 2, 3)
    side = np.array([1.0, -1.0])

    hips = _points(0.0, _HIP * side, 0.0, shape=legs.shape[:2])
    flexed = np.where(seated, 1.2, 0.10) + 0.15 * legs[..., 0]
    bent = np.where(seated, 1.3, 0.08) + 0.15 * np.abs(legs[..., 1])
    abducted = 0.06 + 0.05 * np.abs(legs[..., 2])
    knees = hips + _THIGH * _limb_directions(flexed, side * abducted)
    ankles = knees + _SHANK * _limb_directions(flexed - bent, side * abducted)

    pitch = 0.05 + 0.08 * normals[:, 2] + 0.1 * seated[:, 0]
    roll = 0.05 * normals[:, 3]
    chest = _TRUNK * np.stack([np.sin(pitch), np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=-1)
    shoulders = chest[:, None] + _points(0.0, _SHOULDER * side, 0.0, shape=arms.shape[:2])
    raised = 0.1 + 0.45 * arms[..., 0]
    apart = 0.12 + 0.25 * np.abs(arms[..., 1])
    elbows = shoulders + _UPPER_ARM * _limb_directions(raised, side * apart)
    folded = np.minimum(0.25 + 0.6 * np.abs(arms[..., 2]), 2.3)
    wrists = elbows + _FOREARM * _limb_directions(raised + folded, side * apart * 0.5)

    face = rotate_about_z(np.broadcast_to(_FACE, (len(normals), 5, 3)), 0.35 * normals[:, 4])
    face = chest[:, None] + _nod(face, normals)
    joints = np.concatenate([face, shoulders, elbows, wrists, hips, knees, ankles], axis=1)
    joints[..., 2] += _ANKLE - ankles[..., 2].min(axis=1, keepdims=True)
    return joints * stature[:, None, None]


def rotate_about_z(points: Floats, yaw: Floats) -> Floats:
    """Rotate points (n, k, 3) about the z axis by yaw (n,), radians."""
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def project_upright(points: Floats, yaw: Floats, tilt: Floats) -> Floats:
    """Project points (n, k, 3) orthographically, x to the right and y down, into boxes of height 1 centred at 0.

    Args:
        points: people who face along x.
        yaw: rotation of each person away from the camera, (n,), radians.
        tilt: angle by which the camera looks down, (n,), radians.

    Returns:
        Points in the picture, (n, k, 2), in units of the height of the box.
    """
    x, y, z = np.moveaxis(rotate_about_z(points, yaw), -1, 0)
    flat = np.stack([y, x * np.sin(tilt)[:, None] - z * np.cos(tilt)[:, None]], axis=-1)
    low, high = flat.min(axis=1, keepdims=True), flat.max(axis=1, keepdims=True)
    return (flat - (low + high) / 2) / (high - low)[..., 1:]


def _nod(face: Floats, normals: Floats) -> Floats:
    """Return faces (n, 5, 3) pitched by the angles that the normal numbers (n, NORMALS) determine."""
    c, s = np.cos(0.12 * normals[:, 5])[:, None], np.sin(0.12 * normals[:, 5])[:, None]
    x, y, z = np.moveaxis(face, -1, 0)
    return np.stack([c * x - s * z, y, s * x + c * z], axis=-1)


def _limb_directions(forward: Floats, outward: Floats) -> Floats:
    """Return unit vectors (n, 2, 3) of limbs that point down, rotated forward and then outward by angles (n, 2)."""
    return np.stack([np.sin(forward) * np.cos(outward), np.sin(outward), -np.cos(forward) * np.cos(outward)], axis=-1)


def _points(x: float, y: Floats, z: float, *, shape: tuple[int, int]) -> Floats:
    """Return points (*shape, 3) with the coordinates x, y and z; ``y`` has one value for each side of the body."""
    return np.stack(np.broadcast_arrays(np.full(shape, x), y, z), axis=-1)


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
