"""Page of the doctor: what is wrong with a rig, in plain words and in pictures, before and after the repair."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from markupsafe import Markup

from mvpose.arrays import Floats
from mvpose.calibration.findings import ALARM, Diagnosis, camera_names
from mvpose.calibration.normal_equations import joint_views, residuals_of_others
from mvpose.calibration.repair import Repair
from mvpose.calibration.sightings import Sightings, gather
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.files.atomic_files import write_atomic
from mvpose.recording import PERIOD
from mvpose.report import doctor_drawings as drawings
from mvpose.report.documents import fill_template, program_version
from mvpose.report.leave_one_out import Missing, leave_one_out, mean_field
from mvpose.report.picture_drawings import Pictures, picture_element
from mvpose.report.tables import number
from mvpose.report.verdict import quantities, sentence, sentence_of

PAGE, NUMBERS = "doctor.html", "doctor.json"
"""Names of the files that :func:`write_doctor_page` writes."""

_EVIDENCE = 4  # lines below the verdict; more unfold
_MOST_VIEWS = 16  # with residual arrows: those with the largest residuals
_NINETY = 1.645  # standard deviations of a Gaussian to each side of the middle 90 %


def write_doctor_page(
    folder: str | Path,
    *,
    name: str,
    rig: Rig,
    frames: Sequence[Detections],
    diagnosis: Diagnosis,
    repair: Repair | None = None,
    sightings: Sightings | None = None,
    pictures: Pictures | None = None,
    period: float = PERIOD,
    command: Callable[[tuple[str, ...]], str] | None = None,
) -> Path:
    """Write what the doctor found, ``doctor.html``, and its numbers, ``doctor.json``.

    Args:
        folder: an existing folder.
        name: what was examined, the title of the page.
        rig: the rig as it was given.
        frames: detections of each frame.
        diagnosis: what is wrong.
        repair: the corrected rig, where there is one.
        sightings: keypoints matched over time and views; by default they are matched here, with the corrected rig where
            there is one (:func:`mvpose.calibration.gather`).
        pictures: function that returns the picture of a frame and view; by default drawings are on plain ground.
        period: seconds between frames whose detections carry no time.
        command: returns the command with options of ``mvpose repair`` (:attr:`mvpose.calibration.Finding.repair`) that
            a reader can copy.

    Returns:
        Path of the page.

    Raises:
        OSError: the folder cannot be written to.
    """
    if sightings is None:
        better = rig if repair is None or repair.refused is not None else repair.rig
        sightings = gather(better, frames, period=period)
    case = DoctorCase.of(rig, sightings, diagnosis, repair)
    page = fill_template(
        "doctor.html",
        program="mvpose",
        code=program_version(),
        name=name,
        verdict=diagnosis.verdict,
        sentence=sentence(diagnosis),
        evidence=diagnosis.evidence[:_EVIDENCE],
        more_evidence=diagnosis.evidence[_EVIDENCE:],
        findings=diagnosis.findings,
        sentence_of=sentence_of,
        quantities=quantities,
        command=command or _plain_command,
        refused=None if repair is None else repair.refused,
        repaired=case.after is not None,
        above=_above(case),
        cameras=_cameras(case),
        held=() if repair is None else repair.held,
        fields=_fields(case),
        lines=_lines(case, pictures),
        clocks=_clocks(case),
    )
    numbers = {"name": name, **diagnosis.to_json(), "repair": None if repair is None else repair.to_json()}
    write_atomic(Path(folder) / NUMBERS, (json.dumps(numbers, indent=1, allow_nan=False) + "\n").encode())
    write_atomic(Path(folder) / PAGE, page.encode())
    return Path(folder) / PAGE


@dataclass(frozen=True)
class DoctorCase:
    """A rig with its residuals before and after the repair."""

    rig: Rig
    """The rig as it was given."""
    names: tuple[str, ...]
    """Names of its cameras, all different."""
    sightings: Sightings
    """Keypoints matched over time and views."""
    diagnosis: Diagnosis
    """What is wrong."""
    repair: Repair | None
    """The repair, or None."""
    before: Missing
    """Residuals of the sightings with the rig."""
    after: Missing | None
    """Residuals with the repaired rig; None where nothing was changed."""
    medians: dict[str, Floats]
    """Median residual of each view, (V,), pixels, ``"before"`` and, where there is a repair, ``"after"``; NaN for a
    view without any. Of files that need no mend, these before are the diagnosis's own."""

    @classmethod
    def of(cls, rig: Rig, sightings: Sightings, diagnosis: Diagnosis, repair: Repair | None) -> Self:
        """Compare the sightings with both rigs."""
        joints, after = joint_views(sightings)[0], None
        mended = any(each.severity == "alarm" and "--mend" in each.repair for each in diagnosis.findings)
        own = diagnosis.usual is not None and not mended
        before = diagnosis.residuals if own else residuals_of_others(rig.packed, joints, scale=1.0)[0]
        medians = {"before": before}
        if repair is not None and repair.refused is None:
            after = leave_one_out(repair.rig, sightings, offsets=repair.offsets)
            moved = joints.pixels - joints.velocity * repair.offsets[joints.view, None]  # to the times of the clocks
            medians["after"] = residuals_of_others(repair.rig.packed, replace(joints, pixels=moved), scale=1.0)[0]
        return cls(rig, camera_names(rig), sightings, diagnosis, repair, leave_one_out(rig, sightings), after, medians)

    @property
    def accused(self) -> list[int]:
        """Views that an alarm names, worst first."""
        return list(dict.fromkeys(each.view for each in self.diagnosis.alarms if each.view is not None))


