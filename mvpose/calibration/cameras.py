"""Which camera is wrong, in what, by how much and since when: models of errors compared by their evidence.

Around a state of the cameras, the keypoints give a quadratic form of all their errors (:mod:`.normal_equations`). A
model says how large each error may be: those of a good calibration everywhere (*healthy*), and larger ones in one
respect of one camera (it moved, its focal length is wrong, ...), all the time, from some time on, or growing. With
Gaussian priors the evidence of each model is a closed form (Bishop, Pattern Recognition and Machine Learning, section
3.5), which weighs the better fit of a freer model against its freedom. All cameras are in one form, so each model
explains the disagreements of all views at once, and a wrong camera is not blamed on the others. Models are added one by
one as long as the evidence grows, if they are likelier as errors about everybody than about one person.

A camera that is wrong is wrong for everybody. A correction that only one person supports comes from a detection of
another person that was matched with this one, or from an error of the detector that lasts for this person. Both
explanations are compared by their evidence: one error for all people, or the same error for one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.camera_models import (
    ALWAYS,
    MODELS,
    SINCE,
    FaultHypothesis,
    Quadratic,
    candidates,
    errors_of,
    quadratic_of,
    temper_of,
    vector,
)
from mvpose.calibration.normal_equations import PARAMETERS, JointViews, NormalEquations, normal_equations, with_errors

_ROUNDS = 4
_LEAST_ODDS = 0.0  # log posterior odds from which a camera has moved: more likely than not
_LEAST_ODDS_INTRINSICS = 3.0  # of another fault: 20 to 1, because detectors imitate small ones
_LEAST_ODDS_CHANGE = 30.0
"""Log posterior odds from which a change in time is one of the camera. What detectors do to people changes with the
place and the pose of people, over seconds, which the scatter between blocks of a short recording does not show; it
imitates changes with odds of up to e^26, half a degree of a true one has e^100 and more."""

_REST = 0.03  # share of the strongest fault's odds below which another may be what the model left of it

_MOST_PEOPLE = 8  # who are tried, those with the most joints in the view
_RARER = 3.0
"""Log prior odds of an error of a camera against one about a single person, 20 to 1. The log evidence of an error
about one person was larger by 170 where a person was matched wrongly (simulated rig, seed 9107), and by up to 2 where a
camera had moved (Shelf, 38 draws apart from those of the benchmark)."""


@dataclass(frozen=True)
class CameraFault:
    """A fault that was found."""

    fault: FaultHypothesis
    """Model, camera and course."""
    probability: float
    """Posterior probability that this camera has a fault."""
    kind_probability: float
    """Probability of this kind among those of the camera."""
    change: Floats
    """Correction of the parameters at the end of the recording, (11,)."""
    covariance: Floats
    """Its covariance, (11, 11)."""
    gain: float
    """Log posterior odds of a fault of this camera."""
    since: tuple[int, int, int] | None
    """Block of time of the change, and the first and last block of 90 % of its probability; None for other courses."""


@dataclass(frozen=True)
class CameraFit:
    """Result of the search."""

    faults: tuple[CameraFault, ...]
    """Faults found, the clearest first."""
    change: Floats
    """Correction of all cameras at the end of the recording, (V, 11), healthy ones among them."""
    covariance: Floats
    """Covariance of each camera's correction, (V, 11, 11)."""
    equations: NormalEquations
    """Normal equations at the solution."""
    quadratic: Quadratic
    """Log likelihood of all errors around it."""

    def freed(self, view: int) -> tuple[Floats, Floats]:
        """Return correction (6,) and covariance (6, 6) of the pose of a camera whose calibration is not believed.

        The other cameras have the faults that were found, or those of a good calibration.
        """
        widest = max((each for each in MODELS if len(each.index) == 6), key=lambda each: each.sigma)
        others = [each.fault for each in self.faults if each.fault.view != view]
        free = FaultHypothesis(widest, view, ALWAYS, np.ones(len(self.quadratic.H)))
        mean, covariance = self.quadratic.posterior([*others, free])
        pose = np.zeros((6, len(mean)))
        pose[:, PARAMETERS * view : PARAMETERS * view + 6] = pose[:, -6:] = np.eye(6)
        return pose @ mean, pose @ covariance @ pose.T


