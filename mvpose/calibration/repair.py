"""Repair of a rig from the people in its pictures.

Matching over seconds and bundle adjustment alternate: matching with a wrong rig gives a better rig, which matches more.
Only what the data determine is changed; the rest is held, with the reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.adjustment import Adjustment, adjust, importance_by_place, shared_effect, shared_joints
from mvpose.calibration.calibration_prior import Prior
from mvpose.calibration.mends import Mend
from mvpose.calibration.normal_equations import (
    CENTER,
    CLOCK,
    FOCAL,
    PARAMETERS,
    POSE,
    ROTATION,
    TRANSLATION,
    normal_equations,
    with_errors,
)
from mvpose.calibration.rig_size import Bodies, resized, size_of_people
from mvpose.calibration.sightings import Sightings, match_over_time, sightings_of
from mvpose.calibration.tracklet_matching import PeopleGroups, RigUncertainty, match_tracklets
from mvpose.calibration.tracklets import Tracklets, chosen_frames, link
from mvpose.camera import Camera, Rig
from mvpose.detections import Detections
from mvpose.json_values import json_value

Freedom = Literal["extrinsics", "focal", "center"]
"""What a repair may change: places and orientations; focal lengths; principal points."""

Size = Literal["calibration", "people", "both"]
"""What decides the size of the whole rig: the believed calibration, the bone lengths of people, or both by their
uncertainties."""

_PLACES = {"extrinsics": POSE, "focal": FOCAL, "center": CENTER}
_SPACING = 0.2  # seconds between the frames that are used: errors of detectors last as long
NARROW = RigUncertainty(np.radians(0.3), 0.02, 0.02)
"""Uncertainty of a rig that has been adjusted once."""
_MOST_TURNS = 3
_LEAST_CAMERAS = 3
_LEAST_SIGHTINGS = 100
_LEAST_SHARED = 20  # sightings of a camera that other cameras share
_CAN_TELL = (float(np.radians(0.75)), 0.06)  # standard deviations beyond which a pose is not determined: rad, m
_LEAST_EFFECT = 5.0  # design effect of errors that joints and people share, measured on 12 simulated recordings
_TOO_FEW_PLACES = (
    "cannot tell: people were in too few places to distinguish a turned camera from a moved one; record a person who "
    "walks through the whole scene for ten seconds"
)
_TOO_FEW_SHARED = (
    "cannot tell: hardly anybody is seen by two cameras at one time; record people in the middle of the scene, or "
    "check that the cameras film one place and that their files are in the order of the rig"
)


@dataclass(frozen=True)
class Repair:
    """Repaired rig, and what is known about it."""

    rig: Rig
    """Repaired cameras; the given rig, the same object, where the repair is refused."""
    offsets: Floats
    """Time that a camera's clock is behind, (V,), seconds: a picture stamped t was taken at t + offset."""
    corrections: Floats
    """Change of each camera, (V, 6): rotation vector about its optical centre (world axes, rad), and shift of the
    centre, metres."""
    covariance: Floats
    """Of the corrections of each camera, (V, 6, 6); 0 for cameras that were held."""
    offset_sigmas: Floats
    """Standard deviations of the offsets, (V,), seconds; 0 where they were held."""
    focal: Floats
    """Factor of each focal length, (V,)."""
    center: Floats
    """Shift of each principal point, (V, 2), pixels."""
    held: tuple[str, ...]
    """What was not changed, and why."""
    refused: str | None
    """Why nothing was changed; None where the rig was repaired."""
    residuals_before: Floats
    """Median distance between keypoints and projected joints with the given rig, (V,), pixels; NaN for a view that
    shares nobody with others."""
    residuals_after: Floats
    """The same with the repaired rig."""
    people: int
    """Number of people whom two or more views see."""
    scale: float = 1.0
    """Factor of the size of the whole rig, where people decide it."""

    def to_json(self) -> dict[str, Any]:
        """Return all numbers and texts, ready for JSON; missing values are None."""
        cameras = [
            {
                "name": camera.name,
                "R": camera.R,
                "t": camera.t,
                "K": camera.K,
                "rotation_degrees": np.degrees(self.corrections[v, :3]),
                "shift_metres": self.corrections[v, 3:],
                "sigma_degrees": np.degrees(np.sqrt(np.diag(self.covariance[v])[:3])),
                "sigma_metres": np.sqrt(np.diag(self.covariance[v])[3:]),
                "offset_seconds": self.offsets[v],
                "sigma_offset_seconds": self.offset_sigmas[v],
                "focal_factor": self.focal[v],
                "center_pixels": self.center[v],
                "residual_before_pixels": self.residuals_before[v],
                "residual_after_pixels": self.residuals_after[v],
            }
            for v, camera in enumerate(self.rig)
        ]
        values = {"refused": self.refused, "held": self.held, "people": self.people, "scale": self.scale}
        found: dict[str, Any] = json_value({**values, "cameras": cameras})
        return found


