"""Findings of the doctor: one fault of a rig each, with its probability, its size and what mends it.

A finding is an *alarm* where the calibration, the clocks or the pictures are wrong by more than good ones are; a *note*
where a difference is measured that good rigs have as well; and *unknown* where the recording does not determine it.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self, get_args

from mvpose.arrays import Floats
from mvpose.camera import Camera, Rig
from mvpose.checks import Sealed, as_array
from mvpose.json_values import json_value

Severity = Literal["alarm", "note", "unknown"]
Verdict = Literal["fine", "faults", "cannot tell"]

KINDS: Mapping[str, str] = MappingProxyType(
    tomllib.loads((Path(__file__).parent / "data" / "findings.toml").read_text(encoding="utf-8"))
)
"""Kinds of findings, and what each states."""

ALARM: Mapping[str, float] = MappingProxyType(
    {"degrees": 0.5, "metres": 0.04, "percent": 2.0, "px": 10.0, "edge_px": 6.0, "ms": 10.0, "times_usual": 2.5}
)
"""Sizes from which an error is an alarm: turn and shift of a camera, focal length, principal point, lens at the
outermost tenth of the people, clock, and residual over the usual one. Errors of good rigs are smaller: the corrections
that are estimated for careful, published calibrations are 0.05 to 0.28 degrees and 1 to 2.5 cm (Shelf)."""

EXCLUDED: Mapping[str, float] = MappingProxyType({"degrees": 1.0, "metres": 0.12})
"""Sizes of which "fine" says that no camera has them: the upper end of the 90 % interval of the estimate without trust
in the calibration is below; turns must be estimated as smaller than an alarm, too. Ten seconds of four people determine
exact cameras to 0.5 to 0.9 degrees. Shifts are less certain than turns: detectors place joints differently from
different sides, which imitates shifts of 5 cm (Shelf's published cameras), and of distant cameras 9 cm."""

_CLEAR = 2.0  # times the size of an alarm, in a recording that does not determine smaller ones
_SURE = 0.95

_SEVERITIES, _VERDICTS = get_args(Severity), get_args(Verdict)
_ABOUT_CAMERAS = ("cannot-tell", "moved-camera", "drifting-camera", "focal-length", "large-residual")
"""Kinds that leave open whether the cameras are right where they are unknown."""

NEW_TIMES = "--new-times"
_RANK = {"alarm": 0, "unknown": 1, "note": 2}


def judged(
    size: Mapping[str, float], low: Mapping[str, float], *, probability: float = 1.0, determined: bool = True
) -> Severity:
    """Return whether an error is an alarm, unknown or a note: the one rule of the verdict, by size and evidence.

    An error that is as large as an alarm (:data:`ALARM`) is one where the recording determines it. Where it does not,
    the error is an alarm if it is probable and nine tenths of its probability are beyond twice that size, else unknown.
    No error of that size is a note.

    Args:
        size: sizes of the error by the names of :data:`ALARM`; other names do not count.
        low: lowest values of 90 % of the probability.
        probability: probability that the error is there.
        determined: whether the recording determines errors of this size.
    """
    limits = {name: ALARM[name] for name in size if name in ALARM}
    if not any(abs(size[name]) >= limit for name, limit in limits.items()):
        return "note"
    clear = any(low.get(name, 0.0) >= _CLEAR * limit for name, limit in limits.items())
    return "alarm" if determined or (clear and probability >= _SURE) else "unknown"


def is_fine(size: Mapping[str, float], high: Mapping[str, float]) -> bool:
    """Whether a camera has no errors of the sizes that "fine" excludes, and none of the size of an alarm is likely.

    Args:
        size: its error as estimated without trust in the calibration: turn (``"degrees"``) and shift (``"metres"``).
        high: upper ends of the 90 % intervals of these.
    """
    return size["degrees"] < ALARM["degrees"] and all(value < EXCLUDED[name] for name, value in high.items())


@dataclass(frozen=True)
class Finding:
    """One fault, of the whole rig or of one camera.

    Raises:
        ValueError: an unknown kind or severity, a probability outside of 0..1, a cost below 0, or an interval without a
            size.
    """

    kind: str
    """One of :data:`mvpose.calibration.findings.KINDS`."""
    text: str
    """One sentence for the user."""
    severity: Severity = "alarm"
    """``"alarm"``, ``"note"`` or ``"unknown"``."""
    probability: float = 1.0
    """Probability that the fault is there, 0 to 1."""
    camera: str | None = None
    """Name of the camera; None for the whole rig."""
    view: int | None = None
    """Index of the camera; None for the whole rig."""
    size: Mapping[str, float] = field(default_factory=dict)
    """Size of the fault, by names that end in the unit: ``{"degrees": 1.1, "metres": 0.05, "since_s": 4.0}``."""
    interval: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lowest and highest value of 90 % of the probability, for names of ``size``."""
    cost: float = 0.0
    """Expected loss without a mend: error of joints because of the fault, metres, times its probability. Findings are
    ordered by it."""
    mend: str = ""
    """What mends it in words, or what to record or to check; empty where ``repair`` says it all."""
    repair: tuple[str, ...] = ()
    """Options of ``mvpose repair`` that mend it; empty where no change of calibration or clocks does."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind of a finding must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if self.severity not in _SEVERITIES:
            raise ValueError(f"severity must be one of {', '.join(_SEVERITIES)}, got {self.severity!r}")
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"{self.kind}: probability must lie in 0..1, got {self.probability}")
        if not self.cost >= 0.0:
            raise ValueError(f"{self.kind}: cost must be 0 or more, got {self.cost}")
        unsized = [name for name in self.interval if name not in self.size]
        if unsized:
            raise ValueError(f"{self.kind}: interval of {unsized[0]!r}, which size does not have: {list(self.size)}")

    def to_json(self) -> dict[str, Any]:
        """Return the finding as values that ``json.dumps`` writes."""
        values = {
            "kind": self.kind,
            "camera": self.camera,
            "view": self.view,
            "severity": self.severity,
            "probability": round(self.probability, 4),
            "size": self.size,
            "interval": self.interval,
            "cost": self.cost,
            "text": self.text,
            "mend": self.mend,
            "repair": self.repair,
        }
        found: dict[str, Any] = json_value(values, significant=6)
        return found


