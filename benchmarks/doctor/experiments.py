"""Experiments of the benchmark: each has trials, and measures one trial at a time."""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.doctor import faults
from benchmarks.doctor.measures import aligned, camera_errors, pcp
from benchmarks.doctor.recordings import BenchRecording
from mvpose import Detections, Rig
from mvpose.calibration import Diagnosis, Repair, diagnose, estimate_clocks, repair
from mvpose.calibration.repair import Size
from mvpose.calibration.repaired_pipeline import resampled

TURNS = ("0.5", "1")
"""Degrees by which one camera is turned: from the size of an alarm to that which "fine" excludes."""
EVERY = 5  # frames: of those that the slower variants estimate
_NORMAL = 1.6449  # standard deviations, half the width of an interval that holds 90 %


@dataclass(frozen=True)
class TrialKey:
    """One trial.

    Attributes:
        experiment: name of the experiment.
        recording: name of the recording.
        case: what is done to it.
        draw: number of the draw of random errors.
    """

    experiment: str
    recording: str
    case: str = ""
    draw: int = 0

    def __str__(self) -> str:
        return f"{self.experiment}/{self.recording}/{self.case}/{self.draw}"

    @property
    def rng(self) -> np.random.Generator:
        """Random numbers of this trial alone."""
        return np.random.default_rng(zlib.crc32(str(self).encode()))


Result = dict[str, Any]


def trials(recordings: Mapping[str, BenchRecording], draws: int | None = None) -> Iterator[TrialKey]:
    """Yield all trials for which there is a recording.

    Args:
        recordings: recordings by name.
        draws: number of draws of each case, instead of the usual number.
    """
    names = list(recordings)
    rigs, shelf = [name for name in names if name.startswith("rig")], [name for name in names if name == "shelf"]
    for name in shelf:
        for view in range(len(recordings[name].rig)):
            for draw in range(draws or 20):
                yield TrialKey("moved", name, str(view), draw)
            for draw in range(draws or 10):
                yield TrialKey("repaired", name, str(view), draw)
        yield TrialKey("repaired", name, "untouched")
    for name in [*shelf, *rigs]:
        yield TrialKey("clean", name)
        for case in TURNS:
            for draw in range(draws or 4):
                yield TrialKey("turned", name, case, draw)
        for case in faults.CONVENTIONS:
            yield TrialKey("conventions", name, case)
        for case in faults.OTHERS:
            yield TrialKey("faults", name, case)
    for name in rigs:
        for case in ("2 degrees, 0.2 m", "4 degrees, 0.4 m"):
            yield TrialKey("rigs-off", name, case)
        for draw in range(draws or 10):
            yield TrialKey("coverage", name, "", draw)
        for case in ("different people", "two cameras"):
            yield TrialKey("refusals", name, case)
    for name in names:
        if name.startswith("clock"):
            yield TrialKey("clocks", name)
        elif name.startswith("still"):
            yield TrialKey("refusals", name, "one person stands still")


