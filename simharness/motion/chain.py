"""A serial chain of hinges: where its end goes, and the angles that bring it to a target.

Product of exponentials: Lynch and Park, "Modern Robotics", 2017, sections 4.1 (forward kinematics), 5.1.1 (space
Jacobian) and 6.2 (numerical inverse kinematics). A whole motion is solved at once, one row a frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

_ITERATIONS = 60
_LARGEST_STEP = 0.3  # radians an iteration: keeps the solver in the basin of its start
_DAMPING = 1e-7
_CONVERGED = 1e-9
_TURN_WEIGHT = 0.1  # metres a radian: a target out of reach costs orientation before position


@dataclass(frozen=True)
class Chain:
    """Hinges from the base outwards, described in the base's frame while all angles are zero.

    Attributes:
        axes: unit axes of the hinges, (n, 3).
        anchors: a point on each axis, (n, 3), metres.
        end: the point that the chain carries, (3,), metres; its frame is the identity at zero.
        ranges: lowest and highest angle of each hinge, (n, 2), radians.
    """

    axes: Floats
    anchors: Floats
    end: Floats
    ranges: Floats

    def forward(self, angles: Floats) -> tuple[Floats, Floats]:
        """Orientation (T, 3, 3) and position (T, 3) of the end for angles (T, n)."""
        turn, place, _ = self._forward(angles)
        return turn, place

    def _forward(self, angles: Floats) -> tuple[Floats, Floats, Floats]:
        """Also the Jacobian (T, 6, n): velocity of the end point over angular velocity."""
        frames = len(angles)
        turn, shift = np.broadcast_to(np.eye(3), (frames, 3, 3)), np.zeros((frames, 3))
        moved_axes, moved_anchors = [], []
        for k, (axis, anchor) in enumerate(zip(self.axes, self.anchors, strict=True)):
            moved_axes.append(turn @ axis)
            moved_anchors.append(turn @ anchor + shift)
            hinge = Rotation.from_rotvec(angles[:, k, None] * axis).as_matrix()
            shift = shift + (turn @ (anchor - hinge @ anchor)[..., None])[..., 0]
            turn = turn @ hinge
        place = turn @ self.end + shift
        spin = np.stack(moved_axes, axis=-1)
        lever = place[:, :, None] - np.stack(moved_anchors, axis=-1)
        return turn, place, np.concatenate([np.cross(spin, lever, axis=1), spin], axis=1)

    def solve(self, turn: Floats, place: Floats, *, start: Floats) -> Floats:
        """Angles (T, n), within the ranges, that bring the end to the orientations (T, 3, 3) and places (T, 3).

        Damped Gauss-Newton from ``start`` (T, n), each frame on its own; where the target is out of reach or range
        the nearest that the chain comes to it.
        """
        low, high = self.ranges.T
        weight = np.array([1.0, 1.0, 1.0, _TURN_WEIGHT, _TURN_WEIGHT, _TURN_WEIGHT])
        damping = _DAMPING * np.eye(len(self.axes))
        angles = np.clip(start, low, high)
        for _ in range(_ITERATIONS):
            got_turn, got_place, jacobian = self._forward(angles)
            rest = Rotation.from_matrix(turn @ got_turn.swapaxes(1, 2)).as_rotvec()
            error = weight * np.concatenate([place - got_place, rest], axis=1)
            jacobian = weight[:, None] * jacobian
            transposed = jacobian.swapaxes(1, 2)
            step = np.linalg.solve(transposed @ jacobian + damping, transposed @ error[..., None])[..., 0]
            moved = np.clip(angles + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP), low, high)
            change = np.abs(moved - angles).max(initial=0.0)
            angles = moved
            if change < _CONVERGED:
                break
        return angles
