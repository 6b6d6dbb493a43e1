"""Finish of a mesh: what reflects light other than a matte surface does, and how cloth and hair run over it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


class Material(IntEnum):
    """Material of a face, by which light is reflected."""

    MATTE = 0
    SKIN = 1
    HAIR = 2
    CLOTH = 3
    LEATHER = 4
    PLASTIC = 5
    EYE = 6
    METAL = 7


@dataclass(frozen=True)
class Finish:
    """Materials of the k faces of a mesh with n vertices, and the grain of its surface.

    The grain is a direction at every vertex: of hair along its strands, of cloth along limb or trunk. It is given by
    another vertex, towards which it points, so that it follows every pose. Where cloth becomes shorter along its grain
    than at rest, it folds.

    Attributes:
        materials: :class:`Material` of every face, (k,) int8.
        toward: vertex to which the grain of each vertex points, itself where there is none, (n,) int32.
        rest: distance to it at rest, metres, (n,) float32.
        place: coordinate of the pattern, metres, (n,) float32: of hair across the strands, from 0 to ``around`` once
            around the head; of cloth along the grain.
        looseness: how deep cloth folds: 0 not at all, 1 as loose clothes, (n,) float32.
        around: period of ``place``, metres.

    Raises:
        ValueError: a wrong shape, or a vertex that does not exist.
    """

    materials: NDArray[np.int8]
    toward: NDArray[np.int32]
    rest: NDArray[np.float32]
    place: NDArray[np.float32]
    looseness: NDArray[np.float32]
    around: float = 0.6

    def __post_init__(self) -> None:
        object.__setattr__(self, "materials", as_array(self.materials, ("k",), "materials", np.int8))
        toward = as_array(self.toward, ("n",), "grain", np.int32)
        if len(toward) and not (toward.min() >= 0 and toward.max() < len(toward)):
            raise ValueError(
                f"the grain must point to the {len(toward)} vertices, got {toward.min()} to {toward.max()}"
            )
        object.__setattr__(self, "toward", toward)
        for key in ("rest", "place", "looseness"):
            object.__setattr__(self, key, as_array(getattr(self, key), (len(toward),), key, np.float32))
