"""Models of faults of a camera: which parameters are off, by how much, and since when."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.normal_equations import PARAMETERS

HEALTHY = np.array([*[np.radians(0.15)] * 3, *[0.012] * 3, 0.005, 2.0, 2.0, 0.02, 0.002])
"""Standard deviations of the errors of a good calibration: rotation (rad, about each axis), centre (m, along each
axis), log focal length, principal point (px), k1, clock (s). Careful calibrations have 0.2 degrees, 8 mm and 0.3 to
1.3 % of the focal length (FACTS: caliscope); the corrections that are estimated for published ones are
0.16 to 0.28 degrees and 1 to 2.5 cm, which includes the bias of detectors for joints seen from different sides."""

ALWAYS, SINCE, GROWING = "always", "since", "growing"
_COURSES = {ALWAYS: 0.6, SINCE: 0.25, GROWING: 0.15}  # prior of the course over time of a pose that is wrong
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
"""Models of faults. Offsets of clocks are among them so that they are not attributed to other parameters."""

_NOTHING = 1.0 - sum(each.prior for each in MODELS)


@dataclass(frozen=True)
class FaultHypothesis:
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
        courses = _courses(blocks) if model.kind == "moved-camera" else [(ALWAYS, np.ones(blocks), 1.0)]
        for course, profile, prior in courses:
            result.append(
                (FaultHypothesis(model, view, course, profile), float(np.log(model.prior * prior / _NOTHING)))
            )
    return result