def repair(
    rig: Rig,
    frames: Sequence[Detections],
    *,
    period: float = 0.04,
    free: Sequence[Freedom] = ("extrinsics",),
    cameras: Sequence[int | str] | None = None,
    clocks: bool = True,
    prior: Prior | None = None,
    size: Size = "calibration",
) -> Repair:
    """Repair the calibration of a rig from detections of people over time.

    The place, the orientation and the size of the whole rig are not in the data: they stay those of the believed rig,
    of the majority of its cameras where most agree with each other.

    Args:
        rig: believed cameras.
        frames: detections of each frame, all views.
        period: seconds between frames whose detections carry no time.
        free: what may change.
        cameras: indices or names of the cameras that may change; by default all.
        clocks: whether the clocks of the cameras may be off.
        prior: plausible errors of the believed rig.
        size: what decides the size of the whole rig. By ``"people"`` adults have the published mean stature, which is
            known up to 5.5 % for one person and to the root of their number less for several. By ``"both"`` a careful
            calibration decides nearly alone, and people do where all cameras were far off.

    Returns:
        The repaired rig, or the given one with the reason in ``refused``.

    Raises:
        ValueError: an unknown freedom or camera, or frames that do not fit the rig.
    """
    if size not in get_args(Size):
        raise ValueError(f"size must be one of {', '.join(get_args(Size))}, got {size!r}")
    allowed = _allowed(rig, free, cameras, clocks=clocks)
    tracklets = link(rig, frames, period=period)
    if len(rig) < _LEAST_CAMERAS:
        return _refused(rig, "cannot tell: of two cameras either may be off; add a third that sees the same people")
    if not len(tracklets):
        return _refused(
            rig, "cannot tell: there are no detections; record people who walk through the views of all cameras"
        )
    groups = match_over_time(rig, tracklets)
    sightings, adjusted, held, reason = _alternate(rig, tracklets, groups, allowed, prior)
    if reason:
        return _refused(rig, reason)
    result = _result(rig, sightings, adjusted, held)
    return result if size == "calibration" else _of_size(size, result, sightings, adjusted)


def mended(rig: Rig, frames: Sequence[Detections], options: Sequence[str], *, period: float = 0.04) -> Repair:
    """Return the repair by options of ``mvpose repair`` (:attr:`mvpose.calibration.Diagnosis.repair`).

    Raises:
        ValueError: a mend that is not possible, or cameras that make no rig after it.
    """
    pairs = list(zip(options[::2], options[1::2], strict=True))
    cameras: Sequence[Camera] = list(rig)
    for name, value in pairs:
        if name == "--mend":
            cameras = Mend.parsed(value).applied(cameras)
    free = [each for name, value in pairs if name == "--free" for each in value.split(",")]
    better = Rig(cameras)
    if free:
        result = repair(better, frames, period=period, free=[each for each in get_args(Freedom) if each in free])
    else:
        result = replace(_refused(better, ""), refused=None, held=())
    turns = [after.R.T @ before.R for before, after in zip(rig, result.rig, strict=True)]
    corrections = np.column_stack([Rotation.from_matrix(turns).as_rotvec(), result.rig.centers - rig.centers])
    return replace(result, corrections=corrections)


def _alternate(
    rig: Rig, tracklets: Tracklets, groups: PeopleGroups, allowed: Bools, prior: Prior | None
) -> tuple[Sightings, Adjustment, list[str], str | None]:
    """Match and adjust in turn; return what was found, the reasons for what was held, and that for a refusal."""
    chosen = chosen_frames(tracklets, spacing=_SPACING)
    person, start, offsets = groups.person, groups.rig, np.zeros(len(rig))
    for _ in range(_MOST_TURNS):
        sightings = _used(tracklets, person, chosen)
        mask, held = _connected(rig, sightings, allowed)
        if not mask.any():
            break
        adjusted = adjust(rig, sightings, free=mask, prior=prior, start=start, offsets=offsets)
        loose = _undetermined(rig, sightings, adjusted, mask)
        if loose.any():
            mask[loose] = False
            held += [f"{_name(rig, int(view))}: {_TOO_FEW_PLACES}" for view in np.flatnonzero(loose)]
            if not mask.any():
                break
            adjusted = adjust(rig, sightings, free=mask, prior=prior, start=adjusted.rig, offsets=offsets)
        again = match_tracklets(adjusted.rig, tracklets, NARROW)
        if _same_groups(again.person, person):
            break
        person, start, offsets = again.person, adjusted.rig, adjusted.parameters[:, CLOCK].ravel()
    reason = None
    if not mask.any():
        adjusted = adjust(rig, sightings, free=mask, prior=prior)
        reasons = sorted({each.split(": ", 1)[1] for each in held})
        reason = "; ".join(reasons) if len(sightings) >= _LEAST_SIGHTINGS else _TOO_FEW_SHARED
    return sightings, adjusted, held, reason


