"""Run of a hunt: trials of a search, each stored as it ends, and the failures that it found, shrunk and kept.

The result folder has ``trials.jsonl``, what was hunted in the first line and a line for each trial after it; and
``failures``, a file for each kept failure. The points of the search follow from its seed and from what earlier trials
found, so that the same command continues an interrupted hunt and ends with the same files.
"""

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from mvpose.commands.output_files import write_text
from mvpose.commands.progress import Reporter, Silence
from simharness.hunt.frozen_frame import freeze
from simharness.hunt.hunted_trial import HuntFinding, HuntOutput, hunt_in_trial
from simharness.hunt.kept_failure import KeptFailure, judge_of, keep, write_failure
from simharness.hunt.search_methods import search_method
from simharness.scenario.load import ScenarioPlan, Value, fingerprint
from simharness.study.scheduler import TrialFailure, Unit, run_units
from simharness.trial.run_trial import run_trial

TRIALS = "trials.jsonl"
T = TypeVar("T")


@dataclass(frozen=True)
class Hunt:
    """What is hunted, and how."""

    plan: ScenarioPlan
    """The scenario file with its section [search]."""
    variants: tuple[str, ...]
    """Variant of the method, and a rival for the property "disagree"."""
    properties: tuple[str, ...]
    """Names of the properties."""
    method: str
    """Search method: map-elites, lhs or random."""
    seed: int
    """Seed of the search."""
    trials: int | None
    """Number of trials; None: until the time is over."""


@dataclass(frozen=True)
class HuntedPoint:
    """Finished trial of a hunt."""

    trial: int
    """Its number."""
    values: Mapping[str, Value]
    """Values of the keys of [search]."""
    seed: int
    """Seed of the scene."""
    findings: tuple[HuntFinding, ...] = ()
    """What was found."""
    error: str = ""
    """Why the trial could not be run; "" where it ran."""


def distinct(
    points: Iterable[HuntedPoint], kind: Callable[[HuntFinding], T]
) -> dict[T, tuple[HuntedPoint, HuntFinding]]:
    """Return the most reliable robust failure of each kind, the first of equals, and its trial."""
    best: dict[T, tuple[HuntedPoint, HuntFinding]] = {}
    for point in points:
        for each in point.findings:
            key = kind(each)
            if each.robust and (key not in best or each.failed > best[key][1].failed):
                best[key] = point, each
    return best


