"""Phantoms: detections that show no person.

There are three kinds. Figures stand in the room, where shadows and reflections resemble a person, and are seen alike
from all sides: they are projected into every view that contains them. The others are in one picture only: separate
poses, or poses made of parts of the real people in that picture.

An M/M/∞ birth-death process decides when each one appears and how long it lasts.
"""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtr

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector import false_positives
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.draws import Key, KeyedDraws
from simharness.detector.steps import Context, StepStage, step
from simharness.scenario.sections.detector_section import PhantomsSection
from simharness.types.random_streams import stream
from simharness.types.views import Views, Visibility
from simharness.world.rigs.projection import project_to_image

_JITTER, _JITTER_SPACE = 0.004, 0.004  # motion of phantoms: as a share of the pose's height, and in metres
_HEIGHTS = 0.25, 0.75  # heights of poses, as shares of the image's height
_TILT = 0.5  # radians, the largest angle by which cameras appear to look down
_WIDTH = 0.36  # least width of a box over its height, where joints lie anywhere in it
_BOX = np.array([0.6, 0.6, 1.75])  # metres, the same box in space
_REACH, _FARTHEST = 0.6, 6.0  # radius where figures stand: share of the cameras' distance from the centre, and metres
_TRIES = 6  # places tried for a figure until at least two views contain it, each nearer to the centre
_LOWER = np.arange(11, 17)  # hips and legs