def fit(cameras: Floats, sightings: JointViews) -> CameraFit:
    """Find the faults of cameras.

    Args:
        cameras: packed cameras as calibrated, (V, 22).
        sightings: joints seen by several views.
    """
    views, blocks = len(cameras), sightings.blocks
    found: list[FaultHypothesis] = []
    refuted: set[int] = set()
    strongest = 0.0
    errors = np.zeros((blocks, PARAMETERS * views))
    equations = normal_equations(with_errors(cameras, errors), sightings)
    while True:
        for _ in range(_ROUNDS):
            quadratic = quadratic_of(equations, errors)
            latest = errors_of(quadratic.posterior(found)[0], found, errors.shape)
            step = np.abs(latest - errors).reshape(blocks, views, PARAMETERS)
            errors = latest
            equations = normal_equations(with_errors(cameras, errors), sightings)
            if step[..., :3].max() < 2e-4 and step[..., 3:6].max() < 1e-3:
                break
        quadratic = quadratic_of(equations, errors)
        best = _next(quadratic, found, views, refuted, strongest) if len(found) < max(views - 2, 1) else None
        if best is None:
            break
        fault, gain = best
        if not is_for_everybody(fault, found, cameras, errors, sightings, equations):
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
    return CameraFit(
        faults,
        (to_end @ mean).reshape(views, PARAMETERS),
        np.stack([covariance[each, each] for each in blocks_of_cameras]),
        equations,
        quadratic,
    )


def _next(
    quadratic: Quadratic, found: list[FaultHypothesis], views: int, refuted: set[int], strongest: float
) -> tuple[FaultHypothesis, float] | None:
    """Return the likeliest further fault and its log posterior odds; None if none is likely enough.

    Args:
        quadratic: log likelihood of all errors.
        found: faults that are known already.
        views: number of cameras, V.
        refuted: cameras whose faults are those of one person alone.
        strongest: log posterior odds of the clearest fault.
    """
    base, best, most = quadratic.evidence(found), None, -np.inf
    for view in range(views):
        if view in refuted or any(view == each.view for each in found):
            continue
        for fault, prior in candidates(len(quadratic.H), view):
            gain = quadratic.evidence([*found, fault]) - base + prior
            if gain > max(_least_odds(fault), _REST * strongest, most):
                best, most = (fault, gain), gain
    return best


def _least_odds(fault: FaultHypothesis) -> float:
    if fault.course != ALWAYS:
        return _LEAST_ODDS_CHANGE
    return _LEAST_ODDS if fault.model.kind == "moved-camera" else _LEAST_ODDS_INTRINSICS


def _described(quadratic: Quadratic, found: list[FaultHypothesis], fault: FaultHypothesis, views: int) -> CameraFault:
    """Return a fault with its probabilities, all other faults given."""
    others = [each for each in found if each is not fault]
    taken = {each.view for each in others}
    base = quadratic.evidence(others)
    gains: dict[int, list[tuple[FaultHypothesis, float]]] = {
        view: [
            (each, quadratic.evidence([*others, each]) - base + prior)
            for each, prior in candidates(len(quadratic.H), view)
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
    if fault.course == SINCE:
        steps = [(int(np.argmax(each.profile)), gain) for each, gain in own if each.course == SINCE]
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


def is_for_everybody(
    fault: FaultHypothesis,
    found: Sequence[FaultHypothesis],
    cameras: Floats,
    errors: Floats,
    sightings: JointViews,
    now: NormalEquations,
) -> bool:
    """Whether one error for all people is likelier a posteriori than the same error for one person alone.

    Args:
        fault: the fault that is to be checked.
        found: faults that are known already.
        cameras: packed cameras as calibrated, (V, 22).
        errors: errors of all cameras in each block, (B, 11 V).
        sightings: joints seen by several views.
        now: normal equations at these errors.
    """
    seen = np.repeat(sightings.person, np.diff(sightings.start))[sightings.view == fault.view]
    names, counts = np.unique(seen, return_counts=True)
    people = names[np.argsort(-counts, kind="stable")][:_MOST_PEOPLE].tolist()
    if len(names) < 2:
        return True
    # The blocks of time of each person follow each other, those of all others at the end.
    states, temper = with_errors(cameras, errors), temper_of(now)
    H, b = now.H / temper, vector(now, errors) / temper
    parts = []
    for person in people:
        own = normal_equations(states, sightings.of_person(person), scale=now.scale)
        parts.append((own.H / temper, vector(own, errors) / temper))
        H, b = H - parts[-1][0], b - parts[-1][1]
    parts.append((H, b))
    quadratic = Quadratic(np.concatenate([H for H, _ in parts]), np.concatenate([b for _, b in parts]), temper)

    def restricted(each: FaultHypothesis, people_of: Bools) -> FaultHypothesis:
        return replace(each, profile=np.outer(people_of, each.profile).ravel())

    def evidence(people_of: Bools) -> float:
        known = [restricted(each, np.ones(len(parts), np.bool_)) for each in found]
        return max(quadratic.evidence([*known, restricted(replace(fault, model=model), people_of)]) for model in MODELS)

    alone = np.eye(len(parts), dtype=np.bool_)[:-1]
    return evidence(np.ones(len(parts), np.bool_)) > max(evidence(each) for each in alone) - _RARER