@dataclass(frozen=True)
class Diagnosis(Sealed):
    """Answer of the doctor about one recording.

    Raises:
        ValueError: another verdict, or residuals of another number of cameras.
    """

    findings: tuple[Finding, ...]
    """Worst first: alarms, then what is unknown, then notes, each by cost."""
    verdict: Verdict
    """``"faults"`` with at least one alarm, ``"cannot tell"`` without any but with something unknown of the whole rig,
    else ``"fine"``."""
    evidence: tuple[str, ...]
    """Lines of text with the numbers on which the verdict rests."""
    cameras: tuple[str, ...]
    """Names of the cameras, V."""
    residuals: Floats
    """Median distance of each camera's keypoints from the people that the other cameras see, (V,), pixels; NaN where a
    camera shares nobody with the others."""
    usual: Floats | None = None
    """What these distances are where the calibration is right and detectors err as usual, (V,), pixels."""
    repair: tuple[str, ...] = ()
    """Options of ``mvpose repair`` that mend all alarms for which there are any, in the order in which they must be
    applied."""
    within: Mapping[str, float] = field(default_factory=dict)
    """Turn (``"degrees"``) and shift (``"metres"``) by which any camera may be off, estimates plus a standard
    deviation; empty where the recording does not determine it."""

    def __post_init__(self) -> None:
        for key in ("findings", "evidence", "cameras"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        if self.verdict not in _VERDICTS:
            raise ValueError(f"verdict must be one of {', '.join(_VERDICTS)}, got {self.verdict!r}")
        object.__setattr__(self, "residuals", as_array(self.residuals, (len(self.cameras),), "residuals"))

    @classmethod
    def of_findings(
        cls,
        findings: Sequence[Finding],
        *,
        evidence: Sequence[str],
        cameras: Sequence[str],
        residuals: Floats,
        usual: Floats | None = None,
        within: Mapping[str, float] = MappingProxyType({}),
    ) -> Self:
        """Return the diagnosis of findings, with the verdict that follows from them.

        Findings are given in the order in which their mends are applied.
        """
        ordered = sorted(findings, key=lambda each: (_RANK[each.severity], -each.cost, -each.probability, each.kind))
        verdict: Verdict = "fine"
        if any(each.severity == "alarm" for each in ordered):
            verdict = "faults"
        elif any(each.severity == "unknown" and each.kind in _ABOUT_CAMERAS for each in ordered):
            verdict = "cannot tell"
        repair = joined_options([each.repair for each in findings if each.severity == "alarm"])
        return cls(tuple(ordered), verdict, tuple(evidence), tuple(cameras), residuals, usual, repair, dict(within))

    @property
    def alarms(self) -> tuple[Finding, ...]:
        """Findings that are alarms, worst first."""
        return tuple(each for each in self.findings if each.severity == "alarm")

    @property
    def open_questions(self) -> tuple[Finding, ...]:
        """Unknown findings that leave open whether the cameras are right, those about the whole rig first."""
        unknown = [each for each in self.findings if each.severity == "unknown" and each.kind in _ABOUT_CAMERAS]
        return tuple(sorted(unknown, key=lambda each: each.camera is not None))

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as values that ``json.dumps`` writes."""
        values = {
            "verdict": self.verdict,
            "findings": self.findings,
            "evidence": self.evidence,
            "repair": self.repair,
            "within": self.within,
            "residuals_px": dict(zip(self.cameras, self.residuals, strict=True)),
        }
        found: dict[str, Any] = json_value(values, significant=6)
        return found


def joined_options(of_findings: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return the options of ``mvpose repair`` for several findings: all mends in order, then what is estimated."""
    mends: list[str] = []
    free: dict[str, None] = {}
    times = False
    for options in of_findings:
        for name, value in zip(options[::2], options[1::2], strict=True):
            if name == "--mend":
                mends += [name, value]
            elif name == "--free":
                free |= dict.fromkeys(value.split(","))
            else:
                times = True
    return (*mends, *(("--free", ",".join(free)) if free else ()), *((NEW_TIMES, "TIMES") if times else ()))


def camera_names(rig: Rig | Sequence[Camera]) -> tuple[str, ...]:
    """Return a name for each camera that no other has: its own, or ``camera 0`` and so on."""
    names = [camera.name for camera in rig]
    return tuple(
        name if name and names.count(name) == 1 else f"camera {view}" if not name else f"{name} ({view})"
        for view, name in enumerate(names)
    )
