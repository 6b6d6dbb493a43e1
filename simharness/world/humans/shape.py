"""Shape parameters of a human body.

Limb lengths and widths: stretch a rest body along its limb bones, and chest and pelvis sideways, with the skinning
weights.

In anny the limb lengths follow from the other phenotypes, and the forearms of its women are too short. So limb
lengths are separate parameters here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats

# For every limb: its first bone, further bones that move its far half, and the bone at its end.
_CHAINS: Mapping[str, tuple[str, tuple[str, ...], str]] = {
    "upper_arm": ("Arm", ("ArmTwist",), "ForeArm"),
    "forearm": ("ForeArm", ("ForeArmTwist",), "Hand"),
    "thigh": ("UpLeg", (), "Leg"),
    "shank": ("Leg", (), "Foot"),
}
# For every width: the bones that are stretched sideways, and the bone at its ends.
_WIDTHS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "shoulders": (("Spine1", "LeftShoulder", "RightShoulder"), "Arm"),
    "hips": (("Hips", "LHipJoint", "RHipJoint"), "UpLeg"),
}
STRETCHED: tuple[str, ...] = (*_CHAINS, *_WIDTHS)
"""Limbs and widths with a length factor, which holds for both sides."""


def limb_stretches(
    heads: Floats, factors: Mapping[str, float], *, bones: Sequence[str], parents: Sequence[int]
) -> tuple[NDArray[np.float32], Floats]:
    """Return the affine map of every bone that scales the limb lengths, and the moved bone heads.

    Args:
        heads: start points of the bones, (B, 3) metres.
        factors: factor of every length in ``STRETCHED``.
        bones: bone names, parents before children.
        parents: index of the parent of every bone, -1 for the pelvis.

    Returns:
        Maps (B, 3, 4) float32 and heads (B, 3).
    """
    linear = np.tile(np.eye(3), (len(bones), 1, 1))
    index = {bone: i for i, bone in enumerate(bones)}
    for limb, (first, others, last) in _CHAINS.items():
        for side in ("Left", "Right"):
            along = heads[index[side + last]] - heads[index[side + first]]
            linear[[index[side + bone] for bone in (first, *others)]] = _stretch(along, factors[limb])
    for width, (stretched, last) in _WIDTHS.items():
        across = heads[index["Left" + last]] - heads[index["Right" + last]]
        linear[[index[bone] for bone in stretched]] = _stretch(across, factors[width])
    moved = heads.copy()
    for child, parent in enumerate(parents):
        if parent >= 0:
            moved[child] = moved[parent] + linear[parent] @ (heads[child] - heads[parent])
    shift = moved - np.einsum("brc,bc->br", linear, heads)
    return np.concatenate([linear, shift[..., None]], axis=2).astype(np.float32), moved


def _stretch(axis: Floats, factor: float) -> Floats:
    return np.eye(3) + (factor - 1) * np.outer(axis, axis) / (axis @ axis)


LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType(
    dict.fromkeys(("gender", "muscle", "height", "proportions"), (0.0, 1.0))
    | {"age": (0.2, 1.0), "weight": (-0.5, 2.5)}
    | dict.fromkeys(STRETCHED, (0.6, 1.6))
)
"""Least and greatest value of every shape parameter."""


@dataclass(frozen=True)
class Shape:
    """Body shape: the phenotypes of the ``anny`` body model and length factors of the limbs.

    Attributes:
        gender: 0 male to 1 female.
        age: 0.25 is a child of five years, 0.44 a child of twelve, 2/3 a young adult, 1 an old adult.
        muscle: 0 least, 0.5 average, 1 most.
        weight: 0 least, 0.5 average, 1 the heaviest body of anny's artists. Their people are lean, so extrapolation up
            to 2.5 is allowed.
        height: 0 to 1, not in metres; :func:`simharness.world.humans.population.fit_shape` finds it for a stature.
        proportions: 0 ideal to 1 uncommon.
        upper_arm, forearm, thigh, shank: factors on the limb lengths of anny.
        shoulders, hips: factors on the widths of its chest and pelvis.

    Raises:
        ValueError: a value is out of its range in ``LIMITS``.
    """

    gender: float = 0.5
    age: float = 0.7
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.4
    proportions: float = 0.5
    upper_arm: float = 1.0
    forearm: float = 1.0
    thigh: float = 1.0
    shank: float = 1.0
    shoulders: float = 1.0
    hips: float = 1.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            low, high = LIMITS[entry.name]
            value = float(getattr(self, entry.name))
            if not low <= value <= high:
                raise ValueError(f"shape: {entry.name} must be from {low:g} to {high:g}, got {value:.4g}")
            object.__setattr__(self, entry.name, value)