def _plain_command(options: tuple[str, ...]) -> str:
    return " ".join(["mvpose repair CALIBRATION DETECTIONS", *options, "--out NEW"]) if options else ""


def _above(case: DoctorCase) -> dict[str, Any]:
    repaired = None if case.after is None or case.repair is None else case.repair.rig
    moved = case.accused
    if repaired is not None and not moved:
        moved = [view for view in range(len(case.rig)) if np.any(repaired[view].P != case.rig[view].P)]
    factor = 1.0 if repaired is None or not moved else drawings.motion_factor(case.rig, repaired)
    svg = drawings.rig_from_above(case.rig, repaired=repaired, moved=moved, points=case.before.point, factor=factor)
    return {"svg": Markup(svg), "factor": f"{factor:g}" if factor > 1 else ""}


def _cameras(case: DoctorCase) -> list[dict[str, Any]]:
    """Return the rows of the table of cameras."""
    before, after = case.medians["before"], case.medians.get("after")
    rows = []
    for view, name in enumerate(case.names):
        usual = math.nan if case.diagnosis.usual is None else float(case.diagnosis.usual[view])
        large, accused = before[view] >= ALARM["times_usual"] * usual, view in case.accused
        row: dict[str, Any] = {"name": name, "before": number(before[view]), "large": large, "accused": accused}
        row["usual"] = number(usual)
        if after is not None and case.repair is not None:
            correction, covariance = case.repair.corrections[view], case.repair.covariance[view]
            row["turned"] = _with_spread(correction[:3], covariance[:3, :3], 180.0 / math.pi, "°", 2)
            row["moved"] = _with_spread(correction[3:], covariance[3:, 3:], 100.0, " cm", 1)
            row["after"] = number(after[view])
        rows.append(row)
    return rows


def _with_spread(vector: Floats, covariance: Floats, factor: float, unit: str, digits: int) -> str:
    """Return the length of a correction with its 90 % interval, as text; the spread is that along the correction."""
    length = float(np.linalg.norm(vector))
    if length == 0.0 and not np.any(covariance):
        return "held"
    along = vector / length if length > 0 else np.array([1.0, 0.0, 0.0])
    spread = _NINETY * math.sqrt(max(float(along @ covariance @ along), 0.0))
    return f"{factor * length:.{digits}f}{unit} ± {factor * spread:.{digits}f}"


