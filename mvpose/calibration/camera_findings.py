"""Findings about single cameras: sizes with intervals, and whether they are alarms or notes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

from mvpose.arrays import Floats
from mvpose.calibration.cameras import CameraFault, CameraFit
from mvpose.calibration.findings import Finding, is_fine, judged
from mvpose.calibration.mends import Mend
from mvpose.camera import Camera, Rig

_SYSTEMATIC = np.array([*[np.radians(0.1)] * 3, *[0.008] * 3, 0.003, 1.0, 1.0, 0.01, 0.002])
"""Standard deviations of the bias of detectors, which place joints differently from different sides (FACTS: hips are
off by 30 to 50 mm); it does not shrink with the length of a recording."""

_LENSES = ("distortion-ignored", "distortion-model")
_REPAIR = ("--free", "extrinsics")
_DRAWS = 4000
_UPPER = float(ndtri(0.95))  # standard deviations to the upper end of a 90 % interval


def findings_of_cameras(
    fit: CameraFit, rig: Rig, starts: Floats, names: Sequence[str], *, undetermined: bool
) -> list[Finding]:
    """Return the findings about single cameras.

    Args:
        fit: estimated errors of the cameras.
        rig: the cameras that it is about.
        starts: time of the start of each block, (B,), seconds from the start of the recording.
        names: names of the cameras.
        undetermined: whether the recording does not determine the calibration: then nothing is an alarm.
    """
    findings = []
    depth = _depths(fit, rig)
    for each in fit.faults:
        finding = _finding(each, fit, rig, starts, names, depth, undetermined)
        if finding is not None:
            findings.append(finding)
    findings = _of_all_lenses(findings, rig)
    faulty = {each.fault.view for each in fit.faults}
    for view in range(len(rig)):
        if view not in faulty:
            findings += _remark(fit, view, names, depth, not undetermined)
    return findings


def _of_all_lenses(findings: list[Finding], rig: Rig) -> list[Finding]:
    """Return the findings with one for all lenses in place of those of most lenses, if these are wrong alike.

    Of V cameras V - 2 are named at most (:mod:`.cameras`); a mistake about distortion is one of all files.
    """
    lenses = [each for each in findings if each.kind in _LENSES and each.severity == "alarm" and each.view is not None]
    changes = np.array([each.size["k1"] for each in lenses])
    kinds = {each.kind for each in lenses}
    if len(lenses) < max(2, len(rig) - 2) or len(kinds) > 1 or len(set(np.sign(changes))) > 1:
        return findings
    calibrated = np.array([rig[each.view].distortion[0] for each in lenses if each.view is not None])
    seen = ", ".join(str(each.camera) for each in lenses)
    k1 = float(np.median(changes))
    mend = f"k1:{k1:.4f}"
    advice = "calibrate the lenses; the command is a makeshift until then"
    if kinds == {"distortion-ignored"}:
        text = "the pictures of all cameras are distorted, and the calibration has no distortion"
    elif (np.abs(calibrated + changes) < 0.35 * np.abs(calibrated)).all():
        text = "the keypoints of all cameras are of pictures whose distortion was removed already"
        mend, advice = "undistorted", ""
    else:
        text = "the lenses of all cameras have another distortion than calibrated"
    interval = tuple(float(np.median([each.interval["k1"][side] for each in lenses])) for side in (0, 1))
    whole = Finding(
        lenses[0].kind,
        f"{text} (clearest in {seen})",
        probability=max(each.probability for each in lenses),
        size={"k1": k1},
        interval={"k1": (interval[0], interval[1])},
        cost=sum(each.cost for each in lenses),
        mend=advice,
        repair=("--mend", mend),
    )
    return [*(each for each in findings if each not in lenses), whole]


Limits = dict[str, tuple[float, float]]
"""Sizes by which a fault is judged, with their lowest values."""


def _finding(
    found: CameraFault,
    fit: CameraFit,
    rig: Rig,
    starts: Floats,
    names: Sequence[str],
    depth: Floats,
    undetermined: bool,
) -> Finding | None:
    view, kind = found.fault.view, found.fault.model.kind
    draws = _draws(found.change, found.covariance)
    if kind == "clock-offset":  # offsets of clocks are findings of mvpose.calibration.clocks
        return None
    if kind == "moved-camera":
        finding, limits = _of_pose(found, draws, starts, names[view], float(depth[view]), undetermined)
    else:
        finding, limits = _of_lens(found, draws, fit, rig[view], names[view], float(depth[view]))
    probability = min(found.probability * found.kind_probability, 1.0)
    severity = judged(
        {key: value for key, (value, _) in limits.items()},
        {key: low for key, (_, low) in limits.items()},
        probability=probability,
        determined=not undetermined,
    )
    cost = float(probability * finding.cost / len(rig))
    return replace(finding, severity=severity, probability=probability, cost=cost)


def _of_pose(
    found: CameraFault, draws: Floats, starts: Floats, name: str, depth: float, undetermined: bool
) -> tuple[Finding, Limits]:
    """Return a pose that is wrong, from the start, since some time, or more and more, with its loss in metres."""
    kind, mend, repair = "moved-camera", "", _REPAIR
    size, interval = _pose_size(found.change, draws)
    limits = {key: (value, interval[key][0]) for key, value in size.items()}
    cost = np.radians(size["degrees"]) * depth + size["metres"]
    text = _moved(name, size)
    if found.fault.course == "growing":
        kind, text = "drifting-camera", text + " at the end, growing from the start"
        mend = "fix the camera; a calibration holds for a short part of this recording alone: --frames chooses it"
    if found.since is not None:
        best, low, high = found.since
        later = min(high + 1, len(starts) - 1)
        size["since_s"] = float(starts[best])
        interval["since_s"] = float(starts[max(low - 1, 0)]), float(starts[later])
        text += f", since {starts[best]:.1f} s"
        mend = "each part of the recording has a calibration of its own: add --frames with those after the change"
    if undetermined and len(found.fault.model.index) == 3:  # a repair would be refused
        repair = ("--mend", _turn(found.change, name))
    return Finding(kind, text, "note", 1.0, name, found.fault.view, size, interval, cost, mend, repair), limits


def _of_lens(
    found: CameraFault, draws: Floats, fit: CameraFit, camera: Camera, name: str, depth: float
) -> tuple[Finding, Limits]:
    """Return intrinsics that are wrong, with their loss in metres."""
    kind, change = found.fault.model.kind, found.change
    if kind == "focal-length":
        size = {"percent": float(100 * np.expm1(change[6]))}
        interval = {"percent": _range(100 * np.expm1(draws[:, 6]))}
        limits = {"percent": (size["percent"], min(np.abs(interval["percent"])))}
        cost = abs(size["percent"]) / 100 * 0.3 * depth
        text = f"the focal length of {name} should be {size['percent']:+.1f} %"
        mend = Mend("focal", f"{np.exp(change[6]):.4f}", (name,))
    elif kind == "principal-point":
        size = {"x_px": float(change[7]), "y_px": float(change[8])}
        interval = {"x_px": _range(draws[:, 7]), "y_px": _range(draws[:, 8])}
        shift = float(np.hypot(*change[7:9]))
        limits = {"px": (shift, _range(np.hypot(draws[:, 7], draws[:, 8]))[0])}
        cost = shift / camera.K[0, 0] * depth
        text = f"the principal point of {name} is off by {shift:.0f} px (are the pictures cropped?)"
        mend = Mend("center", f"{change[7]:.1f},{change[8]:.1f}", (name,))
    else:
        lever = _outer_radius(fit, camera) ** 3 * camera.K[0, 0]
        corner = abs(change[9]) * lever
        size, interval = {"k1": float(change[9])}, {"k1": _range(draws[:, 9])}
        limits = {"edge_px": (corner, min(np.abs(interval["k1"])) * lever)}
        cost = 0.3 * corner / camera.K[0, 0] * depth
        text = f"the lens of {name} has another distortion than calibrated: {corner:.0f} px off near the edge"
        kind = "distortion-model" if camera.distortion.any() else kind
        mend = Mend("k1", f"{change[9]:.4f}", (name,))
    repair = ("--mend", str(mend))
    return Finding(kind, text, "note", 1.0, name, found.fault.view, size, interval, cost, repair=repair), limits


def turn_finding(rig: Rig, cameras: Floats, covariance: Floats, view: int, names: Sequence[str]) -> Finding:
    """Return the finding of a camera that was turned so far that it had to be searched for.

    Args:
        rig: the cameras as calibrated.
        cameras: packed cameras with their corrections, (V, 22).
        covariance: covariance of the parameters of this camera, (11, 11).
        view: the camera.
        names: names of the cameras.
    """
    change = np.zeros(len(covariance))
    turn = cameras[view, 5:14].reshape(3, 3) @ rig[view].R.T
    change[:3] = Rotation.from_matrix(turn).as_rotvec()
    change[3:6] = cameras[view, 14:17] - rig[view].center
    size, interval = _pose_size(change, _draws(change, covariance))
    text = _moved(names[view], size)
    cost = (np.radians(size["degrees"]) * 3.0 + size["metres"]) / len(rig)
    repair = ("--mend", _turn(change, names[view]), *_REPAIR)
    return Finding("moved-camera", text, "alarm", 0.99, names[view], view, size, interval, cost, repair=repair)


def _moved(name: str, size: Mapping[str, float]) -> str:
    off = f"{size['degrees']:.1f} degrees and {100 * size['metres']:.0f} cm"
    return f"{name} is not in its calibrated pose: it is off by {off}"


def _turn(change: Floats, name: str) -> str:
    """Return the mend that turns a camera in its place."""
    return str(Mend("turn", ",".join(f"{angle:.3f}" for angle in np.degrees(change[:3])), (name,)))


def possible_errors(fit: CameraFit, view: int) -> dict[str, float]:
    """Return turn (degrees) and shift (metres) by which a camera may be off: the upper ends of 90 % intervals."""
    pose, covariance = fit.freed(view)
    high = {}
    for name, part, unit in (("degrees", slice(0, 3), 180.0 / np.pi), ("metres", slice(3, 6), 1.0)):
        length = max(float(np.linalg.norm(pose[part])), 1e-9)
        along = pose[part] / length
        high[name] = unit * (length + _UPPER * float(np.sqrt(along @ covariance[part, part] @ along)))
    return high


def _remark(fit: CameraFit, view: int, names: Sequence[str], depth: Floats, determined: bool) -> list[Finding]:
    """Return a finding of a camera that no fault explains, if its correction is significant or might be large."""
    pose, covariance = fit.freed(view)
    total = np.zeros(len(_SYSTEMATIC))
    total[:6] = pose
    full = np.diag(np.full(len(total), 1e-18))
    full[:6, :6] = covariance
    size, interval = _pose_size(total, _draws(total, full))
    cost = (np.radians(size["degrees"]) * depth[view] + size["metres"]) / len(names)
    high = possible_errors(fit, view)
    if determined and not is_fine(size, high):
        text = f"{names[view]} may be off by up to {high['degrees']:.2f} degrees and {100 * high['metres']:.0f} cm: its"
        text += f" estimated correction of {size['degrees']:.2f} degrees and {100 * size['metres']:.1f} cm is too "
        text += "uncertain"
        return [Finding("moved-camera", text, "unknown", 0.5, names[view], view, size, interval, cost, repair=_REPAIR)]
    change, sigma = fit.change[view, :6], np.sqrt(np.diagonal(fit.covariance[view])[:6])
    if (np.abs(change) / sigma).max() < 3.0 or (size["degrees"] < 0.1 and size["metres"] < 0.01) or not determined:
        return []
    text = f"the estimated correction of {names[view]} is {size['degrees']:.2f} degrees and "
    text += f"{100 * size['metres']:.1f} cm, as small as for good calibrations"
    return [Finding("moved-camera", text, "note", 0.5, names[view], view, size, interval, cost, repair=_REPAIR)]


def _pose_size(change: Floats, draws: Floats) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Return angle and shift of a pose, with 90 % intervals."""
    angle, shift = (np.linalg.norm(draws[:, part], axis=1) for part in (slice(0, 3), slice(3, 6)))
    size = {"degrees": float(np.degrees(np.linalg.norm(change[:3]))), "metres": float(np.linalg.norm(change[3:6]))}
    return size, {"degrees": _range(np.degrees(angle)), "metres": _range(shift)}