@step("phantoms", stage=StepStage.FALSE_POSITIVES, sections=("phantoms",))
def add_phantoms(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Append the phantoms."""
    drawn = draw_phantoms(context.views, context.rig, context.config.phantoms, context.draws)
    return DetectionBlock.concatenate([block, drawn])


def draw_phantoms(views: Views, rig: Rig, config: PhantomsSection, draws: KeyedDraws) -> DetectionBlock:
    """Draw the phantoms of all pictures.

    Their mean number in a view and frame, over all views, is ``config.rate``; a share ``config.views`` of them are
    figures in space. The number of phantoms in one picture only is Poisson distributed. A higher rate adds phantoms
    and changes none: each keeps its slot and its number. A figure has the same number in all views.

    Figures are projected by ``rig``: where cameras drift from it, the figures stand slightly beside their place.

    Args:
        views: ground truth in the pictures, T frames of V cameras.
        rig: true rig, which takes the pictures.
        config: parameters of phantoms.
        draws: draws of the sequence.
    """
    frames = len(views)
    if config.rate == 0.0:
        return DetectionBlock.empty(frames, len(rig), 0)
    return DetectionBlock.concatenate([_figures(rig, config, draws), _single_view(views, rig, config, draws)])


def _block(
    rig: Rig, frames: int, rows: list[tuple[Integers, ...]], keypoints: list[Floats], scores: list[Floats]
) -> DetectionBlock:
    """Return the phantoms of all views, from the frames, views, slots, numbers, keypoints and scores of each view."""
    frame, view, slot, number = (np.concatenate(column) for column in zip(*rows, strict=True))
    where = (frame, view, slot)
    return false_positives.false_positive_block(
        rig, frames, where, np.concatenate(keypoints), np.concatenate(scores), origin=Origin.PHANTOM, number=number
    )


# ---- Figures in space.


def _figures(rig: Rig, config: PhantomsSection, draws: KeyedDraws) -> DetectionBlock:
    """Draw the figures in the room.

    A figure that c of V views contain counts c times. Therefore figures are kept with a probability proportional to
    1 / c, so that the mean number in a view is the configured rate for every rig.
    """
    rate = config.rate * config.views * len(rig)
    process = BirthDeathProcess(draws, ("phantoms", "room"), config.life, max_rate=rate)
    possible = np.flatnonzero(process.rate_threshold < rate)
    figures = false_positives.postures(process.normal("posture", false_positives.NORMALS)[possible])
    figures = false_positives.rotate_about_z(figures, 2 * np.pi * process.uniform("heading")[possible])
    anywhere = (process.uniform("anywhere", 17, 3)[possible] - [0.5, 0.5, 0.0]) * _BOX
    plausible = process.uniform("plausible")[possible] < config.plausible
    figures = np.where(plausible[:, None, None], figures, anywhere)
    figures, contained = _placed(rig, figures, process.uniform("place", _TRIES, 2)[possible])
    count = contained.sum(axis=1)
    kept = process.rate_threshold[possible] * count < rate
    kept &= count > 0
    individual = possible[kept]

    row, frame = frames_alive(process.born[individual], process.last[individual])
    offset = process.offset[individual[row]]
    noise = frame_noise(draws, *process.key, offset=offset, frame=frame, size=3)
    joints = figures[kept][row] + _JITTER_SPACE * noise
    slot = assign_slots(process.born[individual], process.last[individual])
    common = process.normal("score")[individual]
    rows: list[tuple[Integers, ...]] = []
    keypoints, scores = [], []
    for view, camera in enumerate(rig):
        seen = contained[kept][row, view]
        number = process.identifier[individual[row[seen]]]
        rows.append((frame[seen], np.full(seen.sum(), view), slot[row[seen]], number))
        keypoints.append(project_to_image(camera, joints[seen]))
        separate = frame_noise(draws, *process.key, "score", view, offset=offset[seen], frame=frame[seen], size=1)
        scores.append(
            false_positives.keypoint_scores(config.score, config.deviation, common[row[seen]], separate[..., 0])
        )
    return _block(rig, len(draws.time), rows, keypoints, scores)


def _placed(rig: Rig, figures: Floats, uniform: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Place figures (n, 17, 3) where the cameras look.

    Args:
        rig: the V cameras.
        figures: joints relative to the place, (n, 17, 3) metres.
        uniform: uniform draws for radius and angle of every try, (n, tries, 2).

    Returns:
        The placed figures (n, 17, 3), and which views contain each, (n, V).
    """
    center, reach = viewed_area(rig)
    placed, contained = figures.copy(), np.zeros((len(figures), len(rig)), bool)
    left = np.arange(len(figures))
    for k in range(_TRIES):
        radius = reach * (1 - k / _TRIES) * np.sqrt(uniform[left, k, 0])
        angle = 2 * np.pi * uniform[left, k, 1]
        place = center + np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        placed[left] = figures[left] + np.pad(place, ((0, 0), (0, 1)))[:, None]
        for view, camera in enumerate(rig):
            contained[left, view] = (
                camera.inside(project_to_image(camera, placed[left])).sum(axis=-1) >= false_positives.MIN_JOINTS
            )
        left = left[contained[left].sum(axis=1) < 2]
    return placed, contained


def viewed_area(rig: Rig) -> tuple[Floats, float]:
    """Return the centre (2,) and the radius, metres, of the floor area that the cameras look at.

    The centre is the point nearest to the optical axes; where these are parallel, a point ahead of the cameras.
    """
    axes = np.stack([camera.R[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]  # projection to the plane perpendicular to an axis
    ahead = (rig.centers + 4.0 * axes).mean(axis=0)
    weight = 1e-3
    point = np.linalg.solve(
        across.sum(axis=0) + weight * np.eye(3), (across @ rig.centers[:, :, None]).sum(axis=0)[:, 0] + weight * ahead
    )
    distance = float(np.median(np.linalg.norm(rig.centers - point, axis=1)))
    return point[:2], min(_REACH * distance, _FARTHEST)


# ---- Phantoms in one picture only.


def _single_view(views: Views, rig: Rig, config: PhantomsSection, draws: KeyedDraws) -> DetectionBlock:
    """Draw the phantoms of each view, independently of the other views."""
    rate = config.rate * (1 - config.views)
    rows: list[tuple[Integers, ...]] = []
    keypoints, scores = [], []
    for view in range(len(rig)):
        process = BirthDeathProcess(draws, ("phantoms", "view", view), config.life, max_rate=rate)
        individual = np.flatnonzero(process.rate_threshold < rate)
        row, frame = frames_alive(process.born[individual], process.last[individual])
        offset = process.offset[individual[row]]
        noise = frame_noise(draws, *process.key, offset=offset, frame=frame, size=3)
        poses = _poses(process, individual, rig[view].size, config.plausible)[row]
        if config.parts > 0:
            made = process.uniform("parts")[individual][row] < config.parts
            poses[made] = _poses_of_parts(views, view, process, individual[row[made]], frame[made], poses[made])
        low, high = false_positives.bounding_box(poses)
        keypoints.append(poses + _JITTER * (high - low)[:, None, 1:] * noise[..., :2])
        common = process.normal("score")[individual][row]
        scores.append(false_positives.keypoint_scores(config.score, config.deviation, common, noise[..., 2]))
        slot = assign_slots(process.born[individual], process.last[individual])
        rows.append((frame, np.full(len(frame), view), slot[row], process.identifier[individual[row]]))
    return _block(rig, len(views), rows, keypoints, scores)


def _poses(process: "BirthDeathProcess", individual: Integers, size: tuple[int, int], plausible: float) -> Floats:
    """Return separate poses, (n, 17, 2) pixels: upright people, or joints anywhere in their boxes.

    At most a quarter of a box's width and height is beyond the border of the image, so part of it is always visible.

    Args:
        process: births and deaths of the phantoms of the view.
        individual: indices of the n individuals.
        size: width and height of the image, pixels.
        plausible: share of upright people.
    """
    heading, tilt, height = process.uniform("view", 3)[individual].T
    normals = process.normal("posture", false_positives.NORMALS)[individual]
    poses = false_positives.project_upright(false_positives.postures(normals), 2 * np.pi * heading, _TILT * tilt)
    width = np.maximum(np.ptp(poses[..., 0], axis=1), _WIDTH)
    box = np.stack([width, np.ones(len(width))], axis=-1)
    anywhere = (process.uniform("anywhere", 17, 2)[individual] - 0.5) * box[:, None]
    upright = process.uniform("plausible")[individual] < plausible
    scale = (_HEIGHTS[0] + (_HEIGHTS[1] - _HEIGHTS[0]) * height) * size[1]
    margin = 0.25 * scale[:, None] * box
    place = margin + process.uniform("place", 2)[individual] * (np.array(size) - 2 * margin)
    return place[:, None] + scale[:, None, None] * np.where(upright[:, None, None], poses, anywhere)


def _poses_of_parts(
    views: Views, view: int, process: "BirthDeathProcess", individual: Integers, frame: Integers, default: Floats
) -> Floats:
    """Return poses (r, 17, 2) made of parts of the people in the pictures; they move along with these people.

    Head, trunk and arms are those of one person. The legs are those of the nearest other person within the height of
    a person, else the same person's legs, displaced and scaled.

    Args:
        views: ground truth in the pictures.
        view: the view.
        process: births and deaths of the phantoms of the view.
        individual: individual of each row, (r,).
        frame: frame of each row, (r,).
        default: poses where too little of every person is in the picture, (r, 17, 2).
    """
    people = views.pixels.shape[2]
    if not people or not len(individual):
        return default
    priority = np.stack([process.uniform(f"donor{person}") for person in range(people)], axis=-1)[individual]
    moved = process.normal("displaced", 3)[individual]
    seen = views.visibility[frame, view] != Visibility.OUTSIDE  # (r, P, 17)
    points = np.where(seen[..., None], views.pixels[frame, view], np.nan)
    boxes = views.boxes[frame, view]
    usable = seen.sum(axis=-1) >= false_positives.MIN_JOINTS
    row = np.arange(len(individual))
    donor = np.where(usable, priority, np.inf).argmin(axis=-1)
    size = boxes[row, donor, 2:]

    centers = boxes[..., :2] + boxes[..., 2:] / 2
    distance = np.linalg.norm(centers - (boxes[row, donor, :2] + size / 2)[:, None], axis=-1)
    distance = np.where(usable & (np.arange(people) != donor[:, None]), distance, np.inf)
    other = distance.argmin(axis=-1)
    near = distance[row, other] < np.maximum(size[:, 1], boxes[row, other, 3])

    poses = points[row, donor]
    lower = poses[:, _LOWER]
    middle = lower[:, :2].mean(axis=1, keepdims=True)
    legs = middle + np.exp(0.15 * moved[:, :1, None]) * (lower - middle) + (0.2 * moved[:, 1:] * size)[:, None]
    poses[:, _LOWER] = np.where(near[:, None, None], points[row, other][:, _LOWER], legs)
    return np.where(usable.any(axis=-1)[:, None, None] & _enough_joints(poses), poses, default)


def _enough_joints(poses: Floats) -> NDArray[np.bool_]:
    """Return which poses (r, 17, 2) have enough finite joints to be detected, (r, 1, 1)."""
    return (np.isfinite(poses).all(axis=-1).sum(axis=-1) >= false_positives.MIN_JOINTS)[:, None, None]


_LAYER = 0.25  # mean number alive at once in a layer: as many layers are drawn as the rate needs
_COUNTS = np.arange(20)  # births of a layer in a frame; more have a probability of 1e-29


@dataclass(frozen=True)
class BirthDeathProcess:
    """Births and deaths of n individuals, each present from one frame to another.

    Individuals come in layers. In every frame the number alive in a layer is Poisson distributed, the first frame
    included, and each of them lives on for an independent exponential time: the queue M/M/∞ at the times of the
    frames; with a life of zero, independent frames. Lower rates are reached by thinning: an individual that is present
    at a rate is present at every higher rate.
    """

    draws: KeyedDraws
    """Draws of the sequence."""
    key: tuple[Key, ...]
    """Name of the process; all its streams begin with it."""
    life: float
    """Mean life, seconds; 0: each individual is present in one frame."""
    max_rate: float
    """Highest rate that is drawn, mean number alive at once."""

    @property
    def born(self) -> Integers:
        """First frame of each individual, (n,)."""
        return np.concatenate([np.zeros(0, int), *self._births])

    @cached_property
    def last(self) -> Integers:
        """Last frame of each individual, (n,)."""
        frames = self.life / self.draws.step
        lasting = np.minimum(frames * self._drawn("life", (), np.random.Generator.standard_exponential), 1e9)
        return np.minimum(self.born + lasting.astype(int), len(self.draws.time) - 1)

    @cached_property
    def rate_threshold(self) -> Floats:
        """Rate above which each individual is present, (n,)."""
        layer = np.repeat(np.arange(len(self._births)), [len(births) for births in self._births])
        return _LAYER * (layer + self.uniform("mark"))

    @cached_property
    def offset(self) -> Integers:
        """Offset of each individual in blocks of noise (:func:`frame_noise`), (n,), at any rate the same."""
        return np.concatenate([np.zeros(0, int), *(np.arange(len(b)) + 5 * k for k, b in enumerate(self._births))])

    @cached_property
    def identifier(self) -> Integers:
        """Unique number of each individual, (n,), across keys and at any rate the same.

        It has 53 random bits: among a million individuals two share one with a probability of 1 in 18000.
        """
        return (2.0**53 * self.uniform("name")).astype(np.int64)

    def normal(self, purpose: str, *shape: int) -> Floats:
        """Draw standard normal numbers for each individual, ``(n, *shape)``."""
        return self._drawn(purpose, shape, np.random.Generator.standard_normal)

    def uniform(self, purpose: str, *shape: int) -> Floats:
        """Draw uniform numbers for each individual, ``(n, *shape)``."""
        return self._drawn(purpose, shape, np.random.Generator.random)

    @cached_property
    def _births(self) -> list[Integers]:
        """Frames of birth in each layer, in rising order."""
        frames = np.arange(len(self.draws.time))
        mean = _LAYER * (-np.expm1(-self.draws.step / self.life) if self.life else 1.0)
        later, first = pdtr(_COUNTS, mean), pdtr(_COUNTS, _LAYER)
        births = []
        for layer in range(int(np.ceil(self.max_rate / _LAYER))):
            uniform = self._stream("births", layer).random(len(frames))
            count = np.searchsorted(later, uniform)
            count[:1] = np.searchsorted(first, uniform[:1])
            births.append(np.repeat(frames, count))
        return births

    def _drawn(
        self, purpose: str, shape: tuple[int, ...], draw: Callable[[np.random.Generator, tuple[int, ...]], Floats]
    ) -> Floats:
        parts = [draw(self._stream(purpose, k), (len(births), *shape)) for k, births in enumerate(self._births)]
        return np.concatenate([np.zeros((0, *shape)), *parts])

    def _stream(self, purpose: str, layer: int) -> np.random.Generator:
        return stream(self.draws.seed, "detector", *self.key, purpose, layer)


def frames_alive(born: Integers, last: Integers) -> tuple[Integers, Integers]:
    """Return all r pairs of an individual and a frame in which it is alive: its index (r,) and the frame (r,)."""
    count = last - born + 1
    individual = np.repeat(np.arange(len(born)), count)
    return individual, born[individual] + np.arange(len(individual)) - np.repeat(np.cumsum(count) - count, count)


def frame_noise(draws: KeyedDraws, *key: Key, offset: Integers, frame: Integers, size: int) -> Floats:
    """Return standard normal noise for the joints of individuals, independent in every frame, (r, 17, size).

    One block of the sequence serves all individuals: each begins at another joint of it.

    Args:
        draws: draws of the sequence.
        key: name of the noise.
        offset: joint of the block at which each individual begins, (r,).
        frame: frame of each row, (r,).
        size: numbers for each joint.
    """
    block = draws.normal(*key, "anew", shape=(17, size))
    return block[frame[:, None], (np.arange(17) + offset[:, None]) % 17]


def assign_slots(born: Integers, last: Integers) -> Integers:
    """Return a slot for each individual, (n,), that it keeps while it lives: the first that is free at its birth."""
    taken: list[tuple[int, int]] = []
    free: list[int] = []
    result = np.zeros(len(born), int)
    for individual in np.argsort(born, kind="stable").tolist():
        while taken and taken[0][0] < born[individual]:
            heapq.heappush(free, heapq.heappop(taken)[1])
        result[individual] = heapq.heappop(free) if free else len(taken)
        heapq.heappush(taken, (int(last[individual]), int(result[individual])))
    return result
