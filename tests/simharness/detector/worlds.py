"""Ground truth of people in pictures without rendering, for tests of the detector."""

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
    """Return people with joints anywhere in boxes of ``height`` pixels; ``together``: with overlapping boxes."""
    rig = Rig([Camera(np.diag([800.0, 800, 1]), np.eye(3), [0.5 * v, 0, 5], size=(1600, 900)) for v in range(views)])
    shape = (frames, views, people)
    # A separate stream for each person, so that more people change no other person.
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


def within(count, trials, probability):
    """Return whether a count of independent trials is in the central interval of probability 1 - 1e-6."""
    low, high = binom.interval(1 - 1e-6, trials, probability)
    return low <= count <= high