def _allowed(rig: Rig, free: Sequence[Freedom], cameras: Sequence[int | str] | None, *, clocks: bool) -> Bools:
    """Return the parameters that may change, (V, 11)."""
    unknown = [each for each in free if each not in get_args(Freedom)]
    if isinstance(free, str) or unknown:
        raise ValueError(f"free must be some of {', '.join(get_args(Freedom))}, got {free!r}")
    names = [camera.name for camera in rig]
    chosen = np.zeros(len(rig), np.bool_)
    for each in range(len(rig)) if cameras is None else cameras:
        view = names.index(each) if each in names else each
        if isinstance(view, str) or not 0 <= view < len(rig):
            raise ValueError(
                f"cameras names {each!r}, which the rig does not have; expected names ({', '.join(names)}) or indices "
                f"from 0 to {len(rig) - 1}"
            )
        chosen[view] = True
    result = np.zeros((len(rig), PARAMETERS), np.bool_)
    for each in free:
        result[chosen, _PLACES[each]] = True
    result[chosen, CLOCK] = clocks
    return result


def _used(tracklets: Tracklets, person: Integers, chosen: Bools) -> Sightings:
    sightings = sightings_of(tracklets, person)
    return sightings.select(np.flatnonzero(chosen[sightings.frame] & sightings.shared))


def _same_groups(one: Integers, other: Integers) -> bool:
    """Whether two numberings of tracklets group them alike."""
    pairs = len(np.unique(np.stack([one, other]), axis=1).T)
    return pairs == len(np.unique(one)) == len(np.unique(other))


def _connected(rig: Rig, sightings: Sightings, allowed: Bools) -> tuple[Bools, list[str]]:
    """Hold cameras that share nobody with two others; return the mask of the rest and the reasons."""
    views = len(rig)
    points, count = sightings.points
    seen = np.zeros((views, count), np.float32)
    seen[sightings.view, points] = 1.0
    common = seen @ seen.T
    linked = (common >= _LEAST_SHARED) & ~np.eye(views, dtype=bool)
    reach = np.linalg.matrix_power(linked.astype(float) + np.eye(views), views) > 0
    mask, held = allowed.copy(), []
    for view in range(views):
        if not allowed[view].any():
            continue
        name = _name(rig, view)
        if not linked[view].any():
            mask[view] = False
            held.append(f"{name}: cannot tell, it shares nobody with other cameras; record people whom others see too")
        elif reach[view].sum() < _LEAST_CAMERAS:
            mask[view] = False
            held.append(
                f"{name}: cannot tell, it shares people with one camera alone, which may be the wrong one; record "
                "people whom three cameras see"
            )
    return mask, held


def _undetermined(rig: Rig, sightings: Sightings, adjusted: Adjustment, mask: Bools) -> Bools:
    """Return the cameras whose pose the data do not determine even with all other cameras fixed, (V,).

    Sightings in one place count as one here: the detector may repeat its errors on a person who does not move.
    """
    joints, found = adjusted.joints, adjusted.equations
    first = adjusted.rows[joints.start[:-1]]
    weight, place = importance_by_place(joints.person, sightings.frame[first], sightings.joint[first], found.joints)
    by_place = replace(joints, importance=weight, cluster=place)
    cameras = with_errors(rig.packed, adjusted.parameters.ravel())
    equations = normal_equations(cameras, by_place, scale=found.scale, joints=found.joints)
    loose, whole = np.flatnonzero(mask.ravel()), equations.H[0]
    effect = shared_effect(equations.g[:, loose], np.ones(len(equations.g)), whole[np.ix_(loose, loose)])
    whole = whole / max(effect, _LEAST_EFFECT)
    result = np.zeros(len(mask), np.bool_)
    for view in np.flatnonzero(mask[:, :6].all(axis=1)):
        block = slice(PARAMETERS * view, PARAMETERS * view + 6)
        information = whole[block, block]
        size = np.sqrt(np.maximum(np.diag(information), 1e-9))
        scaled = information / np.outer(size, size) + 1e-9 * np.eye(6)
        sigmas = np.sqrt(np.diag(np.linalg.inv(scaled))) / size
        turned, moved = (float(np.linalg.norm(sigmas[place])) for place in (ROTATION, TRANSLATION))
        result[view] = turned > _CAN_TELL[0] or moved > _CAN_TELL[1]
    return result


