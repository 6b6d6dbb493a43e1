"""Log likelihood of the errors of all cameras as a quadratic form, and the evidence of faults under Gaussian priors.

Errors of detectors last for tenths of a second and are shared by joints, so keypoints count for less than their number:
the scatter of the gradient between blocks of time says by how much (a sandwich estimate: White, Econometrica 1982).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mvpose.arrays import Floats
from mvpose.calibration.camera_models import HEALTHY, FaultHypothesis
from mvpose.calibration.normal_equations import PARAMETERS, NormalEquations

_LEAST_TEMPER = 2.0  # keypoints of one pose are never independent of each other
_UNKNOWN_TEMPER = 20.0  # in a recording too short to measure it
_FEWEST_BATCHES = 5


@dataclass(frozen=True)
class Quadratic:
    """Log likelihood of the errors of all cameras in each block: ``-0.5 xᵀ H x + bᵀ x`` of errors x.

    Attributes:
        H: (B, 11 V, 11 V), tempered.
        b: (B, 11 V), tempered.
        temper: keypoints that count as one.
    """

    H: Floats
    b: Floats
    temper: float

    @cached_property
    def total(self) -> tuple[Floats, Floats]:
        """Sums over all blocks."""
        return self.H.sum(axis=0), self.b.sum(axis=0)

    def with_faults(self, faults: Sequence[FaultHypothesis]) -> tuple[Floats, Floats, Floats]:
        """Return curvature and vector of errors and faults together, and the variances of their priors."""
        H, b = self.total
        variances = np.tile(HEALTHY**2, len(b) // PARAMETERS)
        for number, fault in enumerate(faults):
            own = fault.index
            weighted = np.tensordot(fault.profile, self.H[:, :, own], 1)
            columns = [weighted]
            for other in faults[:number]:
                columns.append(np.tensordot(fault.profile * other.profile, self.H[:, other.index[:, None], own], 1))
            side = np.concatenate(columns)
            corner = np.tensordot(fault.profile**2, self.H[:, own[:, None], own], 1)
            H = np.block([[H, side], [side.T, corner]])
            b = np.concatenate([b, fault.profile @ self.b[:, own]])
            variances = np.concatenate([variances, np.square(fault.model.sigma)])
        return H, b, variances

    def posterior(self, faults: Sequence[FaultHypothesis]) -> tuple[Floats, Floats]:
        """Return mean and covariance of errors and faults."""
        H, b, variances = self.with_faults(faults)
        scale = np.sqrt(variances)
        covariance = scale[:, None] * np.linalg.inv(np.eye(len(b)) + scale[:, None] * H * scale) * scale
        return covariance @ b, covariance

    def evidence(self, faults: Sequence[FaultHypothesis]) -> float:
        """Return the log marginal likelihood, up to what all models share."""
        H, b, variances = self.with_faults(faults)
        scale = np.sqrt(variances)
        inner = np.eye(len(b)) + scale[:, None] * H * scale
        factor = np.linalg.cholesky(inner)
        half = np.linalg.solve(factor, scale * b)
        return float(0.5 * half @ half - np.log(np.diagonal(factor)).sum())


def errors_of(mean: Floats, found: list[FaultHypothesis], shape: tuple[int, ...]) -> Floats:
    """Return the errors of all cameras in each block, (B, 11 V)."""
    errors = np.tile(mean[: shape[1]], (shape[0], 1))
    column = shape[1]
    for fault in found:
        errors[:, fault.index] += fault.profile[:, None] * mean[column : column + len(fault.index)]
        column += len(fault.index)
    return errors


def quadratic_of(equations: NormalEquations, errors: Floats) -> Quadratic:
    """Return the log likelihood of errors around a state.

    Args:
        equations: normal equations at the state.
        errors: errors of all cameras at the state, (B, 11 V).
    """
    temper = temper_of(equations)
    return Quadratic(equations.H / temper, vector(equations, errors) / temper, temper)


def vector(equations: NormalEquations, errors: Floats) -> Floats:
    """Return the vector b of the log likelihood of errors in each block, (B, 11 V), not tempered."""
    b: Floats = np.einsum("bij,bj->bi", equations.H, errors) - equations.g
    return b


def temper_of(equations: NormalEquations) -> float:
    """Return how many keypoints count as one: the scatter of the gradient between blocks over that of the model.

    Blocks are merged two by two as long as there are enough: the scatter grows until they are longer than errors last
    (batch means: Flegal & Jones, Annals of Statistics 2010).
    """
    g, curvature = equations.g, np.diagonal(equations.H, axis1=1, axis2=2)
    temper = _LEAST_TEMPER if len(g) >= _FEWEST_BATCHES else _UNKNOWN_TEMPER
    while len(g) >= _FEWEST_BATCHES:
        scatter = ((g - g.mean(axis=0)) ** 2).sum(axis=0) / (len(g) - 1)
        expected = curvature.mean(axis=0)
        seen = expected > 1e-12
        if seen.any():
            temper = max(temper, float(np.median(scatter[seen] / expected[seen])))
        even = len(g) // 2 * 2
        g, curvature = (each[:even].reshape(even // 2, 2, -1).sum(axis=1) for each in (g, curvature))
    return temper
