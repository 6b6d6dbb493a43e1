"""Mounts: walls, ceilings and areas for tripods, on which a camera moves by two or three parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats

MountKind = Literal["wall", "ceiling", "tripod"]


@dataclass(frozen=True)
class Mount:
    """Part of a room where cameras may hang: a parallelepiped, of which parts may be taken.

    A place is ``origin + a * along + b * across + c * up`` with a, b and c from 0 to 1. A wall has no ``across`` and a
    ceiling no ``up``: these are zero there.

    Attributes:
        kind: kind of the mount.
        name: name in messages and tables, "wall 2".
        origin: the place with all parameters 0, (3,), metres.
        along, across, up: edges, (3,), metres.
        outline: area that places must be within, (n, 2), metres; None: any.
    """

    kind: MountKind
    name: str
    origin: Floats
    along: Floats
    across: Floats
    up: Floats
    outline: Floats | None = None

    @property
    def frame(self) -> Floats:
        """The edges as columns, (3, 3)."""
        return np.column_stack([self.along, self.across, self.up])

    @property
    def lengths(self) -> Floats:
        """Lengths of the edges, (3,), metres."""
        return np.linalg.norm(self.frame, axis=0)

    def at(self, parameters: ArrayLike) -> Floats:
        """Return the places (..., 3) of parameters (..., 3), which are clipped to 0 to 1."""
        return self.origin + np.clip(np.asarray(parameters, float), 0.0, 1.0) @ self.frame.T

    def nearest(self, place: ArrayLike) -> Floats:
        """Return the parameters (3,) of the point of the mount nearest to a place (3,)."""
        lengths = self.lengths
        unit = self.frame / np.where(lengths > 0, lengths, 1.0)
        shares = (np.asarray(place, float) - self.origin) @ unit / np.where(lengths > 0, lengths, 1.0)
        return np.clip(np.where(lengths > 0, shares, 0.0), 0.0, 1.0)

    def grid(self, spacing: float, *, levels: float) -> Floats:
        """Return places (n, 3) at most ``spacing`` metres apart, and at most ``levels`` metres in height."""
        steps = (spacing, spacing, levels)
        counts = [
            max(1, int(np.ceil(length / step - 1e-9)) + 1) if length else 1
            for length, step in zip(self.lengths, steps, strict=True)
        ]
        axes = [np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5]) for count in counts]
        return self.at(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