def _residuals(rig: Rig, sightings: Sightings, parameters: Floats) -> Floats:
    """Return the median distance of keypoints from projected joints by view, (V,), pixels, with changed cameras."""
    joints, _ = shared_joints(sightings)
    error = np.linalg.norm(normal_equations(with_errors(rig.packed, parameters.ravel()), joints).residuals, axis=1)
    of_views = [error[(joints.view == view) & np.isfinite(error)] for view in range(len(rig))]
    return np.array([np.median(each) if len(each) else np.nan for each in of_views])


def _result(rig: Rig, sightings: Sightings, adjusted: Adjustment, held: list[str]) -> Repair:
    views, parameters = len(rig), adjusted.parameters
    covariance = adjusted.covariance.reshape(views, PARAMETERS, views, PARAMETERS)
    own = np.stack([covariance[v, :, v] for v in range(views)])
    # From rotations about the axes of the cameras, R' = exp(w) R, to turns of the cameras about those of the world.
    to_world = np.tile(np.eye(6), (views, 1, 1))
    to_world[:, ROTATION, ROTATION] = [-camera.R.T for camera in rig]
    return Repair(
        rig=adjusted.rig,
        offsets=parameters[:, CLOCK].ravel(),
        corrections=np.einsum("vab,vb->va", to_world, parameters[:, POSE]),
        covariance=to_world @ own[:, POSE, POSE] @ np.swapaxes(to_world, 1, 2),
        offset_sigmas=np.sqrt(own[:, CLOCK, CLOCK].ravel()),
        focal=np.exp(parameters[:, FOCAL].ravel()),
        center=parameters[:, CENTER],
        held=tuple(held),
        refused=None,
        residuals_before=_residuals(rig, sightings, np.zeros_like(parameters)),
        residuals_after=_residuals(rig, sightings, parameters),
        people=len(np.unique(sightings.person)),
    )


def _of_size(size: Size, result: Repair, sightings: Sightings, adjusted: Adjustment) -> Repair:
    """Return the repair with the size of the rig by the bone lengths of people, or by both."""
    first = adjusted.rows[adjusted.joints.start[:-1]]
    people, sigma = size_of_people(Bodies.of_joints(sightings, first, adjusted.equations.joints))
    if not np.isfinite(people):
        reason = "size of the rig: too few limbs are seen whole to measure people; record people from head to foot"
        return replace(result, held=(*result.held, reason))
    arms = result.rig.centers - result.rig.centers.mean(axis=0)
    growth = np.zeros_like(adjusted.parameters)  # logarithm of the size by the parameters of all cameras
    growth[:, TRANSLATION] = arms / (arms**2).sum()
    believed = float(growth.ravel() @ adjusted.covariance @ growth.ravel())  # variance of the size of the rig
    share = 1.0 if size == "people" else believed / (believed + sigma**2)
    factor = float(people**-share)
    rig, grown = resized(result.rig, factor), sigma**2 * share - believed
    corrections, covariance = result.corrections.copy(), result.covariance.copy()
    corrections[:, TRANSLATION] += rig.centers - result.rig.centers
    if grown > 0:  # a smaller variance of the size is not taken off: position and size are not independent
        covariance[:, TRANSLATION, TRANSLATION] += grown * arms[:, :, None] * arms[:, None]
    return replace(result, rig=rig, corrections=corrections, covariance=covariance, scale=factor)


def _refused(rig: Rig, reason: str) -> Repair:
    views = len(rig)
    unknown = np.full(views, np.nan)
    return Repair(
        rig=rig,
        offsets=np.zeros(views),
        corrections=np.zeros((views, 6)),
        covariance=np.zeros((views, 6, 6)),
        offset_sigmas=np.zeros(views),
        focal=np.ones(views),
        center=np.zeros((views, 2)),
        held=tuple(f"{_name(rig, view)}: all" for view in range(views)),
        refused=reason,
        residuals_before=unknown,
        residuals_after=unknown,
        people=0,
    )


def _name(rig: Rig, view: int) -> str:
    return f"camera {rig[view].name or view}"