def _fields(case: DoctorCase) -> dict[str, Any] | None:
    """Return the residual arrows of each camera; None where no camera has enough residuals."""
    order = np.argsort(-np.nan_to_num(case.medians["before"], nan=-1.0), kind="stable")[:_MOST_VIEWS]
    kinds = {"before": case.before, **({} if case.after is None else {"after": case.after})}
    fields = {
        (view, kind): drawings.Field(*_mean_field(case, missing, view))
        for view in sorted(order.tolist())
        for kind, missing in kinds.items()
    }
    if not any(len(field.offsets) for field in fields.values()):
        return None
    factor = drawings.exaggeration([(field, case.rig[view].size[0]) for (view, _), field in fields.items()])
    views = []
    for view in sorted(order.tolist()):
        camera = case.rig[view]
        parts: list[str] = []
        notes: list[str] = []
        for kind in kinds:
            field = fields[view, kind]
            parts += drawings.draw_field(camera, field, kind=kind, factor=factor)
            notes.append(number(case.medians[kind][view]))
        label = f"residual arrows of camera {case.names[view]}"
        views.append(
            {
                "name": case.names[view],
                "note": f"median {' → '.join(notes)} px",
                "accused": view in case.accused,
                "svg": Markup(picture_element(camera, parts, label=label)),
            }
        )
    return {"views": views, "factor": f"{factor:g}", "hidden": len(case.rig) - len(views)}


def _mean_field(case: DoctorCase, missing: Missing, view: int) -> tuple[Floats, Floats]:
    here = case.sightings.view == view
    return mean_field(case.sightings.pixels[here], missing.offset[here], size=case.rig[view].size)


def _lines(case: DoctorCase, pictures: Pictures | None) -> dict[str, Any] | None:
    """Return the epipolar lines of some joints in a pair of views; None where no pair shares any."""
    residuals = np.nan_to_num(case.medians["before"], nan=-1.0)
    second = case.accused[0] if case.accused else int(np.argmax(residuals))
    first = drawings.best_partner(case.sightings, second, case.rig)
    if first is None:
        return None
    joints = drawings.matched_joints(case.sightings, (first, second), case.rig)
    if not joints:
        return None
    before, after = (case.rig[first], case.rig[second]), None
    if case.after is not None and case.repair is not None:
        after = case.repair.rig[first], case.repair.rig[second]
    parts = [*drawings.draw_lines(*before, joints, kind="before")]
    parts += [] if after is None else drawings.draw_lines(*after, joints, kind="after")
    views = []
    for view, over in ((first, []), (second, parts)):
        dots = drawings.draw_joints(case.rig[view], joints, second=view == second)
        bodies = drawings.draw_bodies(case.rig[view], case.sightings, joints[0].frame, view)
        picture = None if pictures is None else pictures(joints[0].frame, view)
        label = f"joints in camera {case.names[view]}"
        element = picture_element(case.rig[view], [*bodies, *over, *dots], label=label, picture=picture)
        views.append({"name": case.names[view], "svg": Markup(element)})
    pairs = [before] if after is None else [before, after]
    rows = [(joint.name, [number(drawings.distance_from_line(*pair, joint)) for pair in pairs]) for joint in joints]
    return {"views": views, "rows": rows, "frame": joints[0].frame}


def _clocks(case: DoctorCase) -> Markup | None:
    """Return the plot of clock offsets of the repair and of findings; None where nothing is known of any."""
    offsets: dict[int, drawings.ClockOffset] = {}
    if case.repair is not None and case.repair.refused is None and np.any(case.repair.offsets):
        spread = _NINETY * case.repair.offset_sigmas
        for view, (value, half) in enumerate(zip(case.repair.offsets.tolist(), spread.tolist(), strict=True)):
            low, high = (value - half, value + half) if half > 0 else (math.nan, math.nan)
            offsets[view] = drawings.ClockOffset(case.names[view], 1000.0 * value, 1000.0 * low, 1000.0 * high)
    for finding in case.diagnosis.findings:
        if finding.kind == "clock-offset" and finding.view is not None and "ms" in finding.size:
            low, high = finding.interval.get("ms", (math.nan, math.nan))
            offsets[finding.view] = drawings.ClockOffset(case.names[finding.view], finding.size["ms"], low, high)
    if not offsets:
        return None
    return Markup(drawings.clock_offsets([offsets[view] for view in sorted(offsets)]))
