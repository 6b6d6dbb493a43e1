"""Random scenes of one frame, and relations: changes of a frame that must change nothing in its people.

A relation takes a :class:`Frame` and a generator. It returns the changed frame, and the function that maps the joints
(n, J, 3) of the changed frame's people to those of the original.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from people import STANDING, look_at

from mvpose import COCO17, PANOPTIC19, SHELF14, Camera, Detections, Rig, Skeleton
from mvpose.skeleton import coco17_to_shelf14


class Frame(NamedTuple):
    """One frame of a recording."""

    rig: Rig
    detections: Detections


Relation = Callable[[Frame, np.random.Generator], tuple[Frame, Callable[[np.ndarray], np.ndarray]]]


def frame(seed: int) -> Frame:
    """Two to six cameras, one to five people in poses of their own, and a detector that errs in every way.

    Scores are alike in a third of the frames (so ties are common), a third have descriptors, and a quarter two cameras.
    """
    rng = np.random.default_rng([seed, 17])
    views = int(rng.choice([2, 3, 4, 5, 6], p=[0.25, 0.2, 0.2, 0.2, 0.15]))
    bodies, cameras = people(int(rng.integers(1, 6)), rng), rig(views, rng)
    keypoints = cameras.project(bodies)
    view, person = (index.ravel() for index in np.indices(keypoints.shape[:2]))
    order = rng.permutation(len(view))[: max(2, round(len(view) * rng.choice([1.0, 0.9])))]
    view, person = view[order], person[order]
    keypoints = keypoints[view, person] + rng.choice([1.5, 4.0, 8.0]) * rng.standard_normal((len(view), 17, 2))
    inverted = rng.random(len(view)) < 0.05
    keypoints[inverted] = keypoints[inverted][:, list(COCO17.mirror)]
    wrong = rng.random((len(view), 17)) < 0.03
    keypoints[wrong] += rng.normal(0, 80, (int(wrong.sum()), 2))
    phantoms = int(rng.integers(0, 3))
    view = np.concatenate([view, rng.integers(0, views, phantoms)])
    keypoints = np.concatenate(
        [keypoints, rng.uniform(300, 600, (phantoms, 1, 2)) + 70 * rng.standard_normal((phantoms, 17, 2))]
    )
    scores = np.full(keypoints.shape[:2], 0.9)
    if rng.random() < 2 / 3:
        scores = rng.uniform(0.3, 1.0, scores.shape)
    scores[rng.random(scores.shape) < rng.choice([0.0, 0.1, 0.3])] = 0.0
    detections = Detections.from_keypoints(view, keypoints, scores)
    if rng.random() < 1 / 3:
        looks = rng.standard_normal((len(bodies), 32))
        seen = np.concatenate([looks[person], rng.standard_normal((phantoms, 32))])
        detections = replace(detections, descriptors=seen + 0.5 * rng.standard_normal(seen.shape))
    return Frame(cameras, detections)


def people(count: int, rng: np.random.Generator) -> np.ndarray:
    """People in a row, in poses, headings and sizes of their own, (count, 17, 3)."""
    bodies = []
    for k in range(count):
        body = STANDING * rng.uniform(0.85, 1.1)
        for joint, parts in ((7, [9]), (8, [10]), (5, [7, 9]), (6, [8, 10]), (13, [15]), (14, [16]), (11, [13, 15])):
            body[parts] = (body[parts] - body[joint]) @ _rotation(rng.normal(0, 0.5, 3)).T + body[joint]
        body[:5] = (body[:5] - [0, 0, body[5, 2]]) @ _rotation([0, 0, rng.normal(0, 0.5)]).T + [0, 0, body[5, 2]]
        body = body @ _rotation([0, 0, rng.uniform(0, 2 * np.pi)]).T
        bodies.append(body + [0.8 * (k - (count - 1) / 2), rng.uniform(-0.6, 0.6), 0])
    return np.array(bodies)


def skeletons() -> dict[str, tuple[Skeleton, Callable[[np.ndarray], np.ndarray]]]:
    """Skeletons by name, each with the function from the joints of COCO-17, (..., 17, 3), to its own."""
    # Every bone of this tree is on the left side or crosses over from it.
    parents = list(COCO17.parents)
    parents[COCO17.index("right_hip")] = COCO17.index("left_hip")
    one_sided = replace(COCO17, name="hung on one side", parents=tuple(parents))
    coco = [COCO17.index(joint) if joint in COCO17.joints else -1 for joint in PANOPTIC19.joints]

    def panoptic19(joints: np.ndarray) -> np.ndarray:
        result = joints[..., coco, :]
        result[..., PANOPTIC19.index("neck"), :] = joints[..., [5, 6], :].mean(axis=-2)
        result[..., PANOPTIC19.index("mid_hip"), :] = joints[..., [11, 12], :].mean(axis=-2)
        return result

    return {
        "shelf14": (SHELF14, coco17_to_shelf14),
        "panoptic19": (PANOPTIC19, panoptic19),
        one_sided.name: (one_sided, _same),
    }


def _rotation(vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rig(views: int, rng: np.random.Generator) -> Rig:
    """Cameras around the origin, a third of the rigs with distorting lenses."""
    bearings = rng.uniform(0, 2 * np.pi) + (np.arange(views) + rng.uniform(-0.2, 0.2, views)) * 5.2 / (views + 1)
    places = [
        [r * np.cos(a), r * np.sin(a), rng.uniform(1.2, 3.0)]
        for a, r in zip(bearings, rng.uniform(4, 6, views), strict=True)
    ]
    lens = [-0.1, 0.02, 0.001, -0.001, 0.0] if rng.random() < 0.3 else None
    return Rig([look_at(place, [0, 0, 1.0], distortion=lens) for place in places])


def _like(detections: Detections, which: np.ndarray, **fields: np.ndarray) -> Detections:
    """Return some detections, by index in a new order, with some fields replaced."""
    arrays = {name: getattr(detections, name)[which] for name in ("view", "keypoints", "scores", "boxes", "box_scores")}
    if detections.descriptors is not None:
        arrays["descriptors"] = detections.descriptors[which]
    return replace(detections, **(arrays | fields))


def _same(joints: np.ndarray) -> np.ndarray:
    return joints


def permuted_detections(given: Frame, rng: np.random.Generator):
    return Frame(given.rig, _like(given.detections, rng.permutation(len(given.detections)))), _same


def permuted_cameras(given: Frame, rng: np.random.Generator):
    order = rng.permutation(len(given.rig))
    rig = Rig([given.rig[view] for view in order])
    number = np.argsort(order)
    return Frame(rig, replace(given.detections, view=number[given.detections.view])), _same


def moved_world(given: Frame, rng: np.random.Generator):
    """Another origin and other axes of the world."""
    turn, shift = _rotation(rng.normal(0, 1.5, 3)), rng.uniform(-10, 10, 3)
    rig = Rig([Camera(c.K, c.R @ turn.T, c.t - c.R @ turn.T @ shift, c.distortion, c.size) for c in given.rig])
    return Frame(rig, given.detections), lambda joints: (joints - shift) @ turn


def mirrored_world(given: Frame, rng: np.random.Generator):
    """The world and all pictures seen in a mirror, where left hands are right hands."""
    flip, mirror = np.diag([-1.0, 1.0, 1.0]), list(given.detections.skeleton.mirror)
    cameras, keypoints, boxes = [], given.detections.keypoints.copy(), given.detections.boxes.copy()
    for c in given.rig:
        K, distortion = c.K.copy(), c.distortion.copy()
        K[0, 1], K[0, 2], distortion[3] = -K[0, 1], c.size[0] - 1 - K[0, 2], -distortion[3]  # p2 bends sideways
        cameras.append(Camera(K, flip @ c.R @ flip, flip @ c.t, distortion, c.size))
    width = np.array([c.size[0] for c in given.rig])[given.detections.view]
    keypoints[..., 0] = width[:, None] - 1 - keypoints[..., 0]
    boxes[:, 0] = width - 1 - boxes[:, 0] - boxes[:, 2]
    scores = given.detections.scores[:, mirror]
    changed = replace(given.detections, keypoints=keypoints[:, mirror], scores=scores, boxes=boxes)
    return Frame(Rig(cameras), changed), lambda joints: joints[:, mirror] @ flip


def doubled_detections(given: Frame, rng: np.random.Generator):
    """Every detection given twice."""
    twice = rng.permutation(np.tile(np.arange(len(given.detections)), 2))
    return Frame(given.rig, _like(given.detections, twice)), _same


def idle_cameras(given: Frame, rng: np.random.Generator):
    """More cameras, which detect nothing, somewhere among the others."""
    more = [look_at([*rng.uniform(3, 5, 2), 2.0], [0, 0, 1.0]) for _ in range(int(rng.integers(1, 4)))]
    cameras = [*given.rig, *more]
    order = rng.permutation(len(cameras))
    number = np.argsort(order)
    rig = Rig([cameras[view] for view in order])
    return Frame(rig, replace(given.detections, view=number[given.detections.view])), _same


def blank_detections(given: Frame, rng: np.random.Generator):
    """More detections, without any keypoint."""
    count, more = len(given.detections), int(rng.integers(1, 6))
    which = rng.permutation(np.concatenate([np.arange(count), np.full(more, -1)]))
    blank = which < 0
    scores = np.where(blank[:, None], 0.0, given.detections.scores[which])
    view = np.where(blank, rng.integers(0, len(given.rig), len(which)), given.detections.view[which])
    return Frame(given.rig, _like(given.detections, which, scores=scores, view=view)), _same


RELATIONS: dict[str, tuple[Relation, float]] = {
    "permuted detections": (permuted_detections, 1e-6),
    "permuted cameras": (permuted_cameras, 1e-6),
    "moved world": (moved_world, 1e-5),
    "mirrored world": (mirrored_world, 1e-6),
    "doubled detections": (doubled_detections, 1e-6),
    "idle cameras": (idle_cameras, 1e-6),
    "blank detections": (blank_detections, 1e-6),
}
"""Every relation, and how far it may move a joint by rounding, metres."""


def movement(original: np.ndarray, changed: np.ndarray) -> float:
    """Return the greatest distance between corresponding joints of the same people in the same order, metres.

    It is infinite if the number of people or the joints that they have differ.
    """
    if original.shape != changed.shape or (np.isnan(original) != np.isnan(changed)).any():
        return np.inf
    distance = np.linalg.norm(original - changed, axis=2)
    return float(np.nanmax(distance)) if np.isfinite(distance).any() else 0.0
