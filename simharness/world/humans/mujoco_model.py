"""MuJoCo model of a person: one body per bone, hinges of the ``anatomy`` module, capsules and masses.

The local frame of every bone is aligned with the world in the rest pose, so its skinning transform is
``[xmat | xpos - xmat @ head]`` at all joint angles. A fixed quaternion on every body turns the rest pose (an A pose)
into the anatomical neutral pose, in which all joint angles are zero.

Mass, centre of mass and inertia of the bones are those of the mass distribution of its body.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import ANATOMY, HINGES_BY_DOF, RANGES, SIDES, mass_fractions
from simharness.world.humans.body import Body
from simharness.world.humans.capsules import Capsule, fit_capsules


@dataclass(frozen=True)
class Inertial:
    """Inertial parameters of a bone in its frame at rest."""

    bone: str
    """Name of the bone."""
    mass: float
    """Kilograms."""
    center: Floats
    """Centre of mass, (3,) metres."""
    tensor: Floats
    """Inertia tensor about the centre of mass, (3, 3) kg m2."""


@dataclass(frozen=True)
class _Rod:
    """Limb segment between two joints, with its inertial parameters of men and women as fractions of its length.

    Attributes:
        bones: bones of the segment, from the upper joint.
        end: bone whose head is the lower joint.
        center: distance of the centre of mass from the upper joint.
        sagittal, transverse, longitudinal: radii of gyration about these axes.
    """

    bones: tuple[str, ...]
    end: str
    center: tuple[float, float]
    sagittal: tuple[float, float]
    transverse: tuple[float, float]
    longitudinal: tuple[float, float]


_RODS = {name: _Rod(**rod) for name, rod in ANATOMY["rods"].items()}


def limb_inertials(body: Body) -> tuple[Inertial, ...]:
    """Return the inertial parameters of upper arms, forearms, thighs and shanks by de Leva (1996)."""
    result = []
    fractions = mass_fractions(body.shape.gender)
    for side in ("Left", "Right"):
        for segment, rod in _RODS.items():
            head = body.heads[body.index(f"{side}{rod.bones[0]}")]
            axis = body.heads[body.index(f"{side}{rod.end}")] - head
            mass = fractions[segment] * body.mass
            across = np.hypot(_between(rod.sagittal, body), _between(rod.transverse, body)) / np.sqrt(2)
            pieces = _halves(rod, across, body) if len(rod.bones) == 2 else [(_between(rod.center, body), across)]
            long = np.outer(axis, axis)
            for bone, (center, gyration) in zip(rod.bones, pieces, strict=True):
                tensor = gyration**2 * (axis @ axis * np.eye(3) - long) + _between(rod.longitudinal, body) ** 2 * long
                share = mass / len(pieces)
                result.append(Inertial(f"{side}{bone}", share, center * axis, share * tensor))
    return tuple(result)


def _halves(rod: _Rod, across: float, body: Body) -> list[tuple[float, float]]:
    """Return centre and radius of gyration of the two halves of a limb with a twist bone, as fractions of its length.

    The limb is split as a uniform rod with the same radius of gyration: each half has half that radius, and its centre
    is sqrt(3)/2 times the radius away from the rod's centre. Together the halves have the inertia of the whole.
    """
    center = _between(rod.center, body)
    return [(center + sign * across * np.sqrt(3) / 2, across / 2) for sign in (-1, 1)]


def _between(values: tuple[float, float], body: Body) -> float:
    """Interpolate between the values of men and women by the gender of a body."""
    return (1 - body.shape.gender) * values[0] + body.shape.gender * values[1]


def capsule_masses(body: Body, capsules: Sequence[Capsule]) -> list[float]:
    """Return the mass of every capsule, kg: the mass of its segment by de Leva, divided in proportion to volume.

    The masses sum to ``body.mass``.
    """
    fractions = mass_fractions(body.shape.gender)
    trunk = ANATOMY["trunk"]
    segments = [(_segment(each.bone), "" if each.bone in trunk else each.bone[:4]) for each in capsules]  # with side
    volumes = {
        segment: sum(c.volume for c, each in zip(capsules, segments, strict=True) if each == segment)
        for segment in set(segments)
    }
    pairs = zip(capsules, segments, strict=True)
    return [fractions[name] * body.mass * each.volume / volumes[name, side] for each, (name, side) in pairs]


def _segment(bone: str) -> str:
    if bone in ANATOMY["trunk"]:
        return ANATOMY["trunk"][bone]
    name = bone.removeprefix("Left").removeprefix("Right")
    ends = {"Hand": "hand", "Foot": "foot"} | {part: segment for segment, rod in _RODS.items() for part in rod.bones}
    return ends[name]


SKIN_GROUP = 1  # MuJoCo geom group of the capsules

_X, _Y, _Z = np.eye(3)
_CLAVICLE_DROP = np.tan(np.radians(8.0))  # by eye: arms raised to 45 degrees lift the clavicle by about that angle


@dataclass(frozen=True)
class Hinge:
    """One degree of freedom."""

    name: str
    """Name in ``DOFS``."""
    bone: str
    """Bone that it moves."""
    axis: Floats
    """Axis in the neutral pose, (3,)."""
    range: tuple[float, float]
    """Least and greatest angle, radians."""


def _hinges() -> tuple[Hinge, ...]:
    result = []
    for name, hinge in HINGES_BY_DOF.items():
        side, axis = name.split("_", 1)[0], {"x": _X, "y": _Y, "z": _Z}[hinge["axis"][-1]]
        axis = -axis if hinge["axis"].startswith("-") else axis
        if side == "right":
            axis = axis * [-1, 1, -1]  # a rotation axis is a pseudovector under mirroring
        bone = f"{side.capitalize() if side in SIDES else ''}{hinge['bone']}"
        result.append(Hinge(name, bone, axis, RANGES[name]))
    return tuple(result)


HINGES: tuple[Hinge, ...] = _hinges()
"""All hinges in the order of ``DOFS``. The hinges of one bone act in this order, the last next to the bone."""


def neutral_rotations(body: Body) -> Floats:
    """Return the world rotations (B, 3, 3) of the bones from the rest pose to the neutral pose, pelvis upright.

    Legs and arms become straight and vertical, the feet point forward, the palms face the thighs, and the clavicles
    are lowered with the arms. Trunk, fingers and toes keep their rest shape.
    """
    turn = np.tile(np.eye(3), (len(body.bones), 1, 1))
    bones = {hinge["bone"] for hinge in ANATOMY["limbs"].values()}
    for s, side in enumerate(SIDES):
        head = {name: body.heads[body.index(side.capitalize() + name)] for name in (*bones, "ToeBase")}
        toes = (head["ToeBase"] - head["Foot"]) * [1, 1, 0]
        finger = body.heads[body.index(f"{side.capitalize()}FingerBase")]
        bend = head["Hand"] - head["ForeArm"]
        aims = {
            "UpLeg": (head["Leg"] - head["UpLeg"], toes),
            "Leg": (head["Foot"] - head["Leg"], toes),
            "Foot": (-_Z, toes),
            # The elbow is bent in the rest pose; this bend gives the direction of flexion.
            "Arm": (head["ForeArm"] - head["Arm"], bend),
            "ForeArm": (bend, head["Arm"] - head["ForeArm"]),
            "Hand": (finger - head["Hand"], body.thumbs[s]),
            "Shoulder": (-_Z + _CLAVICLE_DROP * (_Y if side == "left" else -_Y), _X),
        }
        for name, (down, forward) in aims.items():
            turn[body.index(side.capitalize() + name)] = _aim(down, forward)
        # A forearm twists with the hand, about the axis of the forearm.
        turn[body.index(f"{side.capitalize()}ForeArmTwist")] = _aim(bend, body.thumbs[s])
        turn[body.index(f"{side.capitalize()}ArmTwist")] = turn[body.index(f"{side.capitalize()}Arm")]
    aimed = {hinge.bone for hinge in HINGES if hinge.name.startswith(SIDES)}
    for bone, parent in enumerate(body.parents):
        if body.bones[bone] not in aimed and parent >= 0:
            turn[bone] = turn[parent]
    return turn


def _aim(down: Floats, forward: Floats) -> Floats:
    """Return the rotation that turns ``down`` to -z and the component of ``forward`` orthogonal to it to +x."""
    z = -down / np.linalg.norm(down)
    x = forward - (forward @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def neutral_transforms(body: Body) -> Floats:
    """Return the bone transforms (B, 3, 4) of the neutral pose, the soles on z = 0 and the pelvis over the origin."""
    turn = neutral_rotations(body)
    position = body.heads.copy()
    for bone, parent in enumerate(body.parents):
        if parent >= 0:
            position[bone] = position[parent] + turn[parent] @ (body.heads[bone] - body.heads[parent])
    transforms = bone_transforms(body, position, turn)
    transforms[:, 2, 3] -= body.skin(transforms)[:, 2].min()
    return transforms


def bone_transforms(body: Body, xpos: ArrayLike, xmat: ArrayLike) -> Floats:
    """Return bone transforms (..., B, 3, 4) from positions and rotations of the MuJoCo bodies.

    Args:
        body: body with B bones.
        xpos: MuJoCo's ``xpos`` of the bodies in the order of ``body.bones``, (..., B, 3).
        xmat: MuJoCo's ``xmat`` of the same bodies, (..., B, 3, 3).

    Raises:
        ValueError: a wrong shape.
    """
    xpos, xmat = np.asarray(xpos, float), np.asarray(xmat, float)
    count = len(body.bones)
    if xpos.shape[-2:] != (count, 3) or xmat.shape[-3:] != (count, 3, 3):
        raise ValueError(
            f"expected xpos (..., {count}, 3) and xmat (..., {count}, 3, 3), got {xpos.shape} and {xmat.shape}"
        )
    shift = xpos - np.einsum("...brc,bc->...br", xmat, body.heads)
    return np.concatenate([xmat, shift[..., None]], axis=-1)


def person_spec(body: Body, name: str) -> mujoco.MjSpec:
    """Make the MuJoCo model of one person, to compile alone or to attach to a scene.

    The MuJoCo bodies have the names and the order of ``body.bones`` and are located at the bone heads. ``Hips`` has
    the free joint ``root``; the hinges are named as in ``DOFS``. In the initial configuration the person stands in the
    neutral pose on z = 0 over the origin. The capsules of :mod:`simharness.world.humans.capsules` are in group 1 and
    named after their bone, "bone k" if the bone has several. They collide with the world and with other people, but
    not with each other. Masses and inertias are those of :mod:`simharness.world.humans.mujoco_model`; the masses sum to
    ``body.mass``.

    Args:
        body: body of the person.
        name: name of the model.
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    turn = neutral_rotations(body)
    height = neutral_transforms(body)[0, 2] @ [*body.heads[0], 1]
    bodies: list[mujoco.MjsBody] = []
    for bone, parent in enumerate(body.parents):
        parent_body = spec.worldbody if parent < 0 else bodies[parent]
        position = [0, 0, height] if parent < 0 else body.heads[bone] - body.heads[parent]
        local = turn[bone] if parent < 0 else turn[parent].T @ turn[bone]
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(local).ravel())
        part = parent_body.add_body(name=body.bones[bone], pos=position, quat=quat)
        if parent < 0:
            part.add_freejoint(name="root")
        for hinge in HINGES:
            if hinge.bone == body.bones[bone]:
                axis, kind = turn[bone].T @ hinge.axis, mujoco.mjtJoint.mjJNT_HINGE
                part.add_joint(name=hinge.name, type=kind, axis=axis, range=hinge.range, limited=True)
        bodies.append(part)
    capsules = fit_capsules(body)
    for capsule, mass, label in zip(capsules, capsule_masses(body, capsules), _labels(capsules), strict=True):
        shape = {"fromto": [*capsule.start, *capsule.end], "size": [capsule.radius, 0, 0]}
        kind, part = mujoco.mjtGeom.mjGEOM_CAPSULE, bodies[body.index(capsule.bone)]
        part.add_geom(name=label, type=kind, **shape, mass=mass, group=SKIN_GROUP)
    for inertial in limb_inertials(body):
        part = bodies[body.index(inertial.bone)]
        part.explicitinertial = True  # replaces the inertia of the capsules
        part.mass, part.ipos = inertial.mass, inertial.center
        part.fullinertia = inertial.tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    with_capsules = list(dict.fromkeys(capsule.bone for capsule in capsules))
    for i, first in enumerate(with_capsules):
        for second in with_capsules[i + 1 :]:
            spec.add_exclude(name=f"{first}-{second}", bodyname1=first, bodyname2=second)
    return spec


def _labels(capsules: Sequence[Capsule]) -> list[str]:
    """Return a name for each capsule: that of its bone, numbered if the bone has several."""
    bones = [capsule.bone for capsule in capsules]
    return [bone if bones.count(bone) == 1 else f"{bone} {bones[:k].count(bone)}" for k, bone in enumerate(bones)]
