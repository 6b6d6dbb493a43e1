"""People in pictures without pictures: what a detector errs about does not depend on how the views were made."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from mvpose import Camera, Rig
from simharness.types.landmarks import LANDMARKS
from simharness.types.sequence import Sequence
from simharness.types.views import Views, Visibility

RATE = 10.0  # Hz


@dataclass(frozen=True)
class World:
    sequence: Sequence
    views: Views
    rig: Rig


def world(frames=60, views=3, people=2, *, visibility=Visibility.VISIBLE, height=300.0, together=False, rate=RATE):
    """People with joints anywhere in boxes of ``height`` pixels; ``together`` they stand in one another's boxes."""
    rig = Rig([Camera(np.diag([800.0, 800, 1]), np.eye(3), [0.5 * v, 0, 5], size=(1600, 900)) for v in range(views)])
    shape = (frames, views, people)
    # Of every person a stream of its own, so that more people are more people.
    drawn = [np.random.default_rng(person).random((frames, views, 18, 2)) for person in range(people)]
    draws = np.stack(drawn, axis=2) if people else np.zeros((*shape, 18, 2))
    size = np.array([0.4 * height, height])
    corner = 20 + (0.2 * height if together else 400.0) * draws[..., :1, :]
    corner[..., 0] += 0.0 if together else 500.0 * np.arange(people)[:, None]
    pixels = corner + draws[..., 1:, :] * size
    boxes = np.concatenate([corner[..., 0, :], np.broadcast_to(size, (*shape, 2))], axis=-1)
    seen = np.full((*shape, 17), visibility) if np.isscalar(visibility) else visibility
    landmarks = np.random.default_rng(99).random((frames, people, len(LANDMARKS), 3))
    sequence = Sequence(landmarks, np.arange(people), np.arange(frames) / rate)
    source = np.broadcast_to(np.arange(frames)[:, None], (frames, views))
    return World(sequence, Views(pixels, seen, boxes, np.zeros(shape, int), source), rig)


def within(count, trials, chance):
    """Whether that many of independent trials is what a chance makes likely: but for one in a million."""
    low, high = binom.interval(1 - 1e-6, trials, chance)
    return low <= count <= high
