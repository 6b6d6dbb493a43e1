"""Longer and shorter limbs: a rest body is stretched along its bones, through the weights that move its skin.

anny's limbs follow from its other phenotypes, and its women have short forearms; so their lengths are set apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.skinning import skin

# Of every limb the bone it begins with, others that move its far half, and the bone that it ends at.
_CHAINS: Mapping[str, tuple[str, tuple[str, ...], str]] = MappingProxyType(
    {
        "upper_arm": ("Arm", ("ArmTwist",), "ForeArm"),
        "forearm": ("ForeArm", ("ForeArmTwist",), "Hand"),
        "thigh": ("UpLeg", (), "Leg"),
        "shank": ("Leg", (), "Foot"),
    }
)
LIMBS: tuple[str, ...] = tuple(_CHAINS)
"""The limbs whose lengths can be set, of both sides alike."""


def stretches(
    heads: Floats, factors: Mapping[str, float], *, bones: Sequence[str], parents: Sequence[int]
) -> tuple[NDArray[np.float32], Floats]:
    """What makes limbs ``factors`` times as long: every bone's affine map (B, 3, 4), and where bones then begin (B, 3).

    Args:
        heads: where every bone begins, (B, 3) metres.
        factors: of every limb of ``LIMBS``.
        bones: their names, parents before children.
        parents: of every bone, -1 for the pelvis.
    """
    linear = np.tile(np.eye(3), (len(bones), 1, 1))
    index = {bone: i for i, bone in enumerate(bones)}
    for limb, (first, others, last) in _CHAINS.items():
        for side in ("Left", "Right"):
            axis = heads[index[side + last]] - heads[index[side + first]]
            stretch = np.eye(3) + (factors[limb] - 1) * np.outer(axis, axis) / (axis @ axis)
            for bone in (first, *others):
                linear[index[side + bone]] = stretch
    moved = heads.copy()
    for child, parent in enumerate(parents):
        if parent >= 0:
            moved[child] = moved[parent] + linear[parent] @ (heads[child] - heads[parent])
    shift = moved - np.einsum("brc,bc->br", linear, heads)
    return np.concatenate([linear, shift[..., None]], axis=2).astype(np.float32), moved


def lengthened(
    vertices: Floats, weight_bones: NDArray[np.uint8], weights: NDArray[np.float32], maps: NDArray[np.float32]
) -> Floats:
    """Vertices (n, 3) moved by the maps (B, 3, 4) of the bones (n, w) that carry them, by their weights (n, w)."""
    out = np.empty((len(vertices), 3), np.float32)
    skin(vertices.astype(np.float32), weight_bones, weights, maps, out)
    return out.astype(float)
