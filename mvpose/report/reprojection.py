"""People of a recording beside the detections of each picture: who is seen where, and how far off.

A page has no truth. What it can compare are the estimated joints, projected into each picture, and the keypoints that
were detected there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.reconstruction.likelihood import Noise
from mvpose.recording import People

MOST_FRAMES = 3000
"""Frames that numbers of a page are taken from; of longer recordings every second one, every third one, and so on."""

_BESIDE = 0.25  # metres; half the breadth of an adult, so that two people who touch are separated
_LEAST_JOINTS = 3  # in common; fewer do not say who it is
_FAR = 1e6  # metres; cost of a pair that cannot be


@dataclass(frozen=True)
class Reprojection:
    """Keypoints of the detections that show a person, beside the projections of that person's joints, k of them."""

    frames: Integers
    """Indices of the F frames that were compared, ascending."""
    owners: tuple[Integers, ...]
    """For each of the F frames, the row in ``People`` of each detection, (m,); -1 for nobody's."""
    frame: Integers
    """Frame of each keypoint, (k,), an index of the recording."""
    view: Integers
    """Camera, (k,)."""
    person: Integers
    """Row in ``People``, (k,)."""
    joint: Integers
    """Joint of the skeleton, (k,)."""
    keypoint: Floats
    """Detected place, (k, 2), pixels."""
    offset: Floats
    """Detected minus projected, (k, 2), pixels."""
    metres: Floats
    """Length of the offset at the distance of the joint, (k,), metres."""
    supports: Bools
    """Whether the keypoint lies where the error model takes it for right, (k,): within 3 standard deviations
    (:class:`mvpose.reconstruction.likelihood.Noise`)."""

    def __len__(self) -> int:
        return len(self.view)

    @property
    def pixels(self) -> Floats:
        """Length of each offset, (k,), pixels."""
        return np.hypot(self.offset[:, 0], self.offset[:, 1])


def reproject(rig: Rig, frames: Sequence[Detections], people: People) -> Reprojection:
    """Compare people with the detections of the same frames.

    In each picture people and detections are paired one to one so that the sum of their mean distances is least; a
    pair must have three joints in common and lie within 0.25 m on average, measured at the distance of the person.

    Args:
        rig: V cameras.
        frames: detections of the T frames of the recording.
        people: people of the same frames.

    Raises:
        ValueError: another number of frames than people have, or of joints.
    """
    if len(frames) != people.frames:
        raise ValueError(
            f"detections and people must be of the same frames, got {len(frames)} and {people.frames}; pass the frames "
            "that were estimated"
        )
    noise = Noise()
    reach = np.sqrt(-2.0 * np.log(noise.floor)) * noise.sigmas(people.skeleton)
    numbers = compared_frames(len(frames))
    pixels, scale = _projected(rig, people, numbers)
    owners, rows = [], []
    for k, frame in enumerate(numbers.tolist()):
        seen = frames[frame]
        if len(seen) and seen.keypoints.shape[1] != len(people.skeleton):
            raise ValueError(
                f"frame {frame}: detections have {seen.keypoints.shape[1]} joints, but people have "
                f"{len(people.skeleton)} ({people.skeleton.name}); pass the people that were estimated from them"
            )
        owner = np.full(len(seen), -1)
        for view in range(len(rig)):
            here = np.flatnonzero(seen.view == view)
            if len(here) and len(people):
                owner[here] = _paired(seen.keypoints[here], pixels[view, k], scale[view, k])
        owners.append(owner)
        shown = np.flatnonzero(owner >= 0)
        offset = seen.keypoints[shown] - pixels[seen.view[shown], k, owner[shown]]
        which, joint = np.nonzero(np.isfinite(offset).all(axis=-1))
        row = shown[which]
        views, persons = seen.view[row], owner[row]
        size = scale[views, k, persons, joint]
        metres = np.hypot(*offset[which, joint].T) * size
        supports = metres <= np.maximum(reach[joint], noise.pixels * size)
        whole = np.full(len(which), frame)
        rows.append((whole, views, persons, joint, seen.keypoints[row, joint], offset[which, joint], metres, supports))
    empty = (*(np.zeros(0, np.int64) for _ in range(4)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    columns = [np.concatenate(each) for each in zip((*empty, np.zeros(0, bool)), *rows, strict=True)]
    return Reprojection(numbers, tuple(owners), *columns)


def compared_frames(count: int) -> Integers:
    """Return the frames that are compared of a recording of ``count``: at most :data:`MOST_FRAMES`, evenly spaced."""
    return np.arange(0, count, -(-count // MOST_FRAMES) or 1)


def _projected(rig: Rig, people: People, numbers: Integers) -> tuple[Floats, Floats]:
    """Return the pixels of all joints, (V, F, n, J, 2), and the metres of a pixel at each joint, (V, F, n, J)."""
    joints = people.joints[numbers]
    pixels = rig.project(joints)
    scale = np.stack([camera.depth(joints) / np.sqrt(camera.K[0, 0] * camera.K[1, 1]) for camera in rig])
    return pixels, np.where(scale > 0, scale, np.nan)


def _paired(keypoints: Floats, pixels: Floats, scale: Floats) -> Integers:
    """Return the person of each of d detections, or -1, (d,).

    Args:
        keypoints: (d, J, 2), pixels.
        pixels: joints of the people, (n, J, 2).
        scale: metres of a pixel at each joint, (n, J).
    """
    distance = np.linalg.norm(keypoints[:, None] - pixels[None], axis=-1) * scale
    common = np.isfinite(distance)
    count = common.sum(axis=-1)
    mean = np.where(common, distance, 0.0).sum(axis=-1) / np.maximum(count, 1)
    cost = np.where((count >= _LEAST_JOINTS) & (mean <= _BESIDE), mean, _FAR)
    owner = np.full(len(keypoints), -1)
    detection, person = linear_sum_assignment(cost)
    near = cost[detection, person] < _FAR
    owner[detection[near]] = person[near]
    return owner
