"""Run of a hunt: trials of a search, each stored as it ends, and the failures that it found, shrunk and kept.

The search is MAP-Elites (Mouret & Clune, "Illuminating search spaces by mapping elites", 2015): the trial that fails
most reliably is known for every kind of failure in its circumstances, and the next trials vary these (with the operator
of Vassiliades & Mouret, "Discovering the elite hypervolume", GECCO 2018).

The result folder has ``trials.jsonl``, what was hunted in the first line and a line for each trial after it; and
``failures``, a file for each kept failure. The points of the search follow from its seed and from what earlier trials
found, so that the same command continues an interrupted hunt and ends with the same files.
"""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.commands.output_files import write_text
from mvpose.commands.progress import Reporter
from mvpose.files.input_files import parse_json, read_bytes
from simharness.hunt.frozen_frame import freeze
from simharness.hunt.hunted_trial import HuntFinding, HuntOutput, hunt_in_trial
from simharness.hunt.kept_failure import KeptFailure, judge_of, keep, write_failure
from simharness.scenario.load import ScenarioPlan, Value, fingerprint
from simharness.study.scheduler import TrialFailure, Unit, local_workers, run_units
from simharness.trial.run_trial import run_trial
from simharness.types.random_streams import stream

if TYPE_CHECKING:
    from distributed import Client

TRIALS = "trials.jsonl"
BATCH = 16
"""Trials that run before the search hears of their results."""

_ISO, _LINE = 0.1, 0.2  # spread of new points about an elite, and along the way to another one
_UNIFORM = 4  # one in so many points is anywhere
_SAME = 0.5  # share of the others that keep the scene of their elite
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
    seed: int
    """Seed of the search."""


@dataclass(frozen=True)
class HuntedPoint:
    """Finished trial of a hunt."""

    trial: int
    """Its number."""
    shares: tuple[float, ...]
    """Its point in the unit cube of the search: how far through the values of each key it is."""
    values: Mapping[str, Value]
    """Values of the keys of [search]."""
    seed: int
    """Seed of the scene."""
    findings: tuple[HuntFinding, ...] = ()
    """What was found."""
    sightings: tuple[tuple[int, ...], ...] = ()
    """Circumstances of all people in all frames, as of :class:`simharness.hunt.hunted_trial.HuntOutput`."""
    error: str = ""
    """Why the trial could not be run; "" where it ran."""


Search = Callable[[Floats, Floats, int, int, int], tuple[Floats, Integers]]
"""Search of points, as :func:`next_points`."""


def distinct(
    points: Iterable[HuntedPoint], kind: Callable[[HuntFinding], T], *, robust: bool = True
) -> dict[T, tuple[HuntedPoint, HuntFinding]]:
    """Return the most reliable failure of each kind, the first of equals, and its trial.

    Args:
        points: finished trials.
        kind: the kind of a finding.
        robust: whether those that fail again with few draws of noise are left out.
    """
    best: dict[T, tuple[HuntedPoint, HuntFinding]] = {}
    for point in points:
        for each in point.findings:
            key = kind(each)
            if (each.robust or not robust) and (key not in best or each.failed > best[key][1].failed):
                best[key] = point, each
    return best


def next_points(elites: Floats, weights: Floats, dimensions: int, seed: int, batch: int) -> tuple[Floats, Integers]:
    """Return the next :data:`BATCH` points of the unit cube, (n, d), and the elite whose scene each keeps, (n,).

    One point in four is anywhere, the others are near elites; half of these are in the scene of the elite, with the
    same people and motion, because that too is what made it fail. -1: a new scene.

    Args:
        elites: points that fail most reliably in their cells (m, d); all points are anywhere where there are none.
        weights: how often each is varied (m,), in relation to the others.
        dimensions: d.
        seed: seed of the search.
        batch: number of the batch.
    """
    rng = stream(seed, "hunt", "search", batch)
    points, kept = rng.random((BATCH, dimensions)), np.full(BATCH, -1)
    if len(elites):
        one, other = rng.choice(len(elites), size=(2, BATCH), p=weights / weights.sum())
        along = rng.normal(scale=_LINE, size=(BATCH, 1)) * (elites[other] - elites[one])
        varied = elites[one] + rng.normal(scale=_ISO, size=points.shape) + along
        near = np.arange(BATCH) % _UNIFORM != 0
        points[near] = np.clip(varied, 0.0, 1.0)[near]
        kept = np.where(near & (rng.random(BATCH) < _SAME), one, kept)
    return points, kept


