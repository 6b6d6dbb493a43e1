"""Poses of a body through time that are likeliest given the joints: inverse kinematics over fixed lengths.

The negative logarithm of the posterior is minimised by the Levenberg-Marquardt method over all frames at once:

- the error of each joint is a multivariate t with its covariance, so that a wrong joint loses its influence;
- rotations beyond their range of motion (:mod:`.joint_limits`) cost as the square of the excess; what is left of it in
  the end is cut off;
- every rotation is a priori near that of rest, as far as its spread says;
- between frames rotations and the root change as by a random walk and at the speeds of gait, which fills gaps by the
  most even motion.

The normal equations are block tridiagonal, and are solved as a banded system.

The search starts with every bone in its measured direction, joint by joint.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from mvpose.arrays import Floats
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.kinematics import Freedom, Pose
from mvpose.skeleton_fit.rotations import frame, to_matrices, to_vectors, unit

_TAIL = 4.0  # degrees of freedom of the errors of joints
_EXCESS = np.radians(2.0)  # standard deviation of an excess over a range of motion
# Between two frames rotations and root change by a random walk and by motion at a speed that is kept meanwhile, which
# counts at low frame rates. In 0.04 s that is 0.23 rad and 8 cm, far more than the error of a limb's direction: where
# joints are seen, the walk only matters for what they determine badly.
_TURNS, _TURN_SPEED = 1.0, 3.0  # rad over 1 s; rad/s, of thigh and shank in gait (D. Winter, Biomechanics, chapter 3)
_ROOT, _SPEED = 0.3, 1.4  # metres over 1 s; m/s, comfortable gait (R. Bohannon, Age and Ageing 26, 1997)
_LONGEST_STEP = 1.0  # rad; of one iteration
_CONVERGED = 1e-3  # relative decrease of the cost
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e6

_STRAIGHT = 0.25  # sine of the angle at an elbow or knee; a straighter limb does not show its axis


@dataclass(frozen=True)
class JointTargets:
    """Joints that poses should reach."""

    times: Floats
    """Time of each frame, (T,), seconds."""
    joints: Floats
    """(T, M, 3), metres; NaN where absent."""
    whitening: Floats
    """Matrices W such that W (error) has the identity as covariance, (T, M, 3, 3), 1/metres; zero where a joint is
    absent."""


def reach(pose: Pose, target: JointTargets, *, steps: int) -> Pose:
    """Return the likeliest poses near given ones, with all rotations within their ranges of motion.

    Args:
        pose: poses in T frames at which the search starts.
        target: joints in these frames.
        steps: most iterations.
    """
    search = _Search(pose.body, target)
    damping, state = 1e-2, search.evaluate(pose)
    for _ in range(steps):
        before = state.cost
        while damping < _MOST_DAMPING:
            trial = search.evaluate(search.step(state, damping))
            if trial.cost < before:
                state, damping = trial, max(damping / 10.0, _LEAST_DAMPING)
                break
            damping *= 10.0
        if before - state.cost < _CONVERGED * before:
            break
    return within_limits(state.pose)


def within_limits(pose: Pose) -> Pose:
    """Return poses with every rotation at the nearest one within its range of motion."""
    rotations = pose.rotations.copy()
    for number, segment in enumerate(pose.body.segments):
        if segment.limit is not None and segment.axes:
            rotations[:, number] = segment.limit.nearest(rotations[:, number])
    return Pose(pose.body, pose.root, rotations)


@dataclass(frozen=True)
class _State:
    """Poses with their cost and what the normal equations take."""

    pose: Pose
    cost: float
    errors: Floats  # (T, M, 3), whitened
    weights: Floats  # (T, M), of the t distribution
    rests: Floats  # (T, D) deviations from rest along the axes, in standard deviations
    excesses: Floats  # (T, D), in standard deviations
    walks: Floats  # (T - 1, 3 + D), in standard deviations


class _Search:
    def __init__(self, body: ArticulatedBody, target: JointTargets) -> None:
        self._target, self._free = target, Freedom.of_body(body)
        segments = [body.segments[k] for k in self._free.segments]
        self._spreads = np.radians([each.spread for each in segments])
        self._rest = to_matrices(np.radians([each.rest for each in segments]))
        self._same = (self._free.segments[:, None] == self._free.segments).astype(float)  # (D, D)
        count = len(self._free)
        steps, root = np.diff(target.times)[:, None], np.arange(count) < 3
        walk, speed = np.where(root, _ROOT, _TURNS), np.where(root, _SPEED, _TURN_SPEED)
        self._walks = np.sqrt(walk**2 * steps + (speed * steps) ** 2)
        self._wanted = np.nan_to_num(target.joints)

    def evaluate(self, pose: Pose) -> _State:
        """Return a state with its cost."""
        errors = np.einsum("tmij,tmj->tmi", self._target.whitening, pose.joints - self._wanted)
        squares = np.sum(errors**2, axis=-1)
        weights = (_TAIL + 3.0) / (_TAIL + squares)
        local = pose.rotations[:, self._free.segments]
        rests = self._along(self._rest.swapaxes(-1, -2) @ local) / self._spreads
        allowed = within_limits(pose).rotations[:, self._free.segments]
        excesses = self._along(allowed.swapaxes(-1, -2) @ local) / _EXCESS
        change = self._along(local[:-1].swapaxes(-1, -2) @ local[1:])
        walks = np.concatenate([np.diff(pose.root, axis=0), change], axis=1) / self._walks
        likelihood = (_TAIL + 3.0) / 2.0 * np.log1p(squares / _TAIL).sum()
        cost = likelihood + 0.5 * sum(np.sum(each**2) for each in (rests, excesses, walks))
        return _State(pose, float(cost), errors, weights, rests, excesses, walks)

    def step(self, state: _State, damping: float) -> Pose:
        """Return the poses after one step of the method of Levenberg and Marquardt."""
        H, b = self._normal_equations(state)
        count, size = H.shape[:2]
        diagonal = np.einsum("tii->ti", H)
        diagonal += damping * (diagonal + 1.0)
        links = 1.0 / self._walks**2  # of neighbouring frames, which are independent between axes
        bands = np.zeros((size + 1, count * size))  # bands[k, j] is the element (j + k, j)
        for k in range(size):
            bands[k].reshape(count, size)[:, : size - k] = np.diagonal(H, -k, 1, 2)
        bands[size, : (count - 1) * size] = -links.ravel()
        found = -solveh_banded(bands, b.ravel(), lower=True, check_finite=False).reshape(count, size)
        turns = found[:, 3:]
        longest = np.abs(turns).max(axis=1, keepdims=True, initial=_LONGEST_STEP)
        return self._free.moved(state.pose, found[:, :3], turns * (_LONGEST_STEP / longest))

    def _normal_equations(self, state: _State) -> tuple[Floats, Floats]:
        """Return the diagonal blocks (T, 3 + D, 3 + D) and the gradient (T, 3 + D)."""
        jacobian = self._free.jacobian(state.pose)
        scale = np.sqrt(state.weights)[..., None]
        white = (scale[..., None] * self._target.whitening) @ jacobian
        rows = white.reshape(len(white), -1, white.shape[-1])
        H = rows.swapaxes(1, 2) @ rows
        b = np.einsum("tri,tr->ti", rows, (scale * state.errors).reshape(len(rows), -1))
        turns = H[:, 3:, 3:]
        np.einsum("tii->ti", turns)[:] += 1.0 / self._spreads**2
        b[:, 3:] += state.rests / self._spreads
        # A range is taken as a plane at right angles to the excess: along the plane the cost does not change.
        size = np.sqrt(state.excesses**2 @ self._same)
        normals = np.divide(state.excesses, size, out=np.zeros_like(size), where=size > 0.0) / _EXCESS
        turns += normals[:, :, None] * normals[:, None, :] * self._same
        b[:, 3:] += state.excesses / _EXCESS
        pull = state.walks / self._walks
        b[:-1] -= pull
        b[1:] += pull
        diagonal = np.einsum("tii->ti", H)
        diagonal[:-1] += 1.0 / self._walks**2
        diagonal[1:] += 1.0 / self._walks**2
        return H, b

    def _along(self, rotations: Floats) -> Floats:
        """Return the components of rotations (..., D, 3, 3), one for each axis, along the axes, (..., D), radians."""
        return np.sum(to_vectors(rotations) * self._free.axes, axis=-1)


def initial_pose(body: ArticulatedBody, joints: Floats) -> Pose:
    """Return poses with bones in the directions of the joints.

    Args:
        body: the body.
        joints: joints of its skeleton, (T, M, 3), without NaN where a joint was ever seen; NaN elsewhere.
    """
    at = {name: joints[:, k] for k, name in enumerate(body.joints)}
    middle = {part: (at[f"left_{part}"] + at[f"right_{part}"]) / 2.0 for part in ("hip", "shoulder")}
    trunk = middle["shoulder"] - middle["hip"]
    world = np.broadcast_to(np.eye(3), (len(joints), len(body.segments), 3, 3)).copy()
    place = {each.name: k for k, each in enumerate(body.segments)}
    world[:, place["Hips"]] = frame(at["left_hip"] - at["right_hip"], trunk, (1, 2))
    world[:, place["Spine"]] = frame(trunk, at["left_shoulder"] - at["right_shoulder"], (2, 1))
    chest, pelvis = world[:, place["Spine"]], world[:, place["Hips"]]
    world[:, place["Neck"]] = _head(body, at, middle["shoulder"], chest)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        name = side.capitalize()
        world[:, place[f"{name}Shoulder"]] = chest
        upper, lower = _bones(at, side, ("shoulder", "elbow", "wrist"), sign * chest[..., 1])
        axis = _axis(upper, lower, -chest[..., 2] * sign, chest[..., 0])  # toward the front
        world[:, place[f"{name}Arm"]] = frame(sign * upper, -sign * axis, (1, 2))
        world[:, place[f"{name}ForeArm"]] = world[:, place[f"{name}Hand"]] = frame(sign * lower, -sign * axis, (1, 2))
        upper, lower = _bones(at, side, ("hip", "knee", "ankle"), -pelvis[..., 2])
        axis = _axis(upper, lower, pelvis[..., 1], -pelvis[..., 0])
        world[:, place[f"{name}UpLeg"]] = frame(-upper, axis, (2, 1))
        world[:, place[f"{name}Leg"]] = world[:, place[f"{name}Foot"]] = frame(-lower, axis, (2, 1))
    rotations = world.copy()
    for segment, parent in enumerate(body.parents):
        if parent >= 0:
            rotations[:, segment] = world[:, parent].swapaxes(-1, -2) @ world[:, segment]
    return Pose(body, middle["hip"], rotations)


def _bones(at: dict[str, Floats], side: str, parts: tuple[str, str, str], usual: Floats) -> tuple[Floats, Floats]:
    """Return the directions of the two bones of a limb, (T, 3); the usual direction where a joint was never seen."""
    start, middle, end = (at.get(f"{side}_{part}", np.full_like(usual, np.nan)) for part in parts)
    upper = middle - start
    upper = np.where(np.isfinite(upper), upper, usual)
    lower = end - middle
    return upper, np.where(np.isfinite(lower), lower, upper)


def _axis(upper: Floats, lower: Floats, usual: Floats, front: Floats) -> Floats:
    """Return the axis about which a limb bends, (T, 3): as it is bent, or the usual one where it is straight.

    Args:
        upper: direction of the first bone, (T, 3).
        lower: direction of the second bone, (T, 3).
        usual: usual axis, (T, 3).
        front: direction toward which the limb bends when it is as usual, (T, 3); replaces the usual axis where that is
            along the limb.
    """
    upper = unit(upper, np.cross(front, usual))
    bent = np.cross(upper, unit(lower, upper))
    usual = unit(np.cross(upper, front) + 0.1 * usual, usual)
    straightness = np.clip(1.0 - np.linalg.norm(bent, axis=-1, keepdims=True) / _STRAIGHT, 0.0, 1.0)
    axis = bent + straightness * _STRAIGHT * usual
    axis -= np.sum(axis * upper, axis=-1, keepdims=True) * upper
    return axis + 1e-9 * np.roll(upper, 1, axis=-1)  # never exactly zero


def _head(body: ArticulatedBody, at: dict[str, Floats], neck: Floats, chest: Floats) -> Floats:
    """Return the rotation of the head in the world, (T, 3, 3), from its joints by the Kabsch algorithm."""
    number = body.index("Neck")
    rows = [k for k, carrier in enumerate(body.carriers) if carrier == number and not body.centres[k]]
    rows = [row for row in rows if np.isfinite(at[body.joints[row]]).all()]
    if len(rows) < 2:
        return chest
    targets = np.array([at[body.joints[row]] - neck for row in rows])
    sums = np.einsum("mti,mj->tij", targets, body.places[rows]) + 1e-3 * chest  # toward the chest if they are in a line
    U, _, Vt = np.linalg.svd(sums)
    U[..., 2] *= np.linalg.det(U @ Vt)[:, None]
    return U @ Vt
