"""The doctor: what is wrong with a rig, found from the people in the pictures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration import sufficiency
from mvpose.calibration.camera_findings import findings_of_cameras, possible_errors, turn_finding
from mvpose.calibration.camera_models import ALWAYS
from mvpose.calibration.cameras import CameraFit, fit
from mvpose.calibration.clocks import estimate_clocks
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.conventions import FoundMistake, mistake_finding, search
from mvpose.calibration.findings import ALARM, Diagnosis, Finding, camera_names
from mvpose.calibration.mends import Mend
from mvpose.calibration.normal_equations import (
    CLOCK,
    JointViews,
    joint_views,
    residuals_of_others,
    with_errors,
    without_mismatches,
)
from mvpose.calibration.picture_offsets import COARSE_SPACING, OffsetSearch, blurred
from mvpose.calibration.pieces import cut_into_windows
from mvpose.calibration.reading_changes import reread_rig, reread_tracklets
from mvpose.calibration.rig_size import relative_size
from mvpose.calibration.sightings import Sightings, match_over_time, sightings_of
from mvpose.calibration.tracklet_matching import PeopleGroups
from mvpose.calibration.tracklets import Tracklets, link
from mvpose.calibration.unseen_mistakes import size_findings, unit_findings, world_findings
from mvpose.camera import Camera, Rig
from mvpose.detections import Detections


def diagnose(rig: Rig, frames: Sequence[Detections], *, period: float = 0.04, up: str | None = None) -> Diagnosis:
    """Return what is wrong with a rig.

    First the conventions of its files are checked by the distances of viewing rays, without any reconstruction
    (:mod:`.conventions`). Then the errors of each camera are estimated against the other cameras (:mod:`.cameras`),
    with mistakes in the files corrected.

    Args:
        rig: the cameras as calibrated.
        frames: detections of each frame, all views; ten seconds or more of people who walk.
        period: seconds between frames whose detections carry no time.
        up: axis of the world that points up, "z", "-y" ...; by default z.

    Raises:
        ValueError: frames of different skeletons, a view that the rig does not have, or wrong times.
    """
    names = camera_names(rig)
    tracklets = link(rig, frames, period=period)
    if not len(tracklets.frame):
        empty = Finding("cannot-tell", "cannot tell: there are no detections", "unknown", 1.0, mend=sufficiency.RECORD)
        return Diagnosis.of_findings([empty], evidence=[], cameras=names, residuals=np.full(len(rig), np.nan))
    detections = np.bincount(tracklets.view, minlength=len(rig))
    consistency = Consistency(cut_into_windows(tracklets))
    files = _examine_files(rig, tracklets, consistency, names)
    reading = files.reading
    findings = [*files.findings, *sufficiency.silent_views(detections, names)]
    mended = reread_rig(rig, reading)
    if mended is None:
        findings.append(_nowhere(rig))
        return Diagnosis.of_findings(findings, evidence=[], cameras=names, residuals=np.full(len(rig), np.nan))
    tracklets = reread_tracklets(tracklets, reading)
    matched = match_over_time(mended, tracklets)
    sightings, joints, rows, result = _fitted(mended, tracklets, matched)
    if result.faults:  # with a camera that is far off, people are matched wrongly
        matched_better = match_over_time(_with_found_faults(mended, reading, result), tracklets)
        sightings, joints, rows, result = _fitted(mended, tracklets, matched_better)
    moved = replace(reading, cameras=matched.rig.packed)
    agreement = sufficiency.PairAgreement.measured(consistency, reading, _corrected(reading, result), moved)
    found_strangers = sufficiency.strangers(agreement, detections, names)
    if found_strangers:
        sightings = sightings.select(
            ~np.isin(sightings.view, [each.view for each in found_strangers if each.view is not None])
        )
        joints, rows = joint_views(sightings)
        result = fit(mended.packed, joints)
    findings += found_strangers
    useless = {each.view for each in findings if each.kind in _USELESS and each.view is not None}
    times = np.nanmin(sightings.times[sightings.frame[rows]], axis=1) - np.nanmin(sightings.times)
    first = joints.start[:-1]
    missing = sufficiency.unknowns(
        result,
        seconds=_seconds(times),
        moved=_travelled(sightings, rows[first], result.equations.joints),
        agreement=agreement,
        left_out=useless,
        names=names,
    )
    findings += missing
    starts = np.array([times[first][joints.block == block].min(initial=np.inf) for block in range(joints.blocks)])
    undetermined = any(each.camera is None for each in missing)
    of_cameras = findings_of_cameras(result, mended, starts, names, undetermined=undetermined)
    if undetermined and not any(sufficiency.SHORT in each.text for each in missing):
        of_cameras = [replace(each, severity="unknown") if each.severity == "alarm" else each for each in of_cameras]
    findings += [each for each in of_cameras if each.view not in files.turned or each.kind != "moved-camera"]
    of_world, line = world_findings(mended, sightings, rows[first], result.equations.joints, up)
    after = _corrected(reading, result).cameras
    findings += of_world + [
        turn_finding(rig, after, result.covariance[view], view, names) for view in sorted(files.turned - useless)
    ]
    different = any(sufficiency.DIFFERENT in each.text for each in missing)
    if not different:  # otherwise neither files nor clocks can be compared
        clocks = estimate_clocks(_with_found_faults(mended, reading, result), sightings, period=period)
        findings += [each for each in clocks.findings() if each.view not in useless]
    if undetermined:
        findings = [replace(each, severity="unknown") if _doubtful(each, different) else each for each in findings]
    high = [] if undetermined else [possible_errors(result, view) for view in range(len(rig)) if view not in useless]
    residuals, usual = residuals_of_others(mended.packed, joints, scale=result.equations.scale)
    findings += _large_residuals(residuals, usual, findings, names)
    return Diagnosis.of_findings(
        findings,
        evidence=[*_evidence(result, times, agreement, files.size, (residuals, usual), names), *line],
        cameras=names,
        residuals=residuals,
        usual=usual,
        within={name: max(each[name] for each in high) for name in (high[0] if high else ())},
    )


@dataclass(frozen=True)
class ExaminedFiles:
    """What the files of a rig say."""

    reading: Reading
    """The files as they should be read."""
    findings: list[Finding]
    """The mistakes in them, in the order in which they are mended."""
    turned: set[int]
    """Cameras that are turned far from their calibration."""
    size: tuple[float, int]
    """How many times as large as adults people are, before the unit was mended, and from how many bones."""


def _examine_files(rig: Rig, tracklets: Tracklets, consistency: Consistency, names: Sequence[str]) -> ExaminedFiles:
    reading, mistakes = _without_mistakes(rig, tracklets, consistency)
    turned = {each.mistake.views[0] for each in mistakes if each.mistake.kind == "moved-camera"}
    findings = [mistake_finding(each, names) for each in mistakes if each.mistake.kind != "moved-camera"]
    size = relative_size(consistency, reading, tracklets.skeleton)
    reading, of_unit = unit_findings(reading, size[0])
    findings += of_unit
    cameras: Sequence[Camera] = list(rig)
    for each in findings:
        if each.repair:
            cameras = Mend.parsed(each.repair[1]).applied(cameras)
    return ExaminedFiles(reading, [*findings, *size_findings(cameras, tracklets, names)], turned, size)


def _nowhere(rig: Rig) -> Finding:
    """Return the finding of cameras that make no rig under any reading."""
    extent = float(np.ptp(rig.centers, axis=0).max())
    where = f"up to {extent:.3g} m apart" if extent > 1e-3 else "in one point"
    text = f"cannot tell: the cameras stand {where}, and no known mistake of files explains it"
    return Finding("cannot-tell", text, "unknown", 0.99, mend="calibrate the cameras again")


def _large_residuals(
    residuals: Floats, usual: Floats, findings: Sequence[Finding], names: Sequence[str]
) -> list[Finding]:
    """Return the cameras whose residuals are not those of a right rig, where no alarm explains them."""
    if any(each.severity == "alarm" for each in findings):
        return []
    with np.errstate(invalid="ignore"):
        times = residuals / usual
    result = []
    for view in np.flatnonzero(times >= ALARM["times_usual"]).tolist():
        text = f"keypoints of {names[view]} are {residuals[view]:.0f} px from the people as seen by the other cameras, "
        text += f"{usual[view]:.0f} px are usual, and no fault of a camera explains it"
        advice = (
            "draw the detections into the pictures of this camera, and compare its pictures with the others' in time"
        )
        size = {"times_usual": float(times[view])}
        result.append(Finding("large-residual", text, "unknown", 0.5, names[view], view, size, cost=0.01, mend=advice))
    return result


def _without_mistakes(rig: Rig, tracklets: Tracklets, consistency: Consistency) -> tuple[Reading, list[FoundMistake]]:
    """Return the files of a rig as they should be read, and the mistakes in them."""

    def corrected(reading: Reading) -> Reading:
        mended = reread_rig(rig, reading)
        if mended is None:
            return reading
        found = match_over_time(mended, reread_tracklets(tracklets, reading)).rig
        return replace(reading, cameras=found.packed)

    sizes = [camera.size for camera in rig]
    coarse = Consistency(blurred(cut_into_windows(tracklets, spacing=COARSE_SPACING), sizes))
    offsets = OffsetSearch(consistency, coarse, sizes)
    return search(consistency, Reading.as_given(rig.packed), offsets, corrected)


_USELESS = ("silent-view", "other-people")
_SUBTLE = ("distortion-ignored", "distortion-model", "image-cropped", "clock-offset", "dropped-pictures")
"""Kinds that look like small errors of poses."""


def _doubtful(finding: Finding, different: bool) -> bool:
    """Whether a finding is unknown because the recording does not determine the calibration.

    Args:
        finding: the finding.
        different: whether the cameras do not see the same people.
    """
    return finding.severity == "alarm" and finding.kind not in _USELESS and (different or finding.kind in _SUBTLE)


def _fitted(rig: Rig, tracklets: Tracklets, groups: PeopleGroups) -> tuple[Sightings, JointViews, Integers, CameraFit]:
    """Return the matched sightings, the joints among them, their rows, and the fit of the cameras."""
    matched = sightings_of(tracklets, groups.person)
    sightings = without_mismatches(rig.packed, matched, *joint_views(matched))
    joints, rows = joint_views(sightings)
    return sightings, joints, rows, fit(rig.packed, joints)


def _corrected(reading: Reading, result: CameraFit) -> Reading:
    """Return the reading with the estimated corrections of the cameras, at the end of the recording."""
    return replace(reading, cameras=with_errors(reading.cameras, result.change.reshape(1, -1))[0, :, :22].copy())


def _with_found_faults(rig: Rig, reading: Reading, result: CameraFit) -> Rig:
    """Return the rig with what was found to be wrong all the time corrected.

    Poses are corrected along with the clocks (:mod:`.clock_adjustment`) where they are off by little, lenses are not.
    """
    change = np.zeros_like(result.change)
    for each in result.faults:
        own = np.array(each.fault.model.index)
        if each.fault.course == ALWAYS and own[0] < CLOCK.start:
            change[each.fault.view, own] = each.change[own]
    cameras = with_errors(reading.cameras, change.reshape(1, -1))[0, :, :22].copy()
    return reread_rig(rig, replace(reading, cameras=cameras)) or rig


def _seconds(times: Floats) -> float:
    """Return how long people were seen by several views: time in which the next sighting came within half a second."""
    gaps = np.diff(np.unique(times))
    return float(gaps[gaps <= 0.5].sum())


def _travelled(sightings: Sightings, rows: Integers, joints: Floats) -> float:
    """Return how far people moved in all, metres, by the joint of each that is seen most."""
    if not len(rows):
        return 0.0
    number = sightings.person[rows] * len(sightings.skeleton) + sightings.joint[rows]
    person = sightings.person[rows]
    result = 0.0
    for each in np.unique(person):
        own = np.flatnonzero(person == each)
        names, counts = np.unique(number[own], return_counts=True)
        result += sufficiency.travelled(joints[own[number[own] == names[np.argmax(counts)]]])
    return result


def _evidence(
    result: CameraFit,
    times: Floats,
    agreement: sufficiency.PairAgreement,
    size: tuple[float, int],
    medians: tuple[Floats, Floats],
    names: Sequence[str],
) -> list[str]:
    """Return the numbers on which the verdict rests."""
    pairs, (ratio, bones) = agreement.pairs[np.isfinite(agreement.pairs)], size
    known = np.isfinite(result.equations.joints[:, 0])
    lines = [
        f"{int(known.sum())} joints seen by two cameras or more, over {_seconds(times):.1f} s",
        f"agreement of pairs of cameras (1: rays meet as well as keypoints allow): mean {pairs.mean():.2f}, "
        f"least {pairs.min():.2f}"
        if len(pairs)
        else "no two cameras have detections at the same time",
    ]
    if np.isfinite(ratio):
        lines.append(f"people are {ratio:.2f} times as large as adults ({bones} bones)")
    lines.append(
        "median distance of keypoints from the people as seen by the other cameras: "
        + ", ".join(
            f"{name} {value:.1f} px (usual {normal:.0f})" for name, value, normal in zip(names, *medians, strict=True)
        )
    )
    lines.append(
        f"errors of keypoints are {result.equations.scale:.2f} of the error model, {result.quadratic.temper:.1f} of "
        "them count as one"
    )
    for name, change, covariance in zip(names, result.change, result.covariance, strict=True):
        turn, shift = np.degrees(np.linalg.norm(change[:3])), 100 * np.linalg.norm(change[3:6])
        sigma = np.sqrt(np.diagonal(covariance))
        lines.append(
            f"{name}: estimated correction {turn:.2f} degrees and {shift:.1f} cm "
            f"(standard deviations {np.degrees(sigma[:3].max()):.2f} degrees and {100 * sigma[3:6].max():.1f} cm)"
        )
    return lines
