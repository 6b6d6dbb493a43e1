"""Models of faults of a camera (which parameters are off, by how much, since when), and the evidence for them.

The log likelihood of the errors of all cameras is a quadratic form, which gives the evidence of faults under Gaussian
priors. Errors of detectors last for tenths of a second and are shared by joints, so keypoints count for less than their
number: the scatter of the gradient between blocks of time says by how much (a sandwich estimate: White, Econometrica
1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.normal_equations import PARAMETERS, NormalEquations

HEALTHY = np.array([*[np.radians(0.15)] * 3, *[0.012] * 3, 0.005, 2.0, 2.0, 0.02, 0.002])
"""Standard deviations of the errors of a good calibration: rotation (rad, about each axis), centre (m, along each
axis), log focal length, principal point (px), k1, clock (s). Careful calibrations have 0.2 degrees, 8 mm and 0.3 to
1.3 % of the focal length (FACTS: caliscope); the corrections that are estimated for published ones are
0.16 to 0.28 degrees and 1 to 2.5 cm, which includes the bias of detectors for joints seen from different sides."""

ALWAYS, SINCE, GROWING = "always", "since", "growing"
_COURSES = {ALWAYS: 0.6, SINCE: 0.25, GROWING: 0.15}  # prior of the course over time of a pose that is wrong
_FEWEST = 3  # blocks of time before and after a change

_LEAST_TEMPER = 2.0  # keypoints of one pose are never independent of each other
_UNKNOWN_TEMPER = 20.0  # in a recording too short to measure it
_FEWEST_BATCHES = 5


@dataclass(frozen=True)
class Model:
    """Errors that a fault may have."""

    kind: str
    """Kind of finding."""
    prior: float
    """Probability that a camera has it, before any data."""
    index: tuple[int, ...]
    """Parameters of the camera that it frees."""
    sigma: tuple[float, ...]
    """Their standard deviations."""


def _moved(degrees: float, metres: float) -> Model:
    return Model("moved-camera", 0.05, (0, 1, 2, 3, 4, 5), (*[np.radians(degrees)] * 3, *[metres] * 3))


def _turned(degrees: float) -> Model:
    return Model("moved-camera", 0.05, (0, 1, 2), (np.radians(degrees),) * 3)


MODELS = (
    _turned(1.0),
    _turned(4.0),
    _moved(0.6, 0.04),
    _moved(2.0, 0.12),
    _moved(6.0, 0.40),
    Model("focal-length", 0.005, (6,), (0.03,)),
    Model("focal-length", 0.005, (6,), (0.20,)),
    Model("principal-point", 0.005, (7, 8), (60.0, 60.0)),
    Model("distortion-ignored", 0.005, (9,), (0.20,)),
    Model("clock-offset", 0.01, (10,), (0.02,)),
    Model("clock-offset", 0.01, (10,), (0.20,)),
)
"""Models of faults. Offsets of clocks are among them so that they are not attributed to other parameters."""

_NOTHING = 1.0 - sum(each.prior for each in MODELS)


@dataclass(frozen=True)
class FaultHypothesis:
    """A model of one camera, with its course over time."""

    model: Model
    """What is wrong."""
    view: int
    """The camera."""
    course: str
    """``"always"``, ``"since"`` (from some time on) or ``"growing"`` (from 0 at the start)."""
    profile: Floats
    """Share of the error in each block of time, (B,)."""

    @property
    def index(self) -> Integers:
        """Numbers of the freed parameters among those of all cameras."""
        return PARAMETERS * self.view + np.array(self.model.index)


def _courses(blocks: int) -> list[tuple[str, Floats, float]]:
    """Return the courses over time: name, share of the error in each block, prior."""
    always = np.ones(blocks)
    if blocks < 3 * _FEWEST:
        return [(ALWAYS, always, 1.0)]
    starts = range(_FEWEST, blocks - _FEWEST + 1)
    steps = [(SINCE, (np.arange(blocks) >= k).astype(float), _COURSES[SINCE] / len(starts)) for k in starts]
    ramp = (np.arange(blocks) + 0.5) / blocks
    return [(ALWAYS, always, _COURSES[ALWAYS]), *steps, (GROWING, ramp, _COURSES[GROWING])]


def candidates(blocks: int, view: int) -> list[tuple[FaultHypothesis, float]]:
    """Return all faults of a camera with their log prior odds to no fault."""
    result = []
    for model in MODELS:
        courses = _courses(blocks) if len(model.index) == 6 else [(ALWAYS, np.ones(blocks), 1.0)]
        for course, profile, prior in courses:
            result.append(
                (FaultHypothesis(model, view, course, profile), float(np.log(model.prior * prior / _NOTHING)))
            )
    return result


@dataclass(frozen=True)
class Quadratic:
    """Log likelihood of the errors of all cameras in each block: ``-0.5 xᵀ H x + bᵀ x`` of errors x."""

    H: Floats
    """(B, 11 V, 11 V), tempered."""
    b: Floats
    """(B, 11 V), tempered."""
    temper: float
    """Keypoints that count as one."""

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
