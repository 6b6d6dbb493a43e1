"""Phantoms: detections of people who are not there.

Three kinds. Some stand in the room, where shadows and reflections make something like a person, and are seen alike from
all sides: figures in space, projected into every view that contains them. The others are in one picture alone: poses
by themselves, or made of parts of the real people in it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.capture.rendering.optics import appear
from simharness.detector.birth_death import Lives, alive, anew, slots
from simharness.detector.correlation import Chances
from simharness.detector.detection_block import Found, Origin
from simharness.detector.false_positives import LEAST, box_about, reported, sureness
from simharness.detector.phantom_poses import DRAWS, postures, seen_from, turned
from simharness.scenario.sections.detector import Phantoms
from simharness.types.views import Views
from simharness.types.visibility import Visibility

_JITTER, _JITTER_SPACE = 0.004, 0.004  # how still they sit: as a share of the pose's height, and metres
_HEIGHTS = 0.25, 0.75  # of poses, as shares of the image's
_TILT = 0.5  # radians, the most that cameras seem to look down
_WIDTH = 0.36  # least width of a box over its height, where joints lie anywhere in it
_BOX = np.array([0.6, 0.6, 1.75])  # metres, the same in space
_REACH, _FARTHEST = 0.6, 6.0  # of the cameras' distance from what they look at, and metres: where figures stand
_TRIES = 6  # places for a figure that at least two views contain, each nearer to the middle
_LOWER = np.arange(11, 17)  # hips and legs


def phantoms(views: Views, rig: Rig, config: Phantoms, chances: Chances) -> Found:
    """Draw the phantoms of all pictures.

    Their mean number in a view and frame, over all views, is ``config.rate``, of which ``config.views`` are figures in
    space. The number of those in one picture alone is Poisson distributed. More of a rate adds phantoms and changes
    none; each keeps its slot and its number, which a figure has in all views alike.

    Figures are projected by ``rig`` into the pictures: where cameras drift away from it, they stand a little beside
    where they would.

    Args:
        views: the truth in the pictures, T frames of V cameras.
        rig: the cameras that take the pictures.
        config: the dials.
        chances: of the sequence.
    """
    frames = len(views)
    if config.rate == 0.0:
        return Found.nothing(frames, len(rig), 0)
    return Found.joined([_standing(rig, config, chances), _alone(views, rig, config, chances)])


def _reported(
    rig: Rig, frames: int, rows: list[tuple[Integers, ...]], keypoints: list[Floats], scores: list[Floats]
) -> Found:
    """Phantoms of all views, from each view's frames, views, slots, numbers, keypoints and scores."""
    frame, view, slot, number = (np.concatenate(column) for column in zip(*rows, strict=True))
    poses, sure = np.concatenate(keypoints), np.concatenate(scores)
    return reported(rig, frames, (frame, view, slot), poses, sure, origin=Origin.PHANTOM, number=number)


# ---- Figures in space.


def _standing(rig: Rig, config: Phantoms, chances: Chances) -> Found:
    """Those that stand in the room.

    A figure that c of V views contain counts c times. So those are left out, by chance, that many views contain: one is
    kept with a chance that falls with 1 / c, and the mean number in a view is as asked whatever the rig.
    """
    rate = config.rate * config.views * len(rig)
    lives = Lives(chances, ("phantoms", "room"), config.life, most=rate)
    possible = np.flatnonzero(lives.mark < rate)
    figures = postures(lives.normal("posture", DRAWS)[possible])
    figures = turned(figures, 2 * np.pi * lives.uniform("heading")[possible])
    anywhere = (lives.uniform("anywhere", 17, 3)[possible] - [0.5, 0.5, 0.0]) * _BOX
    plausible = lives.uniform("plausible")[possible] < config.plausible
    figures = np.where(plausible[:, None, None], figures, anywhere)
    figures, contained = _placed(rig, figures, lives.uniform("place", _TRIES, 2)[possible])
    count = contained.sum(axis=1)
    kept = lives.mark[possible] * count < rate
    kept &= count > 0
    thing = possible[kept]

    event, frame = alive(lives.born[thing], lives.last[thing])
    number = lives.number[thing[event]]
    joints = figures[kept][event] + _JITTER_SPACE * anew(chances, *lives.key, number=number, frame=frame, size=3)
    slot, together = slots(lives.born[thing], lives.last[thing]), lives.normal("score")[thing]
    rows: list[tuple[Integers, ...]] = []
    keypoints, scores = [], []
    for view, camera in enumerate(rig):
        mine = contained[kept][event, view]
        rows.append((frame[mine], np.full(mine.sum(), view), slot[event[mine]], lives.name[thing[event[mine]]]))
        keypoints.append(appear(camera, joints[mine]))
        apart = anew(chances, *lives.key, "score", view, number=number[mine], frame=frame[mine], size=1)
        scores.append(sureness(config.score, config.deviation, together[event[mine]], apart[..., 0]))
    return _reported(rig, len(chances.time), rows, keypoints, scores)


