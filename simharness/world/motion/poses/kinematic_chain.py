"""Forward and inverse kinematics of a serial chain of hinges.

Product of exponentials: Lynch and Park, "Modern Robotics", 2017, sections 4.1 (forward kinematics), 5.1.1 (space
Jacobian) and 6.2 (numerical inverse kinematics). A whole motion is solved at once, one row per frame.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit

_ITERATIONS = 60
_LARGEST_STEP = 0.3  # radians per iteration: keeps the solver in the basin of its start
_DAMPING = 1e-7
_CONVERGED = 1e-9
_TURN_WEIGHT = 0.1  # metres per radian: a target out of reach costs orientation before position


@dataclass(frozen=True)
class Chain:
    """Chain of hinges from the base outwards, described in the frame of the base with all angles zero."""

    axes: Floats
    """Unit axes of the hinges, (n, 3)."""
    anchors: Floats
    """One point on each axis, (n, 3) metres."""
    end: Floats
    """End point of the chain, (3,) metres; its orientation at zero is the identity."""
    ranges: Floats
    """Lowest and highest angle of each hinge, (n, 2) radians."""

    def forward(self, angles: Floats) -> tuple[Floats, Floats]:
        """Return orientation (T, 3, 3) and position (T, 3) of the end for angles (T, n)."""
        angles = np.ascontiguousarray(angles, float)
        turn, place = np.empty((len(angles), 3, 3)), np.empty((len(angles), 3))
        _forward_all(self.axes, self.anchors, self.end, angles, turn, place)
        return turn, place

    def solve(
        self,
        turn: Floats | None,
        place: Floats,
        *,
        start: Floats,
        turn_weight: float = _TURN_WEIGHT,
        pull: float = 0.0,
        follow: bool = False,
    ) -> Floats:
        """Return angles (T, n), within the ranges, that bring the end to orientations (T, 3, 3) and positions (T, 3).

        Damped Gauss-Newton from ``start`` (T, n), separately for each frame; hinges at a limit of their range are fixed
        and the others continue. A target out of reach or range gives the nearest pose of the chain. A target that
        leaves the chain free (no ``turn``) gives angles near those of the start, and nearer with ``pull``.

        Args:
            turn: target orientations; None: any orientation.
            place: target positions in metres.
            start: start angles in radians.
            turn_weight: weight of one radian of orientation error, in metres; small if mainly the position matters.
            pull: weight of one radian of distance from the start, in metres. A redundant chain then has one solution,
                which is a smooth function of start and target; the end is off by about pull² / 0.3 m.
            follow: start every frame except the first at the solution of the previous frame. A chain with several
                solutions then does not jump between them, but each frame depends on the earlier ones.
        """
        start = np.clip(np.asarray(start, float), *self.ranges.T)
        angles = start.copy()
        if turn is None:
            turn, turn_weight = np.broadcast_to(np.eye(3), (len(angles), 3, 3)), 0.0
        targets = np.ascontiguousarray(turn, float), np.ascontiguousarray(place, float)
        weights = float(turn_weight), float(pull), follow
        chain = self.axes, self.anchors, self.end, self.ranges
        _solve_all(*chain, *targets, *weights, np.ascontiguousarray(start), angles)
        return angles


@njit(cache=True)
def _forward(axes, anchors, end, angles, turn, place, moved_axes, moved_anchors):
    """Compute orientation (3, 3) and position (3,) of the end, axes and anchors (n, 3) of the hinges at angles (n,)."""
    shift, hinge, product = np.zeros(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            turn[i, j] = 1.0 if i == j else 0.0
    for k in range(len(angles)):
        for i in range(3):
            moved_axes[k, i] = turn[i, 0] * axes[k, 0] + turn[i, 1] * axes[k, 1] + turn[i, 2] * axes[k, 2]
            anchor = turn[i, 0] * anchors[k, 0] + turn[i, 1] * anchors[k, 1] + turn[i, 2] * anchors[k, 2]
            moved_anchors[k, i] = anchor + shift[i]
        x, y, z = axes[k]
        c, s = np.cos(angles[k]), np.sin(angles[k])
        v = 1.0 - c
        hinge[0, 0], hinge[0, 1], hinge[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
        hinge[1, 0], hinge[1, 1], hinge[1, 2] = y * x * v + z * s, c + y * y * v, y * z * v - x * s
        hinge[2, 0], hinge[2, 1], hinge[2, 2] = z * x * v - y * s, z * y * v + x * s, c + z * z * v
        for i in range(3):
            for j in range(3):
                product[i, j] = turn[i, 0] * hinge[0, j] + turn[i, 1] * hinge[1, j] + turn[i, 2] * hinge[2, j]
        for i in range(3):
            for j in range(3):
                turn[i, j] = product[i, j]
            anchor = turn[i, 0] * anchors[k, 0] + turn[i, 1] * anchors[k, 1] + turn[i, 2] * anchors[k, 2]
            shift[i] = moved_anchors[k, i] - anchor  # the anchor stays where it is
    for i in range(3):
        place[i] = turn[i, 0] * end[0] + turn[i, 1] * end[1] + turn[i, 2] * end[2] + shift[i]


@njit(cache=True)
def _dot(a, b):
    """Return the dot product of two short vectors, for which BLAS is slow."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True)
