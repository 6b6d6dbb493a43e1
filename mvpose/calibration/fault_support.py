"""Whether a fault of a camera is supported by everybody whom it sees, or by one person alone."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.calibration.camera_evidence import Quadratic, temper_of, vector
from mvpose.calibration.camera_models import Fault, candidates
from mvpose.calibration.normal_equations import JointViews, NormalEquations, normal_equations, with_errors

LEAST_ODDS = 0.0
"""Log posterior odds from which a camera has moved: more likely than not."""


def rests_on_several(
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
    states, temper = with_errors(cameras, errors), temper_of(now)

    def likelihood(person: int) -> tuple[Floats, Floats]:
        own = normal_equations(states, sightings.of_person(person), scale=now.scale)
        return own.H / temper, vector(own, errors) / temper

    H, b = likelihood(people[0])
    for person in people[1:]:
        own = likelihood(person)
        H, b = H + own[0], b + own[1]
    models = candidates(len(H), view)
    for person in people:
        own = likelihood(person)
        rest = Quadratic(H - own[0], b - own[1], temper)
        base = rest.evidence(found)
        if max(rest.evidence([*found, fault]) - base + prior for fault, prior in models) < LEAST_ODDS:
            return False
    return True