def measure(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    """Return what a trial measures, as values that JSON has."""
    return _EXPERIMENTS[key.experiment](key, recordings)


def _diagnosed(case: faults.Case, recording: BenchRecording) -> tuple[Diagnosis, Result]:
    start, processor = time.perf_counter(), time.process_time()
    diagnosis = diagnose(case.rig, case.frames, period=recording.period)
    seconds, processor = time.perf_counter() - start, time.process_time() - processor
    findings = [
        {"kind": each.kind, "view": each.view, "severity": each.severity, "size": dict(each.size)}
        for each in diagnosis.findings
    ]
    return diagnosis, {
        "verdict": diagnosis.verdict, "findings": findings, "view": case.view, "seconds": seconds,
        "processor_seconds": processor,
    }  # fmt: skip


def _alarms(result: Result) -> list[tuple[str, int | None]]:
    return [(each["kind"], each["view"]) for each in result["findings"] if each["severity"] == "alarm"]


def _moved(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    _, result = _diagnosed(faults.move_one(recording, int(key.case), 1.0, 0.05, key.rng), recording)
    alarms = _alarms(result)
    named = ("moved-camera", int(key.case)) in alarms
    return {**result, "named": named, "alone": named and len(alarms) == 1}


def _clean(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    _, result = _diagnosed(faults.Case(recording.rig, recording.frames), recording)
    return {**result, "false_alarm": bool(_alarms(result))}


def _turned(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording, rng = recordings[key.recording], key.rng
    view = int(rng.integers(len(recording.rig)))
    _, result = _diagnosed(faults.move_one(recording, view, float(key.case), 0.0, rng), recording)
    return {**result, "named": ("moved-camera", view) in _alarms(result)}


def _named(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    fault, kinds = {**faults.CONVENTIONS, **faults.OTHERS}[key.case]
    case = fault(recording, key.rng)
    _, result = _diagnosed(case, recording)
    named = [view for kind, view in _alarms(result) if kind in kinds]
    return {**result, "named": bool(named), "camera": case.view is None or not named or case.view in named}


def _repaired(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    case = faults.Case(recording.rig, recording.frames)
    if key.case != "untouched":
        case = faults.move_one(recording, int(key.case), 2.0, 0.2, key.rng)
    start = time.perf_counter()
    fixed = _repair(case.rig, case.frames, recording)
    seconds = time.perf_counter() - start
    scores = {name: _pcp(rig, recording) for name, rig in (("before", case.rig), ("after", fixed.rig))}
    if key.case == "untouched":
        scores["perfect"] = scores["before"]
    return {
        "refused": fixed.refused, "seconds": seconds, **_errors(fixed.rig, recording, case.view),
        **{f"pcp_{name}": value for name, value in scores.items()},
    }  # fmt: skip


def _repair(
    rig: Rig, frames: tuple[Detections, ...], recording: BenchRecording, *, size: Size = "calibration"
) -> Repair:
    return repair(rig, frames, period=recording.period, size=size)


def _errors(rig: Rig, recording: BenchRecording, view: int | None) -> Result:
    result: Result = {}
    for name, placed in (("", rig), ("aligned_", aligned(rig, recording.rig))):
        degrees, metres = camera_errors(placed, recording.rig)
        result |= {
            f"{name}degrees": float(degrees.max() if view is None else degrees[view]),
            f"{name}metres": float(metres.max() if view is None else metres[view]),
        }
    return result


def _pcp(rig: Rig, recording: BenchRecording, variant: str = "full") -> float:
    return pcp(rig, recording.frames, recording.truth, variant=variant, every=EVERY, period=recording.period)


def _rigs_off(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    degrees, metres = (4.0, 0.4) if key.case.startswith("4") else (2.0, 0.2)
    case = faults.move_all(recording, degrees, metres, key.rng)
    start = time.perf_counter()
    fixed = _repair(case.rig, case.frames, recording, size="both")  # as variants `NAME+repair`
    seconds = time.perf_counter() - start
    rigs = {"perfect": recording.rig, "before": case.rig, "after": fixed.rig}
    return {
        "refused": fixed.refused, "seconds": seconds, **_errors(fixed.rig, recording, None),
        **{f"pcp_{name}": _pcp(rig, recording) for name, rig in rigs.items()},
    }  # fmt: skip


def _coverage(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    """Count the parameters of cameras whose true correction lies in the interval of the repair."""
    recording, rng = recordings[key.recording], key.rng
    size = rng.uniform(0.3, 1.0)
    case = faults.move_all(recording, size, 0.05 * size, rng)
    fixed = _repair(case.rig, case.frames, recording)
    if fixed.refused:
        return {"refused": fixed.refused}
    turns, shifts = true_corrections(case.rig, recording.rig)
    missed = np.concatenate([turns, shifts], axis=1) - fixed.corrections
    deviations = np.sqrt(np.diagonal(fixed.covariance, axis1=1, axis2=2))
    free = deviations > 0
    inside = np.abs(missed) <= _NORMAL * deviations
    return {"refused": None, "inside": int(inside[free].sum()), "parameters": int(free.sum())}


def true_corrections(believed: Rig, true: Rig) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation vectors in the world (V, 3), radians, and shifts (V, 3), metres, that would be right."""
    turns = Rotation.from_matrix([b.R.T @ a.R for a, b in zip(believed, true, strict=True)]).as_rotvec()
    return turns, true.centers - believed.centers


def _clocks(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    together = recordings[key.recording.replace("clock", "sync")]
    rig = faults.move_all(recording, 0.3, 0.0, key.rng).rig
    start = time.perf_counter()
    clocks = estimate_clocks(rig, recording.frames, period=recording.period)
    seconds = time.perf_counter() - start
    # Only differences between clocks can be seen: what all have in common is left out on both sides.
    errors = clocks.offsets - (recording.offsets - recording.offsets[list(clocks.reference)].mean())
    halves = np.diff(clocks.interval, axis=1)[:, 0] / 2
    measured = clocks.determined & (halves > 1e-9)
    moved = replace(recording, frames=resampled(rig, recording.frames, clocks).frames)
    timed = replace(recording, frames=clocks.corrected(recording.frames))
    perfect = recording.rig
    return {
        "determined": int(clocks.determined.sum()),
        "cameras": len(rig),
        "errors_ms": (1e3 * errors[measured]).tolist(),
        "halves_ms": (1e3 * halves[measured]).tolist(),
        "seconds": seconds,
        "pcp_full": _pcp(perfect, recording),
        "pcp_full_repaired": _pcp(perfect, moved),
        "pcp_full_synchronised": _pcp(perfect, together),
        "pcp_track": _pcp(perfect, recording, "track-fast"),
        "pcp_track_repaired": _pcp(perfect, timed, "track-fast"),
        "pcp_track_synchronised": _pcp(perfect, together, "track-fast"),
    }


def _refusals(key: TrialKey, recordings: Mapping[str, BenchRecording]) -> Result:
    recording = recordings[key.recording]
    rig, frames = recording.rig, recording.frames
    if key.case == "two cameras":
        rig = Rig([rig[0], rig[1]])
        frames = tuple(each.select(each.view < 2) for each in frames)
    elif key.case == "different people":
        frames = faults.scattered(recording)
    disturbed = faults.move_all(replace(recording, rig=rig), 1.0, 0.05, key.rng).rig
    fixed = _repair(disturbed, frames, recording)
    _, result = _diagnosed(faults.Case(disturbed, frames), recording)
    unchanged = all(np.allclose(a.R, b.R) and np.allclose(a.t, b.t) for a, b in zip(fixed.rig, disturbed, strict=True))
    return {**result, "refused": fixed.refused, "unchanged": unchanged}


_EXPERIMENTS = {
    "moved": _moved,
    "clean": _clean,
    "turned": _turned,
    "conventions": _named,
    "faults": _named,
    "repaired": _repaired,
    "rigs-off": _rigs_off,
    "coverage": _coverage,
    "clocks": _clocks,
    "refusals": _refusals,
}
EXPERIMENTS = tuple(_EXPERIMENTS)
"""Names of the experiments."""