def run_hunt(
    hunt: Hunt,
    folder: Path,
    *,
    seconds: float | None = None,
    keep_most: int = 10,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> tuple[list[HuntedPoint], list[KeptFailure]]:
    """Search, then shrink and keep a failure of each property and stage.

    Args:
        hunt: what is hunted.
        folder: result folder; trials that an earlier run of the same hunt finished are read from it.
        seconds: no batch of trials begins later; None: no limit.
        keep_most: largest number of kept failures.
        workers: processes that share the trials; the results do not depend on it.
        reporter: receiver of progress.

    Returns:
        The trials in the order of the search, and the kept failures.

    Raises:
        ValueError: nothing to search, or the folder holds another hunt.
    """
    axes, most = hunt.plan.search.axes, hunt.trials
    if not axes:
        raise ValueError(
            f"{hunt.plan.document.path}: has nothing to search; add a section [search] with keys and their values: "
            "people.count = { from = 2, to = 8, steps = 7 }"
        )
    start, reporter = time.monotonic(), reporter or Silence()
    search = search_method(hunt.method, len(axes), hunt.seed, properties=hunt.properties, trials=most)
    stored, points = _stored(hunt, folder / TRIALS), list[HuntedPoint]()
    with reporter.stage("trials", most or 0) as advance:
        while (most is None or len(points) < most) and (seconds is None or time.monotonic() - start < seconds):
            asked = search.ask()[: None if most is None else most - len(points)]
            wanted = [
                (dict(pair for axis, share in zip(axes, each, strict=True) for pair in axis.at(share)), number)
                for number, each in enumerate(asked.tolist(), len(points))
            ]
            for point in _measured(hunt, [each for each in wanted if each[1] not in stored], workers):
                stored[point.trial] = point
                with (folder / TRIALS).open("a", encoding="utf-8") as file:
                    row = {**vars(point), "findings": [vars(each) for each in point.findings]}
                    file.write(json.dumps(row) + "\n")
                advance(1, failed=int(bool(point.error)))
            batch = [stored[number] for _, number in wanted]
            search.tell(asked, [each.findings for each in batch])
            points += batch
    chosen = list(distinct(points, lambda each: each.cell[:2]).values())[:keep_most]
    kept = []
    with reporter.stage("shrink", len(chosen)) as advance:
        for point, finding in chosen:
            if failure := _keep(hunt, point, finding):
                kept.append(failure)
                write_failure(failure, folder / "failures")
            advance(1)
    return points, kept


def _stored(hunt: Hunt, path: Path) -> dict[int, HuntedPoint]:
    """Return the trials that are stored, by number, and write the first line where there is none.

    Raises:
        ValueError: another hunt is stored there.
    """
    heading: dict[str, Any] = {
        "scenario": fingerprint(hunt.plan.base),
        "search": [vars(each) for each in hunt.plan.search.axes],
    }
    heading |= {key: getattr(hunt, key) for key in ("variants", "properties", "method", "seed")}
    heading = json.loads(json.dumps(heading | ({"trials": hunt.trials} if hunt.method == "lhs" else {})))
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []
    if lines and not lines[-1].endswith("\n"):  # cut off when the process was killed
        del lines[-1]
    rows = list(map(json.loads, lines))
    if rows and rows[0] != heading:
        raise ValueError(f"{path}: holds another hunt, or one of other code; choose another --out or remove it")
    write_text("".join(lines) or json.dumps(heading) + "\n", path)
    found = [
        HuntedPoint(**row | {"findings": tuple(HuntFinding(**each) for each in row["findings"])}) for row in rows[1:]
    ]
    return {each.trial: each for each in found}


def _measured(hunt: Hunt, wanted: Sequence[tuple[dict[str, Value], int]], workers: int) -> Iterator[HuntedPoint]:
    """Yield trials with these values and numbers as they end."""
    units, points = [], {}
    for values, number in wanted:
        points[str(number)] = HuntedPoint(number, values, hunt.plan.base.seed + number)
        try:
            units.append(Unit(str(number), hunt.plan.at(values, points[str(number)].seed), hunt.variants))
        except ValueError as error:
            yield replace(points[str(number)], error=str(error))
    measure = partial(hunt_in_trial, properties=hunt.properties)
    with closing(run_units(units, measure, workers=workers)) as results:
        for each in results:
            point = points[each.unit.trial]
            if isinstance(each, TrialFailure):
                yield replace(point, error=each.error)
            else:
                assert isinstance(each.output, HuntOutput)
                yield replace(point, findings=each.output.findings)


def _keep(hunt: Hunt, point: HuntedPoint, finding: HuntFinding) -> KeptFailure | None:
    """Shrink the frame of a finding; None where it does not fail by what a frozen frame holds."""
    plan, (variant, *rivals) = hunt.plan, hunt.variants
    about: dict[str, Any] = {"variant": variant, "rival": "".join(rivals), "estimators": plan.base.method.estimators}
    judge = judge_of(**about)
    recording = run_trial(plan.at(point.values, point.seed), variants=hunt.variants, until="detect").recording
    frozen = freeze(recording.rig, recording.detections[finding.frame], recording.truth[finding.frame])
    keys = ", ".join(f"{key} = {value}" for key, value in point.values.items())
    about["origin"] = f"{plan.base.name}, {keys}, seed {point.seed}, frame {finding.frame}"
    found = judge.violations(frozen, (finding.violated,))
    violation = next((each for each in found if each.person == finding.person), None)
    return keep(frozen, violation, judge, scenario=plan.base.name, about=about) if violation else None