def _placed(rig: Rig, figures: Floats, draws: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Put figures (n, 17, 3) where cameras look, by draws (n, tries, 2), and say which views (n, V) contain each."""
    middle, reach = focus(rig)
    placed, contained = figures.copy(), np.zeros((len(figures), len(rig)), bool)
    left = np.arange(len(figures))
    for k in range(_TRIES):
        radius = reach * (1 - k / _TRIES) * np.sqrt(draws[left, k, 0])
        angle = 2 * np.pi * draws[left, k, 1]
        place = middle + np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        placed[left] = figures[left] + np.pad(place, ((0, 0), (0, 1)))[:, None]
        for view, camera in enumerate(rig):
            contained[left, view] = camera.inside(appear(camera, placed[left])).sum(axis=-1) >= LEAST
        left = left[contained[left].sum(axis=1) < 2]
    return placed, contained


def focus(rig: Rig) -> tuple[Floats, float]:
    """What the cameras look at: the point (2,) on the floor nearest to their axes, and how far about it they see, m.

    Where the axes are parallel, a point ahead of them.
    """
    axes = np.stack([camera.R[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]  # of a vector, what is at right angles to an axis
    ahead = (rig.centers + 4.0 * axes).mean(axis=0)
    weight = 1e-3
    point = np.linalg.solve(
        across.sum(axis=0) + weight * np.eye(3), (across @ rig.centers[:, :, None]).sum(axis=0)[:, 0] + weight * ahead
    )
    away = float(np.median(np.linalg.norm(rig.centers - point, axis=1)))
    return point[:2], min(_REACH * away, _FARTHEST)


# ---- Those in one picture alone.


def _alone(views: Views, rig: Rig, config: Phantoms, chances: Chances) -> Found:
    """Those of every view by itself."""
    rate = config.rate * (1 - config.views)
    rows: list[tuple[Integers, ...]] = []
    keypoints, scores = [], []
    for view in range(len(rig)):
        lives = Lives(chances, ("phantoms", "view", view), config.life, most=rate)
        thing = np.flatnonzero(lives.mark < rate)
        event, frame = alive(lives.born[thing], lives.last[thing])
        noise = anew(chances, *lives.key, number=lives.number[thing[event]], frame=frame, size=3)
        poses = _poses(lives, thing, rig[view].size, config.plausible)[event]
        if config.parts > 0:
            made = lives.uniform("parts")[thing][event] < config.parts
            poses[made] = _of_parts(views, view, lives, thing[event[made]], frame[made], poses[made])
        low, high = box_about(poses)
        keypoints.append(poses + _JITTER * (high - low)[:, None, 1:] * noise[..., :2])
        scores.append(sureness(config.score, config.deviation, lives.normal("score")[thing][event], noise[..., 2]))
        slot = slots(lives.born[thing], lives.last[thing])
        rows.append((frame, np.full(len(frame), view), slot[event], lives.name[thing[event]]))
    return _reported(rig, len(views), rows, keypoints, scores)


def _poses(lives: Lives, thing: Integers, size: tuple[int, int], plausible: float) -> Floats:
    """Poses by themselves, (n, 17, 2) pixels: upright people, or joints anywhere in their boxes.

    At most a quarter of a box's width and height is beyond the image's border, so there is always something to be seen.
    """
    heading, tilt, height = lives.uniform("view", 3)[thing].T
    poses = seen_from(postures(lives.normal("posture", DRAWS)[thing]), 2 * np.pi * heading, _TILT * tilt)
    width = np.maximum(np.ptp(poses[..., 0], axis=1), _WIDTH)
    box = np.stack([width, np.ones(len(width))], axis=-1)
    anywhere = (lives.uniform("anywhere", 17, 2)[thing] - 0.5) * box[:, None]
    upright = lives.uniform("plausible")[thing] < plausible
    scale = (_HEIGHTS[0] + (_HEIGHTS[1] - _HEIGHTS[0]) * height) * size[1]
    margin = 0.25 * scale[:, None] * box
    place = margin + lives.uniform("place", 2)[thing] * (np.array(size) - 2 * margin)
    return place[:, None] + scale[:, None, None] * np.where(upright[:, None, None], poses, anywhere)


def _of_parts(views: Views, view: int, lives: Lives, thing: Integers, frame: Integers, otherwise: Floats) -> Floats:
    """Poses (r, 17, 2) made of parts of the people in pictures; ``otherwise`` where too little of anybody is there.

    The head, trunk and arms of one, and the legs of whoever is nearest, if that is within the height of a person;
    otherwise the same one's legs, displaced and scaled. They go along with the people.
    """
    people = views.pixels.shape[2]
    if not people or not len(thing):
        return otherwise
    priority = np.stack([lives.uniform(f"donor{person}") for person in range(people)], axis=-1)[thing]
    moved = lives.normal("displaced", 3)[thing]
    seen = views.visibility[frame, view] != Visibility.OUTSIDE  # (r, P, 17)
    points = np.where(seen[..., None], views.pixels[frame, view], np.nan)
    boxes = views.boxes[frame, view]
    present = seen.sum(axis=-1) >= LEAST
    row = np.arange(len(thing))
    donor = np.where(present, priority, np.inf).argmin(axis=-1)
    size = boxes[row, donor, 2:]

    apart = np.linalg.norm(boxes[..., :2] + boxes[..., 2:] / 2 - (boxes[row, donor, :2] + size / 2)[:, None], axis=-1)
    apart = np.where(present & (np.arange(people) != donor[:, None]), apart, np.inf)
    other = apart.argmin(axis=-1)
    near = apart[row, other] < np.maximum(size[:, 1], boxes[row, other, 3])

    poses = points[row, donor]
    own = poses[:, _LOWER]
    middle = own[:, :2].mean(axis=1, keepdims=True)
    legs = middle + np.exp(0.15 * moved[:, :1, None]) * (own - middle) + (0.2 * moved[:, 1:] * size)[:, None]
    poses[:, _LOWER] = np.where(near[:, None, None], points[row, other][:, _LOWER], legs)
    return np.where(present.any(axis=-1)[:, None, None] & _enough(poses), poses, otherwise)


def _enough(poses: Floats) -> NDArray[np.bool_]:
    return (np.isfinite(poses).all(axis=-1).sum(axis=-1) >= LEAST)[:, None, None]