def _draws(change: Floats, covariance: Floats) -> Floats:
    """Return draws of the parameters, (n, 11), with the systematic errors of detectors."""
    total = covariance + np.diag(_SYSTEMATIC**2)
    factor = np.linalg.cholesky(total)
    return change + np.random.default_rng(0).standard_normal((_DRAWS, len(change))) @ factor.T


def _range(values: Floats) -> tuple[float, float]:
    low, high = np.quantile(values, [0.05, 0.95])
    return float(low), float(high)


def _outer_radius(fit: CameraFit, camera: Camera) -> float:
    """Return the distance from the axis, in focal lengths, beyond which a tenth of the joints in the picture are."""
    joints = fit.equations.joints
    pixels = camera.project(joints[np.isfinite(joints[:, 0])])
    pixels = pixels[camera.inside(pixels)]
    if not len(pixels):
        return 0.0
    away = (pixels - [camera.K[0, 2], camera.K[1, 2]]) / [camera.K[0, 0], camera.K[1, 1]]
    return float(np.quantile(np.linalg.norm(away, axis=1), 0.9))


def _depths(fit: CameraFit, rig: Rig) -> Floats:
    """Return the median distance of people from each camera, (V,), metres."""
    joints = fit.equations.joints
    joints = joints[np.isfinite(joints[:, 0])]
    if not len(joints):
        return np.full(len(rig), 3.0)
    return np.array([float(np.median(np.linalg.norm(joints - center, axis=1))) for center in rig.centers])