def run_hunt(
    hunt: Hunt,
    folder: Path,
    *,
    trials: int | None = None,
    seconds: float | None = None,
    keep_most: int = 10,
    workers: int = 1,
    reporter: Reporter,
    search: Search = next_points,
) -> tuple[list[HuntedPoint], list[KeptFailure]]:
    """Search, then shrink and keep a failure of each property and stage.

    Args:
        hunt: what is hunted.
        folder: result folder; trials that an earlier run of the same hunt finished are read from it.
        trials: number of trials; None: until the time is over.
        seconds: no batch of trials begins later; None: no limit.
        keep_most: largest number of kept failures.
        workers: processes that share the trials; the results do not depend on it.
        reporter: receiver of progress.
        search: search of points.

    Returns:
        The trials in the order of the search, and the kept failures.

    Raises:
        ValueError: nothing to search, or the folder holds another hunt.
    """
    axes = hunt.plan.search.axes
    if not axes:
        raise ValueError(
            f"{hunt.plan.document.path}: has nothing to search; add a section [search] with keys and their values: "
            "people.count = { from = 2, to = 8, steps = 7 }"
        )
    start, stored, points = time.monotonic(), _stored(hunt, folder / TRIALS), list[HuntedPoint]()
    shared = local_workers(workers) if workers > 1 else nullcontext()
    with shared as client, reporter.stage("trials", trials or 0) as advance:
        while (trials is None or len(points) < trials) and (seconds is None or time.monotonic() - start < seconds):
            elites, weights = elites_of(points)
            shares = np.array([point.shares for point in elites])
            asked, scenes = search(shares, weights, len(axes), hunt.seed, len(points) // BATCH)
            new = hunt.plan.base.seed + len(points)
            seeds = [new + n if elite < 0 else elites[elite].seed for n, elite in enumerate(scenes)]
            batch = [
                HuntedPoint(
                    number,
                    tuple(point),
                    dict(pair for axis, share in zip(axes, point, strict=True) for pair in axis.at(share)),
                    scene,
                )
                for number, (point, scene) in enumerate(zip(asked.tolist(), seeds, strict=True), len(points))
                if trials is None or number < trials
            ]
            for point in _measured(hunt, [each for each in batch if each.trial not in stored], client):
                stored[point.trial] = point
                with (folder / TRIALS).open("a", encoding="utf-8") as file:
                    row = {**vars(point), "findings": [vars(each) for each in point.findings]}
                    file.write(json.dumps(row) + "\n")
                advance(1, failed=int(bool(point.error)))
            points += [stored[each.trial] for each in batch]
    chosen = list(distinct(points, lambda each: each.cell[:2]).values())[:keep_most]
    kept = []
    with reporter.stage("shrink", len(chosen)) as advance:
        for point, finding in chosen:
            if failure := _keep(hunt, point, finding):
                kept.append(failure)
                write_failure(failure, folder / "failures")
            advance(1)
    return points, kept


def elites_of(points: Sequence[HuntedPoint]) -> tuple[list[HuntedPoint], Floats]:
    """Return the most reliable trial of each cell, and how often each is varied in relation to the others.

    The more reliably a trial fails the more often it is varied, and all kinds of failures, each with its stage, alike
    often: otherwise the most frequent one, which has the most cells, would take most of the trials.
    """
    found = [each for each in distinct(points, lambda each: each.cell, robust=False).values() if each[1].failed]
    of_kind = Counter[tuple[str, str]]()
    for _, finding in found:
        of_kind[finding.cell[:2]] += finding.failed
    return [point for point, _ in found], np.array([each.failed / of_kind[each.cell[:2]] for _, each in found])


def _stored(hunt: Hunt, path: Path) -> dict[int, HuntedPoint]:
    """Return the trials that are stored, by number, and write the first line where there is none.

    Raises:
        ValueError: another hunt is stored there.
    """
    axes = [vars(each) for each in hunt.plan.search.axes]
    about = {key: getattr(hunt, key) for key in ("variants", "properties", "seed")}
    heading = parse_json(json.dumps({"scenario": fingerprint(hunt.plan.base), "search": axes, **about}))
    lines = read_bytes(path, what="trials").decode().splitlines(keepends=True) if path.exists() else []
    if lines and not lines[-1].endswith("\n"):  # cut off when the process was killed
        del lines[-1]
    rows = list(map(parse_json, lines))
    if rows and rows[0] != heading:
        raise ValueError(f"{path}: holds another hunt, or one of other code; choose another --out or remove it")
    write_text("".join(lines) or json.dumps(heading) + "\n", path)
    points = [
        HuntedPoint(
            **row
            | {"sightings": tuple(map(tuple, row.get("sightings", ())))}
            | {"shares": tuple(row["shares"]), "findings": tuple(HuntFinding(**each) for each in row["findings"])}
        )
        for row in rows[1:]
    ]
    return {each.trial: each for each in points}


def _measured(hunt: Hunt, points: Sequence[HuntedPoint], client: "Client | None") -> Iterator[HuntedPoint]:
    """Yield trials with what was found in them, as they end."""
    units, of = [], {str(each.trial): each for each in points}
    for name, point in of.items():
        try:
            units.append(Unit(name, hunt.plan.at(point.values, point.seed), hunt.variants))
        except ValueError as error:
            yield replace(point, error=str(error))
    measure = partial(hunt_in_trial, properties=hunt.properties)
    with closing(run_units(units, measure, client=client)) as results:
        for each in results:
            if isinstance(each, TrialFailure):
                yield replace(of[each.unit.trial], error=each.error)
            else:
                assert isinstance(each.output, HuntOutput)
                yield replace(of[each.unit.trial], findings=each.output.findings, sightings=each.output.sightings)


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
