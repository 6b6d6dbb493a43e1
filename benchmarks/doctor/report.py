"""Tables of the benchmark: each bound with what was measured, and faults against findings."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.calibration.findings import EXCLUDED, KINDS

Results = Mapping[str, Mapping[str, Any]]
_NOTHING, _UNSURE = "nothing", "cannot tell"
_ONE_MOVED = "one camera 1 degree and 5 cm off"
_DIAGNOSED = ("clean", "turned", "moved", "conventions", "faults", "refusals")
"""Experiments in which a recording is diagnosed."""


@dataclass(frozen=True)
class Row:
    """One figure beside its bound.

    Attributes:
        what: what is measured.
        bound: what the share or the error is bounded by.
        measured: what was measured, as text.
        met: whether the bound is met; None without a bound.
        trials: number of trials.
    """

    what: str
    bound: str
    measured: str
    met: bool | None
    trials: int


def rows_of(results: Results) -> list[Row]:
    """Return the bounds about which the results say something."""
    by: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for key, result in results.items():
        experiment, recording, case, _ = key.split("/")
        by[experiment].append({**result, "recording": recording, "case": case})
    rows: list[Row | None] = [
        _share("Shelf, one camera 1 degree and 5 cm off: the right one named", by["moved"], "named", 95.0),
        _share("   and no other alarm", by["moved"], "alone", None),
        _share("untouched Shelf and clean rigs: false alarms", by["clean"], "false_alarm", 2.0, most=True),
        _fine(by["clean"]),
        *_turned_rows(by["turned"]),
        *_repaired_rows(by["repaired"]),
        *_convention_rows(by["conventions"]),
        _share("other faults named", by["faults"], "named", None),
        *_rigs_rows(by["rigs-off"]),
        *_clock_rows(by["clocks"]),
        _coverage_row(by["coverage"]),
        *_refusal_rows(by["refusals"]),
        *_time_rows(by),
    ]
    return [row for row in rows if row is not None]


def confusion_of(results: Results) -> dict[str, Counter[str]]:
    """Return for each fault how many recordings have an alarm of each kind.

    Recordings without any alarm are counted as "nothing", or as "cannot tell" where that is the verdict.
    """
    matrix: dict[str, Counter[str]] = {}
    for key, result in results.items():
        experiment, recording, case, _ = key.split("/")
        if experiment not in _DIAGNOSED or "findings" not in result:
            continue
        kinds = {each["kind"] for each in result["findings"] if each["severity"] == "alarm"}
        name = case or "no fault"
        if experiment == "moved":
            name = f"{recording}, {_ONE_MOVED}"
        elif experiment == "turned":
            name = _turn(case)
        row = matrix.setdefault(name, Counter())
        row.update(kinds or {_UNSURE if result["verdict"] == _UNSURE else _NOTHING})
        row["recordings"] += 1
    return matrix


def misses_of(results: Results) -> list[str]:
    """Return one line for each trial that is not as it should be, with the alarms that it had."""
    lines = []
    for key, result in results.items():
        experiment = key.split("/")[0]
        if experiment not in _DIAGNOSED or "findings" not in result:
            continue
        right = {
            "clean": lambda each: not each["false_alarm"],
            "turned": lambda each: each["named"] or each["verdict"] == _UNSURE,
            "refusals": lambda each: each["unchanged"] and each["verdict"] == _UNSURE,
        }.get(experiment, lambda each: each["named"] and each.get("camera", True))
        if not right(result):
            alarms = [f"{each['kind']} {each['view']}" for each in result["findings"] if each["severity"] == "alarm"]
            at_fault = "" if result["view"] is None else f", camera {result['view']}"
            lines.append(f"{key}{at_fault}: {', '.join(alarms) or result['verdict']}")
    return lines


def print_report(results: Results) -> None:
    """Print both tables."""
    for row in rows_of(results):
        mark = {True: "✓", False: "✗", None: " "}[row.met]
        print(f"{row.what:62s} {row.bound:26s} {mark} {row.measured}  ({row.trials})")
    matrix = confusion_of(results)
    if matrix:
        print("\nalarms by fault, recordings:")
    for fault, counts in matrix.items():
        alarms = ", ".join(f"{kind} {count}" for kind, count in counts.most_common() if kind != "recordings")
        print(f"{fault:36s} of {counts['recordings']:3d}: {alarms}")


def write_report(results: Results, folder: Path) -> None:
    """Write bounds, confusion matrix and misses into a folder: ``doctor.json`` and ``doctor.md``."""
    folder.mkdir(parents=True, exist_ok=True)
    rows, matrix, misses = rows_of(results), confusion_of(results), misses_of(results)
    summary = {
        "bounds": [asdict(row) for row in rows],
        "confusion": {fault: dict(counts) for fault, counts in matrix.items()},
        "misses": misses,
    }
    (folder / "doctor.json").write_text(json.dumps(summary, indent=1) + "\n")
    (folder / "doctor.md").write_text(_markdown(rows, matrix, misses))


def _share(
    what: str, results: Sequence[Mapping[str, Any]], key: str, bound: float | None, *, most: bool = False
) -> Row | None:
    if not results:
        return None
    share = 100.0 * float(np.mean([each[key] for each in results]))
    met = None if bound is None else share <= bound if most else share >= bound
    text = "" if bound is None else f"{'<=' if most else '>='} {bound:g} %"
    return Row(what, text, f"{share:.1f} %", met, len(results))


def _fine(results: Sequence[Mapping[str, Any]], bound: float | None = None) -> Row | None:
    found = [{"fine": each["verdict"] == "fine"} for each in results]
    return _share("   called fine", found, "fine", bound, most=True)


def _turn(case: str) -> str:
    return f"one camera turned by {case} degree{'s' * (float(case) != 1)}"


def _turned_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    rows: list[Row | None] = []
    for case in dict.fromkeys(each["case"] for each in results):
        some = [each for each in results if each["case"] == case]
        excluded = float(case) >= EXCLUDED["degrees"]
        rows += [_share(f"{_turn(case)}: named", some, "named", None), _fine(some, 5.0 if excluded else None)]
    return rows


def _convention_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    rows: list[Row | None] = []
    for where, inside in (("Shelf", True), ("simulated rigs", False)):
        some = [each for each in results if (each["recording"] == "shelf") == inside]
        rows += [
            _share(f"conventions named, {where}", some, "named", 98.0),
            _share("   of the right camera", some, "camera", None),
        ]
    return rows


def _time_rows(by: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[Row | None]:
    """Return the processor time of a diagnosis; the first one of a process also compiles or loads kernels."""
    rows: list[Row | None] = []
    for what, names in (
        ("a diagnosis, nothing wrong", ("clean",)),
        ("a diagnosis, a fault", ("moved", "conventions", "faults")),
        ("a diagnosis, nothing fits", ("refusals",)),
    ):
        times = [each["processor_seconds"] for name in names for each in by[name] if "processor_seconds" in each]
        if times:
            text = f"median {np.median(times):.1f} s, 95 % {np.percentile(times, 95):.1f} s"
            rows.append(Row(f"processor time of {what}", "", text, None, len(times)))
    return rows


def _worst(results: Sequence[Mapping[str, Any]], key: str) -> float:
    return float(np.percentile([each[key] for each in results], 95))


def _repaired_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    moved = [each for each in results if each["case"] != "untouched"]
    untouched = [each for each in results if each["case"] == "untouched"]
    if not moved:
        return []
    degrees, metres, count = _worst(moved, "degrees"), _worst(moved, "metres"), len(moved)
    rows: list[Row | None] = [
        Row(
            "Shelf, one camera 2 degrees and 0.2 m off: repaired (95th percentile)", "<= 0.2 degrees, 2 cm",
            f"{degrees:.2f} degrees, {100 * metres:.1f} cm", degrees <= 0.2 and metres <= 0.02, count,
        ),
        Row(
            "   seconds", "< 10 s", f"{_worst(moved, 'seconds'):.1f} s", _worst(moved, "seconds") < 10.0, count
        ),
    ]  # fmt: skip
    if untouched:
        base, lost = untouched[0], untouched[0]["pcp_before"] - min(each["pcp_after"] for each in moved)
        rows += [
            Row(
                "   the untouched rig, repaired", "", f"{base['degrees']:.2f} degrees, {100 * base['metres']:.1f} cm",
                None, 1,
            ),
            Row(
                "   PCP lost at worst against untouched", "<= 1",
                f"{lost:.1f} of {base['pcp_before']:.1f}; unrepaired "
                f"{np.mean([each['pcp_before'] for each in moved]):.1f}", lost <= 1.0, count,
            ),
        ]  # fmt: skip
    return rows


def _rigs_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    rows: list[Row | None] = []
    for case in dict.fromkeys(each["case"] for each in results):
        some = [each for each in results if each["case"] == case]
        means = {
            name: float(np.mean([each[f"pcp_{name}"] for each in some])) for name in ("before", "after", "perfect")
        }
        rows.append(
            Row(
                f"simulated, all cameras {case} off: PCP after repair", "perfect - 3" if case.startswith("2") else "",
                f"{means['after']:.1f} (before {means['before']:.1f}, perfect {means['perfect']:.1f}; refused "
                f"{sum(each['refused'] is not None for each in some)})",
                means["after"] >= means["perfect"] - 3.0 if case.startswith("2") else None, len(some),
            )
        )  # fmt: skip
    return rows


def _clock_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    if not results:
        return []
    errors = np.abs(np.concatenate([each["errors_ms"] for each in results]))
    halves = np.concatenate([each["halves_ms"] for each in results])
    share, inside = 100.0 * float((errors <= 5.0).mean()), 100.0 * float((errors <= halves).mean())
    rows: list[Row | None] = [
        Row(
            "clocks, 10 s of walking: offsets within 5 ms", ">= 95 %",
            f"{share:.1f} % (median {np.median(errors):.1f}, 95 % {np.percentile(errors, 95):.1f} ms)", share >= 95.0,
            len(errors),
        ),
        Row("   inside of the 90 % interval", "85 to 95 %", f"{inside:.1f} %", 85.0 <= inside <= 95.0, len(errors)),
    ]  # fmt: skip
    for variant in ("full", "track"):
        means = {
            part: float(np.mean([each[f"pcp_{variant}{part}"] for each in results]))
            for part in ("", "_repaired", "_synchronised")
        }
        lost = means["_synchronised"] - means["_repaired"]
        rows.append(
            Row(
                f"   PCP of {variant}, against synchronised", "<= 1 lost",
                f"{lost:.1f} lost: {means['']:.1f} -> {means['_repaired']:.1f} of {means['_synchronised']:.1f}",
                lost <= 1.0, len(results),
            )
        )  # fmt: skip
    return rows


def _coverage_row(results: Sequence[Mapping[str, Any]]) -> Row | None:
    made = [each for each in results if each["refused"] is None]
    if not made:
        return None
    share = 100.0 * sum(each["inside"] for each in made) / max(sum(each["parameters"] for each in made), 1)
    return Row(
        "true corrections inside of the 90 % interval", "85 to 95 %", f"{share:.1f} %", 85.0 <= share <= 95.0, len(made)
    )


def _refusal_rows(results: Sequence[Mapping[str, Any]]) -> list[Row | None]:
    rows: list[Row | None] = []
    for case in dict.fromkeys(each["case"] for each in results):
        some = [each for each in results if each["case"] == case]
        kept = sum(each["unchanged"] for each in some)
        unsure = sum(each["verdict"] == "cannot tell" for each in some)
        rows.append(
            Row(
                f"{case}: rig unchanged; cannot tell", "all", f"{kept}; {unsure}", kept == unsure == len(some),
                len(some),
            )
        )  # fmt: skip
    return rows


def _markdown(rows: Sequence[Row], matrix: Mapping[str, Counter[str]], misses: Sequence[str]) -> str:
    """Return the tables and the misses as Markdown."""
    marks = {True: "yes", False: "**no**", None: ""}
    kinds = kinds_of(matrix)
    lines = [
        "# The doctor", "", "| what | bound | measured | met | trials |", "|---|---|---|---|---|",
        *(f"| {row.what.strip()} | {row.bound} | {row.measured} | {marks[row.met]} | {row.trials} |" for row in rows),
        "", "## Faults (rows) and alarms (columns), recordings with an alarm of each kind", "",
        f"| fault | recordings | {' | '.join(kinds)} |", "|---" * (len(kinds) + 2) + "|",
        *(
            f"| {fault} | {counts['recordings']} | {' | '.join(str(counts[kind] or '') for kind in kinds)} |"
            for fault, counts in matrix.items()
        ),
        "", "## Misses", "", *(f"- {each}" for each in misses or ["none"]), "",
    ]  # fmt: skip
    return "\n".join(lines)


def kinds_of(matrix: Mapping[str, Counter[str]]) -> list[str]:
    """Return the kinds of alarms that occur."""
    return [kind for kind in (*KINDS, _NOTHING, _UNSURE) if any(kind in counts for counts in matrix.values())]