def _forward_all(axes, anchors, end, angles, turn, place):
    """Compute orientations (T, 3, 3) and positions (T, 3) of the end at angles (T, n)."""
    moved_axes, moved_anchors = np.empty_like(axes), np.empty_like(axes)
    for t in range(len(angles)):
        _forward(axes, anchors, end, angles[t], turn[t], place[t], moved_axes, moved_anchors)


@njit(cache=True)
def _solve_all(axes, anchors, end, ranges, turn, place, turn_weight, pull, follow, start, angles):
    """Change angles (T, n) in place so that the end reaches turn (T, 3, 3) and place (T, 3)."""
    n = len(axes)
    got_turn, got_place, off = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    spin, at, error = np.empty((n, 3)), np.empty((n, 3)), np.empty(6)
    jacobian, normal, slope, step = np.empty((n, 6)), np.empty((n, n)), np.empty(n), np.empty(n)
    stuck = np.empty(n, np.bool_)
    for t in range(len(angles)):
        if follow and t > 0:
            for k in range(angles.shape[1]):
                angles[t, k] = angles[t - 1, k]
        for _ in range(_ITERATIONS):
            _forward(axes, anchors, end, angles[t], got_turn, got_place, spin, at)
            for i in range(3):
                error[i] = place[t, i] - got_place[i]
                for j in range(3):
                    off[i, j] = (
                        turn[t, i, 0] * got_turn[j, 0] + turn[t, i, 1] * got_turn[j, 1] + turn[t, i, 2] * got_turn[j, 2]
                    )
            _rotation_vector(off, error[3:])
            for i in range(3, 6):
                error[i] *= turn_weight
            for k in range(n):
                x, y, z = got_place[0] - at[k, 0], got_place[1] - at[k, 1], got_place[2] - at[k, 2]
                jacobian[k, 0] = spin[k, 1] * z - spin[k, 2] * y
                jacobian[k, 1] = spin[k, 2] * x - spin[k, 0] * z
                jacobian[k, 2] = spin[k, 0] * y - spin[k, 1] * x
                for i in range(3):
                    jacobian[k, 3 + i] = turn_weight * spin[k, i]
                stuck[k] = False
            # Hinges that the step would push out of their range are fixed; the step of the others is solved again.
            for _ in range(n):
                for k in range(n):
                    back = pull * pull * (start[t, k] - angles[t, k])
                    slope[k] = 0.0 if stuck[k] else _dot(jacobian[k], error) + back
                    for m in range(k + 1):
                        normal[k, m] = 0.0 if stuck[k] or stuck[m] else _dot(jacobian[k], jacobian[m])
                    normal[k, k] += _DAMPING + pull * pull
                _solve_positive(normal, slope, step)
                more = False
                for k in range(n):
                    low = angles[t, k] <= ranges[k, 0] and step[k] < 0.0
                    if low or (angles[t, k] >= ranges[k, 1] and step[k] > 0.0):
                        stuck[k] = more = True
                if not more:
                    break
            change = 0.0
            for k in range(n):
                moved = angles[t, k] + min(max(step[k], -_LARGEST_STEP), _LARGEST_STEP)
                moved = min(max(moved, ranges[k, 0]), ranges[k, 1])
                change = max(change, abs(moved - angles[t, k]))
                angles[t, k] = moved
            if change < _CONVERGED:
                break


@njit(cache=True)
def _rotation_vector(turn, out):
    """Compute the rotation vector, axis times angle (3,), of a rotation (3, 3)."""
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    if sine > 1e-6 or cosine > 0.0:
        scale = 0.5 * np.arctan2(sine, cosine) / sine if sine > 1e-12 else 0.5
        out[0], out[1], out[2] = scale * x, scale * y, scale * z
    else:  # half a turn: the axis is the longest column of turn + 1
        k = np.argmax(np.diag(turn))
        for i in range(3):
            out[i] = turn[i, k] + (1.0 if i == k else 0.0)
        out *= np.pi / np.sqrt((out * out).sum())


@njit(cache=True)
def _solve_positive(normal, right, out):
    """Solve a symmetric positive definite system (n, n) by Cholesky; its lower half is overwritten."""
    n = len(right)
    for i in range(n):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(max(total, 1e-18)) if i == j else total / normal[j, j]
    for i in range(n):
        total = right[i]
        for k in range(i):
            total -= normal[i, k] * out[k]
        out[i] = total / normal[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= normal[k, i] * out[k]
        out[i] = total / normal[i, i]
