"""People of a recording: the estimator over all frames, with progress, and the check that the cameras agree."""

from __future__ import annotations

import math

from mvpose.cli.agreement import agreement, check
from mvpose.cli.inputs import Inputs
from mvpose.commands.errors import failing
from mvpose.commands.programs import note
from mvpose.commands.progress import single_stage
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.presets import NEED_DESCRIPTORS, PRESETS, preset
from mvpose.recording import People
from mvpose.skeleton import COCO17
from mvpose.wholebody import body_of, body_part, whole_body


def check_method(method: str, *, lag: float) -> None:
    """Check the name of a method and the lag.

    Raises:
        ValueError: as :func:`estimator`.
    """
    estimator(method, lag=lag, period=1.0)


def estimator(method: str, *, lag: float, period: float) -> Estimator:
    """Return the preset of a name.

    Raises:
        ValueError: an unknown name, one that needs descriptors, which files of detections do not have, or a bad lag.
    """
    if method in NEED_DESCRIPTORS:
        raise ValueError(f"--method {method}: needs descriptors, which files of detections do not hold; use track")
    if method not in PRESETS:
        known = [name for name in PRESETS if name not in NEED_DESCRIPTORS]
        raise ValueError(f"--method {method}: no such method; expected one of {', '.join(known)}")
    if not lag >= 0.0 or math.isnan(lag):
        raise ValueError(f"--lag must be 0 s or more, or inf, got {lag}")
    return preset(method, lag=lag, period=period)


def estimate_people(inputs: Inputs, method: Estimator, *, trust: bool = False) -> People:
    """Estimate the people of all frames.

    Args:
        inputs: the recording.
        method: one of :func:`estimator`; one without memory numbers the people of each frame anew.
        trust: accept people who contradict their detections.

    Raises:
        ValueError: people who contradict their detections, :func:`mvpose.cli.agreement.check`.
        RunError: the estimator failed.
    """
    estimates = []
    method = whole_body(method) if inputs.skeleton != COCO17 else method
    tracks = isinstance(method, SequenceEstimator)
    with single_stage("estimate", len(inputs.frames)) as advance, failing("estimation"):
        results = (
            method.track(inputs.rig, inputs.frames)
            if isinstance(method, SequenceEstimator)
            else (method.estimate(inputs.rig, frame) for frame in inputs.frames)
        )
        for estimate in results:
            estimates.append(estimate)
            advance(1)
    try:
        bodies = [body_of(each, inputs.skeleton) for each in estimates]
        remarks = check(inputs.rig, agreement(inputs.rig, [body_part(frame) for frame in inputs.frames], bodies))
    except ValueError as error:
        if not trust:
            raise
        remarks = [str(error)]
    for remark in remarks:
        note(remark)
    return People.of_estimates(estimates, inputs.skeleton, inputs.period, untracked=not tracks)
