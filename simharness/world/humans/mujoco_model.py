"""A person as a MuJoCo model: one body a bone, hinges named as in the ``anatomy`` module, capsules, masses.

Every bone's local frame is aligned with the world when the body is in its rest pose, so its skinning transform is
``[xmat | xpos - xmat @ head]`` whatever the joints do. A fixed quaternion on every body turns the rest pose (an A
pose) into the anatomical neutral, which is the zero of all joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS, RANGES, SIDES
from simharness.world.humans.body import Body
from simharness.world.humans.capsules import Capsule, fit_capsules
from simharness.world.humans.inertia import capsule_masses, limb_inertials

SKIN_GROUP = 1  # of the capsules

_X, _Y, _Z = np.eye(3)
_CLAVICLE_DROP = np.tan(np.radians(8.0))  # by eye: with the arms raised to 45 degrees the clavicle is up by about that
# Of every hinge the axis in the neutral pose; of paired joints the left one's, whose mirror image the right one is.
_AXES = {
    "flexion_trunk": _Y,
    "bending": -_X,
    "rotation_trunk": _Z,
    "hip_flexion": -_Y,
    "hip_abduction": _X,
    "hip_rotation": -_Z,
    "knee_flexion": _Y,
    "ankle_dorsiflexion": -_Y,
    "ankle_inversion": -_X,
    "clavicle_elevation": _X,
    "shoulder_flexion": -_Y,
    "shoulder_abduction": _X,
    "shoulder_rotation": -_Z,
    "elbow_flexion": -_Y,
    "forearm_pronation": -_Z,
    "wrist_flexion": -_X,
}
_TRUNK = {"lumbar": "LowerBack", "thorax": "Spine1", "neck": "Neck"}
_LIMB = {
    "hip_flexion": "UpLeg",
    "hip_abduction": "UpLeg",
    "hip_rotation": "UpLeg",
    "knee_flexion": "Leg",
    "ankle_dorsiflexion": "Foot",
    "ankle_inversion": "Foot",
    "clavicle_elevation": "Shoulder",
    "shoulder_flexion": "Arm",
    "shoulder_abduction": "Arm",
    "shoulder_rotation": "ArmTwist",
    "elbow_flexion": "ForeArm",
    "forearm_pronation": "ForeArmTwist",
    "wrist_flexion": "Hand",
}


@dataclass(frozen=True)
class Hinge:
    """One degree of freedom: its name, the bone it moves, its axis in the neutral pose, its range in radians."""

    name: str
    bone: str
    axis: Floats
    range: tuple[float, float]


def _hinges() -> tuple[Hinge, ...]:
    result = []
    for name in DOFS:
        where, word = name.split("_", 1)
        if where in _TRUNK:
            axis = _AXES["bending" if word == "bending" else f"{word}_trunk"]
            bone = _TRUNK[where]
        else:
            axis = _AXES[word]
            if where == "right":
                axis = axis * [-1, 1, -1]  # an axis of rotation is mirrored as a pseudovector
            bone = where.capitalize() + _LIMB[word]
        result.append(Hinge(name, bone, axis, RANGES[name]))
    return tuple(result)


HINGES: tuple[Hinge, ...] = _hinges()
"""All hinges in the order of ``DOFS``; those of one bone act from the outside in."""


def neutral_rotations(body: Body) -> Floats:
    """World rotations (B, 3, 3) that take every bone from the rest pose to the neutral one, pelvis upright.

    Legs and arms are made straight and vertical, feet point forward, the palms face the thighs, and the clavicles
    sink with the arms; the trunk, and what hangs on a hand or foot, keep their shape.
    """
    turn = np.tile(np.eye(3), (len(body.bones), 1, 1))
    for s, side in enumerate(SIDES):
        head = {name: body.heads[body.index(side.capitalize() + name)] for name in (*_LIMB.values(), "ToeBase")}
        toes = (head["ToeBase"] - head["Foot"]) * [1, 1, 0]
        finger = body.heads[body.index(f"{side.capitalize()}FingerBase")]
        bend = head["Hand"] - head["ForeArm"]
        aims = {
            "UpLeg": (head["Leg"] - head["UpLeg"], toes),
            "Leg": (head["Foot"] - head["Leg"], toes),
            "Foot": (-_Z, toes),
            # The rest pose bends the elbow: that bend shows which way it flexes.
            "Arm": (head["ForeArm"] - head["Arm"], bend),
            "ForeArm": (bend, head["Arm"] - head["ForeArm"]),
            "Hand": (finger - head["Hand"], body.thumbs[s]),
            "Shoulder": (-_Z + _CLAVICLE_DROP * (_Y if side == "left" else -_Y), _X),
        }
        for name, (down, forward) in aims.items():
            turn[body.index(side.capitalize() + name)] = _aim(down, forward)
        # The twist of a forearm is the hand's, about the forearm's own axis.
        turn[body.index(f"{side.capitalize()}ForeArmTwist")] = _aim(bend, body.thumbs[s])
        turn[body.index(f"{side.capitalize()}ArmTwist")] = turn[body.index(f"{side.capitalize()}Arm")]
    aimed = {hinge.bone for hinge in HINGES if hinge.name.startswith(SIDES)}
    for bone, parent in enumerate(body.parents):
        if body.bones[bone] not in aimed and parent >= 0:
            turn[bone] = turn[parent]
    return turn


def _aim(down: Floats, forward: Floats) -> Floats:
    """The rotation that turns ``down`` to -z and ``forward``, as far as it is at right angles to it, to +x."""
    z = -down / np.linalg.norm(down)
    x = forward - (forward @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def neutral_transforms(body: Body) -> Floats:
    """Bone transforms (B, 3, 4) of the neutral pose, the soles on z = 0 and the pelvis over the origin."""
    turn = neutral_rotations(body)
    place = body.heads.copy()
    for bone, parent in enumerate(body.parents):
        if parent >= 0:
            place[bone] = place[parent] + turn[parent] @ (body.heads[bone] - body.heads[parent])
    transforms = bone_transforms(body, place, turn)
    transforms[:, 2, 3] -= body.skin(transforms)[:, 2].min()
    return transforms


def bone_transforms(body: Body, xpos: ArrayLike, xmat: ArrayLike) -> Floats:
    """Bone transforms (..., B, 3, 4) from positions (..., B, 3) and rotations (..., B, 3, 3) of the bones' bodies.

    Positions and rotations are MuJoCo's ``xpos`` and ``xmat`` of the bodies named as ``body.bones``, in that order.
    """
    xpos, xmat = np.asarray(xpos, float), np.asarray(xmat, float)
    count = len(body.bones)
    if xpos.shape[-2:] != (count, 3) or xmat.shape[-3:] != (count, 3, 3):
        raise ValueError(
            f"expected xpos (..., {count}, 3) and xmat (..., {count}, 3, 3), got {xpos.shape}, {xmat.shape}"
        )
    shift = xpos - np.einsum("...brc,bc->...br", xmat, body.heads)
    return np.concatenate([xmat, shift[..., None]], axis=-1)


def person_spec(body: Body, name: str) -> mujoco.MjSpec:
    """The MuJoCo model of one person, to compile alone or to attach to a scene.

    Bodies are named as the bones and stand at their heads, in the order of ``body.bones``; ``Hips`` has the free
    joint ``root``; the hinges are named as ``DOFS``. In the initial configuration the person stands in the neutral
    pose on z = 0 over the origin. The capsules of :mod:`simharness.world.humans.capsules` (group 1, named as their
    bone, or "bone k" where it has several) collide with the world and with other people, not with the person's own.
    Masses and inertias are those of :mod:`simharness.world.humans.inertia`; they sum to ``body.mass``.

    Args:
        body: the person's body.
        name: of the model.
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    turn = neutral_rotations(body)
    height = neutral_transforms(body)[0, 2] @ [*body.heads[0], 1]
    bodies: list[mujoco.MjsBody] = []
    for bone, parent in enumerate(body.parents):
        above = spec.worldbody if parent < 0 else bodies[parent]
        position = [0, 0, height] if parent < 0 else body.heads[bone] - body.heads[parent]
        local = turn[bone] if parent < 0 else turn[parent].T @ turn[bone]
        part = above.add_body(name=body.bones[bone], pos=position, quat=_quaternion(local))
        if parent < 0:
            part.add_freejoint(name="root")
        for hinge in HINGES:
            if hinge.bone == body.bones[bone]:
                part.add_joint(
                    name=hinge.name,
                    type=mujoco.mjtJoint.mjJNT_HINGE,
                    axis=turn[bone].T @ hinge.axis,
                    range=hinge.range,
                    limited=True,
                )
        bodies.append(part)
    capsules = fit_capsules(body)
    for capsule, mass, label in zip(capsules, capsule_masses(body, capsules), _labels(capsules), strict=True):
        bodies[body.index(capsule.bone)].add_geom(
            name=label,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*capsule.start, *capsule.end],
            size=[capsule.radius, 0, 0],
            mass=mass,
            group=SKIN_GROUP,
        )
    for inertial in limb_inertials(body):
        part = bodies[body.index(inertial.bone)]
        part.explicitinertial = True  # instead of what its capsules would give
        part.mass, part.ipos = inertial.mass, inertial.center
        part.fullinertia = inertial.tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    fleshy = list(dict.fromkeys(capsule.bone for capsule in capsules))
    for i, first in enumerate(fleshy):
        for second in fleshy[i + 1 :]:
            spec.add_exclude(name=f"{first}-{second}", bodyname1=first, bodyname2=second)
    return spec


def _labels(capsules: Sequence[Capsule]) -> list[str]:
    """A name for each capsule: its bone's, numbered where the bone has several."""
    bones = [capsule.bone for capsule in capsules]
    return [bone if bones.count(bone) == 1 else f"{bone} {bones[:k].count(bone)}" for k, bone in enumerate(bones)]


def _quaternion(rotation: Floats) -> Floats:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion
