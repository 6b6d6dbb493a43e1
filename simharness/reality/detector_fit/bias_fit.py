"""Fit of the detector's bias: systematic offsets of its joints from the true ones, in the frame of the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose import Rig
from mvpose.arrays import Floats
from simharness.detector.bias import SIDE, body_axes
from simharness.scenario.sections.detector import KIND_OF_JOINT, KINDS
from simharness.types.truth import MISS_FROM

_STEP = 0.01  # metres, step of the finite differences: offsets are of this order
_ROUNDS = 12
_KINDS = np.array(KIND_OF_JOINT)
_OF_KIND = np.eye(len(KINDS))[_KINDS]


def joint_axes(reference: Floats) -> Floats:
    """Return forward, outward and up at each joint, (T, P, 17, 3, 3) as rows; outward of right joints is right."""
    mirrored = np.stack([np.ones(len(SIDE)), SIDE, np.ones(len(SIDE))], axis=1)
    return body_axes(reference)[:, :, None] * mirrored[:, :, None]


@dataclass(frozen=True)
class LinearisedBias:
    """Residuals of keypoints, linearised in the offsets; in units of OKS sigma x sqrt(area).

    Attributes:
        residual: keypoint minus true joint, (T, V, P, 17, 2); 0 where unknown.
        slope: change of the true joint with metres forward, outward and up, (T, V, P, 17, 2, 3); 0 where unknown.
        known: which residuals are known, (T, V, P, 17).
    """

    residual: Floats
    slope: Floats
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, reference: Floats, keypoints: Floats, unit: Floats, rig: Rig) -> Self:
        """Return the linearisation at zero offset.

        Args:
            reference: true joints, (T, P, 17, 3) metres.
            keypoints: keypoints of the same people, (T, V, P, 17, 2) pixels.
            unit: OKS sigma x sqrt(area), (T, V, P, 17) pixels.
            rig: the V cameras.
        """
        axes = joint_axes(reference)
        base = np.stack([camera.project(reference) for camera in rig], axis=1)
        moved = [
            np.stack([camera.project(reference + _STEP * axes[..., k, :]) for camera in rig], axis=1) for k in range(3)
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.stack([each - base for each in moved], axis=-1) / _STEP / unit[..., None, None]
            residual = (keypoints - base) / unit[..., None]
        known = np.all(np.isfinite(residual), axis=-1) & np.all(np.isfinite(slope), axis=(-1, -2))
        return cls(np.where(known[..., None], residual, 0.0), np.where(known[..., None, None], slope, 0.0), known)

    def normal_equations(self, offset: Floats) -> tuple[Floats, Floats]:
        """Return the normal equations of each frame, (T, 9, 3, 3) and (T, 9, 3), to be summed over frames and solved.

        Weights are Tukey's biweight about the current offsets (9, 3); residuals beyond 2.35 units have no weight.
        """
        square = ((self.residual - np.einsum("tvpjck,jk->tvpjc", self.slope, offset[_KINDS])) ** 2).sum(axis=-1)
        weight = np.where(self.known, np.maximum(1 - square / MISS_FROM**2, 0) ** 2, 0.0)
        weighted = weight[..., None, None] * self.slope
        A = np.einsum("tvpjck,tvpjcl->tjkl", weighted, self.slope)
        b = np.einsum("tvpjck,tvpjc->tjk", weighted, self.residual)
        return np.einsum("tjkl,jm->tmkl", A, _OF_KIND), np.einsum("tjk,jm->tmk", b, _OF_KIND)


def solve(A: Floats, b: Floats) -> Floats:
    """Solve normal equations (..., 9, 3, 3), (..., 9, 3) for offsets (..., 9, 3), metres; 0 where they are singular."""
    known = np.linalg.matrix_rank(A, hermitian=True)[..., None] == A.shape[-1]
    A = np.where(known[..., None], A, np.eye(3))
    return np.where(known, np.linalg.solve(A, b[..., None])[..., 0], 0.0)


def fit_bias(linear: LinearisedBias) -> Floats:
    """Return the offsets of the 9 kinds of joint, (9, 3) metres: forward, outward, up; 0 where nothing is known."""
    offset = np.zeros((len(KINDS), 3))
    for _ in range(_ROUNDS):
        A, b = linear.normal_equations(offset)
        offset = solve(A.sum(axis=0), b.sum(axis=0))
    return offset


def apply_bias(reference: Floats, offset: Floats) -> Floats:
    """Return joints (T, P, 17, 3) moved by the offsets (9, 3) of a detector, metres."""
    return reference + np.einsum("jk,tpjkc->tpjc", offset[_KINDS], joint_axes(reference))
