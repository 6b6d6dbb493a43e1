"""Which camera is wrong, in what, by how much and since when: models of errors compared by their evidence.

Around a state of the cameras, the keypoints give a quadratic form of all their errors (:mod:`.normal_equations`). A
model says how large each error may be: those of a good calibration everywhere (*healthy*), and larger ones in one
respect of one camera (it moved, its focal length is wrong, ...), all the time, from some time on, or growing. With
Gaussian priors the evidence of each model is a closed form (Bishop, Pattern Recognition and Machine Learning, section
3.5), which weighs the better fit of a freer model against its freedom. All cameras are in one form, so each model
explains the disagreements of all views at once, and a wrong camera is not blamed on the others. Models are added one by
one as long as the evidence grows, and stays whichever person is left out.

Errors of detectors last for tenths of a second and are shared by joints, so keypoints count for less than their number:
the scatter of the gradient between blocks of time says by how much (a sandwich estimate: White, Econometrica 1982).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from mvpose.arrays import Floats, Integers
from mvpose.calibration.normal_equations import (
    PARAMETERS,
    JointViews,
    NormalEquations,
    normal_equations,
    with_errors,
)
from mvpose.calibration.sightings import Sightings

HEALTHY = np.array([*[np.radians(0.15)] * 3, *[0.012] * 3, 0.005, 2.0, 2.0, 0.02, 0.002])
"""Standard deviations of the errors of a good calibration: rotation (rad, about each axis), centre (m, along each
axis), log focal length, principal point (px), k1, clock (s). Careful calibrations have 0.2 degrees, 8 mm and 0.3 to
1.3 % of the focal length (FACTS: caliscope); published ones differ from what people in the pictures ask for by 0.16 to
0.28 degrees and 1 to 2.5 cm, which includes what detectors do to joints seen from different sides."""

_SPACING = 0.1  # seconds between frames that are used
_BLOCK = 0.5  # seconds: blocks of time; errors of detectors last less
_MOST_BLOCKS = 48  # of a long recording, whose blocks are longer
_LEAST_TEMPER = 2.0  # keypoints of one pose are never independent of each other
_UNKNOWN_TEMPER = 20.0  # in a recording too short to measure it
_FEWEST_BATCHES = 5
_ROUNDS = 4
_LEAST_ODDS = 0.0  # log posterior odds from which a camera has moved: more likely than not
_LEAST_ODDS_INTRINSICS = 3.0  # of another fault: 20 to 1, because detectors imitate small ones
_LEAST_ODDS_CHANGE = 30.0
"""Log posterior odds from which a change in time is one of the camera. What detectors do to people changes with the
place and the pose of people, over seconds, which the scatter between blocks of a short recording does not show; it
imitates changes with odds of up to e^26, half a degree of a true one has e^100 and more."""

_REST = 0.03  # share of the strongest fault's odds below which another may be what the model left of it
_ALWAYS, _SINCE, _GROWING = "always", "since", "growing"
_COURSES = {_ALWAYS: 0.6, _SINCE: 0.25, _GROWING: 0.15}  # prior of the course over time of a pose that is wrong
_FEWEST = 3  # blocks of time before and after a change


@dataclass(frozen=True)
class Model:
    """Errors that a fault may have.

    Attributes:
        kind: kind of finding.
        prior: probability that a camera has it, before any data.
        index: parameters of the camera that it frees.
        sigma: their standard deviations.
    """

    kind: str
    prior: float
    index: tuple[int, ...]
    sigma: tuple[float, ...]


def _moved(degrees: float, metres: float) -> Model:
    return Model("moved-camera", 0.05, (0, 1, 2, 3, 4, 5), (*[np.radians(degrees)] * 3, *[metres] * 3))


MODELS = (
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
"""Models of faults. Offsets of clocks are among them so that they are not taken for something else."""

_NOTHING = 1.0 - sum(each.prior for each in MODELS)


@dataclass(frozen=True)
class Fault:
    """A model of one camera, with its course over time.

    Attributes:
        model: what is wrong.
        view: the camera.
        course: ``"always"``, ``"since"`` (from some time on) or ``"growing"`` (from 0 at the start).
        profile: share of the error in each block of time, (B,).
    """

    model: Model
    view: int
    course: str
    profile: Floats

    @property
    def index(self) -> Integers:
        """Numbers of the freed parameters among those of all cameras."""
        return PARAMETERS * self.view + np.array(self.model.index)


@dataclass(frozen=True)
class CameraFault:
    """A fault that was found.

    Attributes:
        fault: model, camera and course.
        probability: posterior probability that this camera has a fault.
        kind_probability: probability of this kind among those of the camera.
        change: correction of the parameters at the end of the recording, (11,).
        covariance: its covariance, (11, 11).
        gain: log posterior odds of a fault of this camera.
        since: block of time of the change, and the first and last block of 90 % of its probability; None for other
            courses.
    """

    fault: Fault
    probability: float
    kind_probability: float
    change: Floats
    covariance: Floats
    gain: float
    since: tuple[int, int, int] | None


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

    def with_faults(self, faults: Sequence[Fault]) -> tuple[Floats, Floats, Floats]:
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

    def posterior(self, faults: Sequence[Fault]) -> tuple[Floats, Floats]:
        """Return mean and covariance of errors and faults."""
        H, b, variances = self.with_faults(faults)
        scale = np.sqrt(variances)
        covariance = scale[:, None] * np.linalg.inv(np.eye(len(b)) + scale[:, None] * H * scale) * scale
        return covariance @ b, covariance

    def evidence(self, faults: Sequence[Fault]) -> float:
        """Return the log marginal likelihood, up to what all models share."""
        H, b, variances = self.with_faults(faults)
        scale = np.sqrt(variances)
        inner = np.eye(len(b)) + scale[:, None] * H * scale
        factor = np.linalg.cholesky(inner)
        half = np.linalg.solve(factor, scale * b)
        return float(0.5 * half @ half - np.log(np.diagonal(factor)).sum())


@dataclass(frozen=True)
class Fit:
    """Result of the search.

    Attributes:
        faults: faults found, the clearest first.
        change: correction of all cameras at the end of the recording, (V, 11), healthy ones among them.
        covariance: covariance of each camera's correction, (V, 11, 11).
        equations: normal equations at the solution.
        quadratic: log likelihood of all errors around it.
    """

    faults: tuple[CameraFault, ...]
    change: Floats
    covariance: Floats
    equations: NormalEquations
    quadratic: Quadratic


def joint_views(sightings: Sightings) -> tuple[JointViews, Integers]:
    """Return the joints seen by two views or more, in frames 0.1 s apart, and the sightings' rows.

    Returns:
        The joints by blocks of time, and the row of each of their sightings among those given, (k,).
    """
    when = np.full(len(sightings.times), np.nan)
    pictures = np.isfinite(sightings.times).any(axis=1)
    when[pictures] = np.nanmedian(sightings.times[pictures], axis=1)
    slot = np.where(pictures, np.floor((when - when[pictures].min(initial=np.inf)) / _SPACING + 1e-9), -1)
    chosen = np.zeros(len(when), np.bool_)
    chosen[np.unique(slot, return_index=True)[1]] = True
    chosen &= pictures
    rows = np.flatnonzero(chosen[sightings.frame] & sightings.shared)
    joints, people = len(sightings.skeleton), int(sightings.person.max(initial=0)) + 1
    key = (sightings.frame[rows] * people + sightings.person[rows]) * joints + sightings.joint[rows]
    order = np.argsort(key, kind="stable")
    rows, key = rows[order], key[order]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    times = when[sightings.frame[rows[start]]]
    length = max(_BLOCK, float(np.ptp(times)) / _MOST_BLOCKS) if len(times) else _BLOCK
    used, number = np.unique(np.floor((times - times.min(initial=np.inf)) / length + 1e-9), return_inverse=True)
    velocity = sightings.velocity
    assert velocity is not None
    views = JointViews(
        np.append(start, len(rows)).astype(np.int64),
        number.astype(np.int64),
        sightings.person[rows[start]],
        sightings.view[rows],
        np.ascontiguousarray(sightings.pixels[rows]),
        sightings.sigma[rows],
        np.ascontiguousarray(velocity[rows]),
        max(len(used), 1),
    )
    return views, rows


def fit(cameras: Floats, sightings: JointViews) -> Fit:
    """Find the faults of cameras.

    Args:
        cameras: packed cameras as calibrated, (V, 22).
        sightings: joints seen by several views.
    """
    views, blocks = len(cameras), sightings.blocks
    found: list[Fault] = []
    refuted: set[int] = set()
    strongest = 0.0
    errors = np.zeros((blocks, PARAMETERS * views))
    equations = normal_equations(with_errors(cameras, errors), sightings)
    while True:
        for _ in range(_ROUNDS):
            quadratic = _quadratic(equations, errors)
            latest = _errors(quadratic.posterior(found)[0], found, errors.shape)
            step = np.abs(latest - errors).reshape(blocks, views, PARAMETERS)
            errors = latest
            equations = normal_equations(with_errors(cameras, errors), sightings)
            if step[..., :3].max() < 2e-4 and step[..., 3:6].max() < 1e-3:
                break
        quadratic = _quadratic(equations, errors)
        best = _next(quadratic, found, views, refuted, strongest) if len(found) < max(views - 2, 1) else None
        if best is None:
            break
        fault, gain = best
        if not _rests_on_several(fault.view, found, cameras, errors, sightings, equations):
            refuted.add(fault.view)
            continue
        found.append(fault)
        strongest = max(strongest, gain)
    faults = tuple(sorted((_described(quadratic, found, each, views) for each in found), key=lambda each: -each.gain))
    mean, covariance = quadratic.posterior(found)
    to_end = np.eye(len(mean))[: PARAMETERS * views]
    column = PARAMETERS * views
    for fault in found:
        to_end[fault.index, np.arange(column, column + len(fault.index))] = fault.profile[-1]
        column += len(fault.index)
    covariance = to_end @ covariance @ to_end.T
    blocks_of_cameras = [slice(PARAMETERS * view, PARAMETERS * (view + 1)) for view in range(views)]
    return Fit(
        faults,
        (to_end @ mean).reshape(views, PARAMETERS),
        np.stack([covariance[each, each] for each in blocks_of_cameras]),
        equations,
        quadratic,
    )


def _courses(blocks: int) -> list[tuple[str, Floats, float]]:
    """Return the courses over time: name, share of the error in each block, prior."""
    always = np.ones(blocks)
    if blocks < 3 * _FEWEST:
        return [(_ALWAYS, always, 1.0)]
    starts = range(_FEWEST, blocks - _FEWEST + 1)
    steps = [(_SINCE, (np.arange(blocks) >= k).astype(float), _COURSES[_SINCE] / len(starts)) for k in starts]
    ramp = (np.arange(blocks) + 0.5) / blocks
    return [(_ALWAYS, always, _COURSES[_ALWAYS]), *steps, (_GROWING, ramp, _COURSES[_GROWING])]


def _candidates(blocks: int, view: int) -> list[tuple[Fault, float]]:
    """Return all faults of a camera with their log prior odds to no fault."""
    result = []
    for model in MODELS:
        courses = _courses(blocks) if model.kind == "moved-camera" else [(_ALWAYS, np.ones(blocks), 1.0)]
        for course, profile, prior in courses:
            result.append((Fault(model, view, course, profile), float(np.log(model.prior * prior / _NOTHING))))
    return result


def _next(
    quadratic: Quadratic, found: list[Fault], views: int, refuted: set[int], strongest: float
) -> tuple[Fault, float] | None:
    """Return the likeliest further fault and its log posterior odds; None if none is likely enough.

    Args:
        quadratic: log likelihood of all errors.
        found: faults that are known already.
        views: number of cameras, V.
        refuted: cameras whose faults rest on one person.
        strongest: log posterior odds of the clearest fault.
    """
    base, best, most = quadratic.evidence(found), None, -np.inf
    for view in range(views):
        if view in refuted or any(view == each.view for each in found):
            continue
        for fault, prior in _candidates(len(quadratic.H), view):
            gain = quadratic.evidence([*found, fault]) - base + prior
            if gain > max(_least_odds(fault), _REST * strongest, most):
                best, most = (fault, gain), gain
    return best


def _rests_on_several(
    view: int, found: list[Fault], cameras: Floats, errors: Floats, sightings: JointViews, now: NormalEquations
) -> bool:
    """Whether a camera has a fault, whichever person is left out.

    A camera that is wrong is wrong for everybody. A correction that a single person asks for comes from a detection of
    another person that was matched with this one, or from an error of the detector that lasts for this person.

    Args:
        view: the camera.
        found: faults that are known already.
        cameras: packed cameras as calibrated, (V, 22).
        errors: errors of all cameras in each block, (B, 11 V).
        sightings: joints seen by several views.
        now: normal equations at these errors.
    """
    people = np.unique(sightings.person).tolist()
    if len(people) < 2:
        return True
    states, temper = with_errors(cameras, errors), _temper(now)

    def likelihood(person: int) -> tuple[Floats, Floats]:
        own = normal_equations(states, sightings.of_person(person), scale=now.scale)
        return own.H / temper, _vector(own, errors) / temper

    H, b = likelihood(people[0])
    for person in people[1:]:
        own = likelihood(person)
        H, b = H + own[0], b + own[1]
    candidates = _candidates(len(H), view)
    for person in people:
        own = likelihood(person)
        rest = Quadratic(H - own[0], b - own[1], temper)
        base = rest.evidence(found)
        if max(rest.evidence([*found, fault]) - base + prior for fault, prior in candidates) < _LEAST_ODDS:
            return False
    return True


def _least_odds(fault: Fault) -> float:
    if fault.course != _ALWAYS:
        return _LEAST_ODDS_CHANGE
    return _LEAST_ODDS if fault.model.kind == "moved-camera" else _LEAST_ODDS_INTRINSICS


def _described(quadratic: Quadratic, found: list[Fault], fault: Fault, views: int) -> CameraFault:
    """Return a fault with its probabilities, all other faults given."""
    others = [each for each in found if each is not fault]
    taken = {each.view for each in others}
    base = quadratic.evidence(others)
    gains: dict[int, list[tuple[Fault, float]]] = {
        view: [
            (each, quadratic.evidence([*others, each]) - base + prior)
            for each, prior in _candidates(len(quadratic.H), view)
        ]
        for view in range(views)
        if view not in taken
    }
    own = gains[fault.view]
    total = logsumexp([0.0, *(gain for each in gains.values() for _, gain in each)])
    of_camera = float(logsumexp([gain for _, gain in own]))
    of_kind = float(logsumexp([gain for each, gain in own if each.model.kind == fault.model.kind]))
    mean, covariance = quadratic.posterior([*others, fault])
    size, count = PARAMETERS * views, len(fault.index)
    to_camera = np.zeros((PARAMETERS, len(mean)))
    to_camera[:, PARAMETERS * fault.view : PARAMETERS * (fault.view + 1)] = np.eye(PARAMETERS)
    start = len(mean) - count
    assert start >= size
    to_camera[list(fault.model.index), np.arange(start, len(mean))] = fault.profile[-1]
    since = None
    if fault.course == _SINCE:
        steps = [(int(np.argmax(each.profile)), gain) for each, gain in own if each.course == _SINCE]
        since = _span(np.array([k for k, _ in steps]), np.array([gain for _, gain in steps]), len(quadratic.H))
    return CameraFault(
        fault,
        float(np.exp(of_camera - total)),
        float(np.exp(of_kind - of_camera)),
        to_camera @ mean,
        to_camera @ covariance @ to_camera.T,
        of_camera,
        since,
    )


def _span(blocks: Integers, gains: Floats, count: int) -> tuple[int, int, int]:
    """Return the likeliest block of a change, and the first and last one of 90 % of its probability."""
    weights = np.bincount(blocks, np.exp(gains - logsumexp(gains)), count)
    below = np.cumsum(weights)
    return int(np.argmax(weights)), int(np.searchsorted(below, 0.05)), int(np.searchsorted(below, 0.95))


def _errors(mean: Floats, found: list[Fault], shape: tuple[int, ...]) -> Floats:
    """Return the errors of all cameras in each block, (B, 11 V)."""
    errors = np.tile(mean[: shape[1]], (shape[0], 1))
    column = shape[1]
    for fault in found:
        errors[:, fault.index] += fault.profile[:, None] * mean[column : column + len(fault.index)]
        column += len(fault.index)
    return errors


def _quadratic(equations: NormalEquations, errors: Floats) -> Quadratic:
    temper = _temper(equations)
    return Quadratic(equations.H / temper, _vector(equations, errors) / temper, temper)


def _vector(equations: NormalEquations, errors: Floats) -> Floats:
    """Return the vector b of the log likelihood of errors in each block, (B, 11 V), not tempered."""
    b: Floats = np.einsum("bij,bj->bi", equations.H, errors) - equations.g
    return b


def _temper(equations: NormalEquations) -> float:
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
