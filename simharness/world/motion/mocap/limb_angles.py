"""Joint angles of a limb from the directions of its segments, solved for a whole motion and smooth in time.

Directions are given in the frame of the parent of the limb, for a left limb; those of a right limb are mirrored, as are
its hinges, so that the angles are the same. If the directions do not determine an angle (the twist of a straight arm)
or allow two solutions (a raised arm), the smoother solution is taken.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import ARM, DOFS, RANGES
from simharness.world.humans.mujoco_model import HINGES

_X, _Y, _Z = np.eye(3)
_ITERATIONS = 12
_LARGEST_STEP = 0.4  # radians per iteration
_SMOOTH = 1.5  # weight of angular acceleration (radians per frame²): passes motion below about 8 Hz at 60 Hz
_EASE = 0.03  # weight of the distance from the relaxed angles: decides where nothing else does
_LAZY = 0.01  # weight of the angles themselves: prefers the smaller of two equivalent solutions


@dataclass(frozen=True)
class Aim:
    """Direction on a limb with a target direction."""

    hinges: int
    """Number of hinges, from the first, that move it."""
    neutral: Floats
    """Direction in the neutral pose, (3,)."""
    target: Floats
    """Target directions, (T, 3) unit vectors."""
    weight: float
    """Weight of its error relative to others."""


def arm_angles(upper: Floats, fore: Floats, hand: Floats | None, thumb: Floats | None) -> Floats:
    """Return angles (T, 6) of ``ARM``, within their ranges, from directions (T, 3) in the clavicle frame.

    Args:
        upper: direction from shoulder to elbow.
        fore: direction from elbow to wrist.
        hand: direction along the hand; None: unknown, follows the forearm.
        thumb: direction across the palm from the little finger to the thumb; None: unknown.
    """
    aims = [Aim(3, -_Z, upper, 1.0), Aim(4, -_Z, fore, 1.0)]
    if hand is not None and thumb is not None:
        aims += [Aim(6, -_Z, hand, 0.3), Aim(6, _X, thumb, 0.4)]
    start = np.zeros((len(upper), len(ARM)))
    start[:, :4] = _continuous(_euler(upper, fore))
    ease = np.radians([0.0, 0.0, 0.0, 10.0, 15.0, 5.0])
    return solve_directions([f"left_{name}" for name in ARM], aims, start=start, ease=ease)


def thigh_and_shank(thigh: Floats, shank: Floats) -> Floats:
    """Return hip flexion, abduction and rotation and knee flexion, (T, 4), from directions (T, 3)."""
    flexion, abduction = np.arctan2(thigh[:, 0], -thigh[:, 2]), np.arcsin(np.clip(thigh[:, 1], -1, 1))
    inner = into(_turn(-_Y, flexion) @ _turn(_X, abduction), shank)
    knee = np.arctan2(np.hypot(inner[:, 0], inner[:, 1]), -inner[:, 2])
    # The twist of a straight knee is undetermined; it fades in as the knee bends.
    rotation = np.arctan2(inner[:, 1] * np.sin(knee), 0.02 + np.maximum(-inner[:, 0], 0.0) * np.sin(knee))
    return np.stack([flexion, abduction, rotation, knee], axis=-1)


def solve_directions(names: list[str], aims: list[Aim], *, start: Floats, ease: Floats) -> Floats:
    """Return angles (T, n) of hinges, within their ranges, that bring directions to their targets smoothly.

    Gauss-Newton over all frames together; the normal equations are banded because only neighbours in time are coupled.

    Args:
        names: names of n hinges from the trunk outwards, from ``DOFS``.
        aims: directions and their targets.
        start: start angles (T, n).
        ease: relaxed angles (n,), preferred where the aims do not determine them.
    """
    hinges = [HINGES[DOFS.index(name)] for name in names]
    low, high = np.array([hinge.range for hinge in hinges]).T
    frames, count = start.shape
    angles = np.clip(start, low, high)
    for _ in range(_ITERATIONS):
        turns, axes = [np.broadcast_to(np.eye(3), (frames, 3, 3))], []
        for k, hinge in enumerate(hinges):
            axes.append(turns[-1] @ hinge.axis)
            turns.append(turns[-1] @ _turn(hinge.axis, angles[:, k]))
        normal = np.tile(_EASE**2 * np.eye(count), (frames, 1, 1))
        right = _EASE**2 * (ease - angles)
        for aim in aims:
            now = turns[aim.hinges] @ aim.neutral
            moved = np.zeros((frames, 3, count))
            for k in range(aim.hinges):
                moved[:, :, k] = np.cross(axes[k], now)
            normal += aim.weight**2 * moved.swapaxes(1, 2) @ moved
            right += aim.weight**2 * (moved.swapaxes(1, 2) @ (aim.target - now)[..., None])[..., 0]
        step = smooth_step(normal, right, angles, weight=_SMOOTH)
        moved_to = np.clip(angles + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP), low, high)
        change = np.abs(moved_to - angles).max(initial=0.0)
        angles = moved_to
        if change < 1e-4:
            break
    return angles


def smooth_step(normal: Floats, right: Floats, values: Floats, *, weight: float) -> Floats:
    """Return the step (T, n) of least squares of which the values after it have small second differences in time.

    Args:
        normal: matrices of the normal equations of each frame, (T, n, n).
        right: their right sides, (T, n).
        values: present values, (T, n).
        weight: weight of the second differences.
    """
    frames, count = values.shape
    smooth = _second_differences(frames)
    banded = np.zeros((2 * count + 1, frames * count))
    for i in range(count):
        for j in range(i, count):
            banded[j - i, i::count] = normal[:, i, j]
    for gap in range(3):
        banded[gap * count] += weight**2 * np.repeat(smooth[gap], count)
    curvature = np.pad(np.diff(values, 2, axis=0), ((2, 2), (0, 0)))
    right = right - weight**2 * np.diff(curvature, 2, axis=0)[:frames]
    return np.asarray(solveh_banded(banded, right.ravel(), lower=True)).reshape(frames, count)


def _second_differences(frames: int) -> Floats:
    """Return the lower bands (3, T) of D'D, where D takes second differences."""
    bands = np.zeros((3, frames))
    kernel = (1.0, -2.0, 1.0)
    rows = max(frames - 2, 0)
    for i in range(3):
        for j in range(i + 1):
            bands[i - j, j : j + rows] += kernel[i] * kernel[j]
    return bands


