"""First pose of a body for the search: every bone in its measured direction, joint by joint."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.kinematics import Pose
from mvpose.skeleton_fit.rotations import frame, unit

_STRAIGHT = 0.25  # sine of the angle at an elbow or knee; a straighter limb does not show its axis


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
