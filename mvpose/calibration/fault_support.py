"""Whether a fault of a camera is one for everybody whom it sees, or an error about one person alone.

A camera that is wrong is wrong for everybody. A correction that only one person supports comes from a detection of
another person that was matched with this one, or from an error of the detector that lasts for this person. Both
explanations are compared by their evidence: one error for all people, or the same error for one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.calibration.camera_evidence import Quadratic, temper_of, vector
from mvpose.calibration.camera_models import MODELS, FaultHypothesis
from mvpose.calibration.normal_equations import JointViews, NormalEquations, normal_equations, with_errors

_MOST_PEOPLE = 8  # who are tried, those with the most joints in the view
_RARER = 3.0
"""Log prior odds of an error of a camera against one about a single person, 20 to 1. The log evidence of an error
about one person was larger by 170 where a person was matched wrongly (simulated rig, seed 9107), and by up to 2 where a
camera had moved (Shelf, 38 draws apart from those of the benchmark)."""


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
