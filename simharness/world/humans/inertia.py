"""Mass distribution of a body: mass, centre of mass and inertia of the bones.

Masses of all segments, and centre and inertia of the long limb segments, follow de Leva, "Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters", J. Biomechanics 29, 1996, table 4. Trunk, head, hands and feet are
measured there between skin landmarks that are not joints, so their centre and inertia are taken from the fitted
capsules at uniform density.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import mass_fractions
from simharness.world.humans.body import Body
from simharness.world.humans.capsules import Capsule


@dataclass(frozen=True)
class Inertial:
    """Inertial parameters of a bone in its frame at rest.

    Attributes:
        bone: name of the bone.
        mass: kilograms.
        center: centre of mass, (3,) metres.
        tensor: inertia tensor about the centre of mass, (3, 3) kg m2.
    """

    bone: str
    mass: float
    center: Floats
    tensor: Floats


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


_RODS = {
    "upper_arm": _Rod(("Arm", "ArmTwist"), "ForeArm", (0.5772, 0.5754), (0.285, 0.278), (0.269, 0.26), (0.158, 0.148)),
    "forearm": _Rod(
        ("ForeArm", "ForeArmTwist"), "Hand", (0.4574, 0.4559), (0.276, 0.261), (0.265, 0.257), (0.121, 0.094)
    ),
    "thigh": _Rod(("UpLeg",), "Leg", (0.4095, 0.3612), (0.329, 0.369), (0.329, 0.364), (0.149, 0.162)),
    "shank": _Rod(("Leg",), "Foot", (0.4459, 0.4416), (0.255, 0.271), (0.249, 0.267), (0.103, 0.093)),
}
_SEGMENT_OF = {
    "Hips": "lower_trunk",
    "LowerBack": "middle_trunk",
    "Spine1": "upper_trunk",
    "LeftShoulder": "upper_trunk",
    "RightShoulder": "upper_trunk",
    "Neck": "head",
    "Head": "head",
}


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
    segments = [(_segment(capsule.bone), _side(capsule.bone)) for capsule in capsules]
    volumes = {
        segment: sum(c.volume for c, each in zip(capsules, segments, strict=True) if each == segment)
        for segment in set(segments)
    }
    return [
        fractions[segment[0]] * body.mass * capsule.volume / volumes[segment]
        for capsule, segment in zip(capsules, segments, strict=True)
    ]


def _segment(bone: str) -> str:
    if bone in _SEGMENT_OF:
        return _SEGMENT_OF[bone]
    name = bone.removeprefix("Left").removeprefix("Right")
    ends = {"Hand": "hand", "Foot": "foot"} | {part: segment for segment, rod in _RODS.items() for part in rod.bones}
    return ends[name]


def _side(bone: str) -> str:
    return "" if bone in _SEGMENT_OF else bone[:4]