def _euler(upper: Floats, fore: Floats) -> Floats:
    """Return the two solutions for shoulder flexion, abduction, rotation and elbow flexion, (2, T, 4)."""
    sets = []
    for over in (False, True):
        flexion, abduction = np.arctan2(upper[:, 0], -upper[:, 2]), np.arcsin(np.clip(upper[:, 1], -1, 1))
        if over:
            flexion, abduction = flexion + np.pi, np.pi - abduction
        inner = into(_turn(-_Y, flexion) @ _turn(_X, abduction), fore)
        elbow = np.arccos(np.clip(-inner[:, 2], -1, 1))
        sets.append(np.stack([flexion, abduction, np.arctan2(-inner[:, 1], inner[:, 0]), elbow], axis=-1))
    return np.stack(sets)


def _continuous(sets: Floats) -> Floats:
    """Choose among S solutions (S, T, n) the sequence (T, n) with least strain and jumps (Viterbi, 1967)."""
    low, high = np.array([RANGES[f"left_{name}"] for name in ARM[:4]]).T
    middle = (low + high) / 2
    sets = middle + np.angle(np.exp(1j * (sets - middle)))
    # The twist of a straight arm and the flexion of an arm that points sideways are undetermined: low weight.
    sure = np.stack([np.cos(sets[..., 1]) ** 2, np.ones(sets.shape[:2]), np.sin(sets[..., 3]) ** 2], axis=-1)
    beyond = np.maximum(sets - high, 0) + np.maximum(low - sets, 0)
    beyond[..., 2] *= np.sin(sets[..., 3])
    strain = (beyond**2).sum(axis=-1) + _LAZY * (sets[..., :2] ** 2).sum(axis=-1)
    count, frames = strain.shape
    cost, back = strain[:, 0], np.zeros((frames, count), int)
    for t in range(1, frames):
        change = sets[None, :, t, :3] - sets[:, None, t - 1, :3]  # from, to
        jump = (np.minimum(sure[None, :, t], sure[:, None, t - 1]) * change**2).sum(axis=-1)
        total = cost[:, None] + jump
        back[t] = total.argmin(axis=0)
        cost = total.min(axis=0) + strain[:, t]
    chosen = np.empty(frames, int)
    chosen[-1] = int(cost.argmin())
    for t in range(frames - 1, 0, -1):
        chosen[t - 1] = back[t, chosen[t]]
    result = sets[chosen, np.arange(frames)]
    result[:, 2] *= np.sin(result[:, 3]) ** 2
    return result


def _turn(axis: Floats, angle: Floats) -> Floats:
    return Rotation.from_rotvec(angle[:, None] * axis).as_matrix()


def into(turn: Floats, vector: Floats) -> Floats:
    """Transform vectors (T, 3) into rotated frames (T, 3, 3)."""
    return (turn.swapaxes(1, 2) @ vector[..., None])[..., 0]
