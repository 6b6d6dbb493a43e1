"""Ground truth of people in pictures without rendering, for tests of the detector."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from mvpose import Camera, Rig
from simharness.detector.draws import KeyedDraws
from simharness.detector.keypoints import find_keypoints
from simharness.detector.viewing_conditions import Conditions
from simharness.scenario.sections.detector_section import CorrelationSection, KeypointsSection
from simharness.types.sequence import LANDMARKS, Sequence
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


def find(where, *, seed=3, correlation=None, kind="top-down", **parameters):
    """Return the keypoints that a detector with some parameters of [detector.keypoints] finds."""
    config = KeypointsSection.model_validate(parameters)
    draws = KeyedDraws(seed, where.sequence.time, len(where.rig))
    tie = CorrelationSection.model_validate(correlation or {})
    conditions = Conditions.of_views(where.views)
    return find_keypoints(where.views, conditions, where.sequence, where.rig, config, tie, draws, kind=kind)


STANDING = np.array(
    [
        [0.12, 0.0, 1.62], [0.09, 0.03, 1.66], [0.09, -0.03, 1.66], [0.0, 0.07, 1.63], [0.0, -0.07, 1.63],
        [0.0, 0.18, 1.42], [0.0, -0.18, 1.42], [-0.02, 0.25, 1.13], [-0.02, -0.25, 1.13], [0.08, 0.27, 0.88],
        [0.08, -0.27, 0.88], [0.0, 0.12, 0.93], [0.0, -0.12, 0.93], [0.02, 0.12, 0.5], [0.02, -0.12, 0.5],
        [-0.02, 0.12, 0.08], [-0.02, -0.12, 0.08],
    ]
)  # fmt: skip
"""COCO-17 joints of a person of 1.75 m who stands at the origin and faces +x, (17, 3) metres."""


def standing(frames=60, *, cameras=(0.0, 0.5), facing=0.0, moved=None, visibility=Visibility.VISIBLE, distance=5.0):
    """Return one standing person, filmed by level cameras around the origin.

    Args:
        frames: number of frames.
        cameras: bearings of the cameras from the origin, radians from +x.
        facing: rotation of the person about the vertical in each frame, radians.
        moved: displacements of the joints, (T, 17, 3) metres.
        visibility: of every joint.
        distance: of the cameras, metres.
    """
    turn = np.broadcast_to(facing, frames)
    zero, one = np.zeros(frames), np.ones(frames)
    turned = np.array([[np.cos(turn), -np.sin(turn), zero], [np.sin(turn), np.cos(turn), zero], [zero, zero, one]])
    joints = np.einsum("ijt,nj->tni", turned, STANDING) + (0.0 if moved is None else moved)
    rig = Rig([_level_camera(angle, distance) for angle in cameras])
    pixels = np.stack([camera.project(joints) for camera in rig], axis=1)[:, :, None]
    low = np.stack([camera.project(STANDING) for camera in rig]).min(axis=1) - 20
    high = np.stack([camera.project(STANDING) for camera in rig]).max(axis=1) + 20
    boxes = np.broadcast_to(np.concatenate([low, high - low], axis=-1)[:, None], (*pixels.shape[:3], 4))
    landmarks = np.zeros((frames, 1, len(LANDMARKS), 3))
    landmarks[:, 0, :17] = joints
    seen = np.broadcast_to(np.asarray(visibility, np.int8), pixels.shape[:4])
    source = np.broadcast_to(np.arange(frames)[:, None], pixels.shape[:2])
    views = Views(pixels, seen, boxes, np.zeros(pixels.shape[:3], int), source)
    return World(Sequence(landmarks, np.arange(1), np.arange(frames) / RATE), views, rig)


def _level_camera(angle, distance):
    """Return a camera 1 m high at a bearing from the origin, which looks at the vertical through the origin."""
    toward = np.array([np.cos(angle), np.sin(angle), 0.0])
    right = np.array([-np.sin(angle), np.cos(angle), 0.0])
    rotation = np.stack([right, [0.0, 0.0, -1.0], -toward])
    center = distance * toward + [0.0, 0.0, 1.0]
    intrinsics = np.array([[1000.0, 0, 640], [0, 1000, 360], [0, 0, 1]])
    return Camera(intrinsics, rotation, -rotation @ center, size=(1280, 720))
