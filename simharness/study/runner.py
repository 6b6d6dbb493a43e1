"""A study from its settings to its folder of results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from simharness.runtime.atomic_files import atomic_folder
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.study_definition import Study, Value
from simharness.study.measure import StoredTrial
from simharness.study.measure import measure as measure_trial
from simharness.study.plan import PlannedTrial, plan
from simharness.study.result_folder import Results, read_study, write_study
from simharness.study.scheduler import Measure, TrialFailure, TrialSuccess, Unit, error_text, run_units
from simharness.study.study_file import document
from simharness.study.tables import tables
from simharness.study.trial_store import Entry, EntryState, Store, StoreError
from simharness.trial.archive import TrialArchive
from simharness.trial.identity import code
from simharness.trial.provenance import provenance
from simharness.trial.stages.estimators import estimators_of


@dataclass(frozen=True)
class FailedTrial:
    """A trial of which at least one variant could not be measured.

    Attributes:
        trial: its identity.
        case: of its setting.
        factors: of its setting.
        seed: its own.
        variants: that are missing.
        error: why; with the names of the variants where it is not that of all.
    """

    trial: str
    case: str
    factors: Mapping[str, Value]
    seed: int
    variants: tuple[str, ...]
    error: str


@dataclass(frozen=True)
class StudyOutcome:
    """What became of the trials of a study.

    Attributes:
        trials: how many there are; those that two settings share count once.
        kept: how many were finished before.
        run: how many were finished now.
        failed: the others. Of some of them there are variants that were measured, and kept.
        damaged: entries of the store that were found damaged and run again.
        seconds: that it took.
    """

    trials: int
    kept: int
    run: int
    failed: tuple[FailedTrial, ...]
    damaged: tuple[str, ...]
    seconds: float


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, and what is kept of the study."""

    def __init__(self, finished: int, trials: int) -> None:
        super().__init__(f"interrupted: {finished} of {trials} trials are kept; the same command goes on")


def run_study(
    study: Study,
    *,
    out: Path,
    store: Path | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    reporter: Reporter | None = None,
    command: str | None = None,
    measure: Measure = measure_trial,
) -> Results:
    """Run what is not finished of a study, and write its results.

    Args:
        study: what to run.
        out: where the folder named as the study goes. It appears when it is whole, in the place of an earlier one.
        store: the folder of finished trials; ``out / "store"`` by default.
        workers: processes; see :func:`simharness.study.scheduler.run_units`.
        scheduler: address of a Dask scheduler, instead.
        reporter: receiver of progress, a step a trial.
        command: how the user asked for this.
        measure: what is done with a trial.

    Returns:
        The results, as :func:`simharness.study.result_folder.read_study` reads them;
        ``info["failed"]`` says what is missing.

    Raises:
        ValueError: the folder is no place for a study, the store is no store, the scheduler does not answer, or a
            method of one's own cannot be loaded.
        RunError: the disk is full, or the cluster went away. What is finished is kept.
        Interrupted: Ctrl-C. What is finished is kept.
    """
    folder, store = out / study.name, out / "store" if store is None else store
    _check_place(folder, store)
    estimators_of(study.base.method)  # better now than at every trial
    opened, planned = Store(store), plan(study)
    tally = _run(planned, opened, workers=workers, scheduler=scheduler, reporter=reporter, measure=measure)
    order = {id(setting): index for index, setting in enumerate(study.settings)}
    ordered = sorted(planned, key=lambda each: (order[id(each.setting)], each.seed))
    failed = {each.trial for each in tally.failed}
    rows = [(each, entry) for each in ordered for entry in _entries(opened, each, failed=each.trial in failed)]
    info = _info(study, tally, command)
    try:
        with atomic_folder(folder) as partial:
            write_study(partial, info, tables(rows, study.factors), document(study))
    except OSError as error:
        raise StoreError(
            f"{folder}: cannot be written: {error.strerror}. All trials are kept: make room, and the same command goes "
            "on"
        ) from error
    return read_study(folder)


def run_shard(
    study: Study,
    shard: tuple[int, int],
    *,
    store: Path,
    workers: int = 1,
    scheduler: str | None = None,
    reporter: Reporter | None = None,
    measure: Measure = measure_trial,
) -> StudyOutcome:
    """Run one of ``n`` parts of a study, into a store alone: ``simharness merge`` puts the stores together.

    Args:
        study: what to run.
        shard: which part, from 1 to n; and n.
        store: the folder of finished trials.
        workers: as of :func:`run_study`.
        scheduler: as of :func:`run_study`.
        reporter: as of :func:`run_study`.
        measure: as of :func:`run_study`.

    Raises:
        ValueError, RunError, Interrupted: as of :func:`run_study`; no such part.
    """
    part, parts = shard
    if not 1 <= part <= parts:
        raise ValueError(f"a shard is i/n with i from 1 to n, got {part}/{parts}")
    estimators_of(study.base.method)
    planned = list(_different(plan(study)))[part - 1 :: parts]
    return _run(planned, Store(store), workers=workers, scheduler=scheduler, reporter=reporter, measure=measure)


def _run(
    planned: Sequence[PlannedTrial],
    store: Store,
    *,
    workers: int,
    scheduler: str | None,
    reporter: Reporter | None,
    measure: Measure,
) -> StudyOutcome:
    """Measure what the store lacks."""
    start = perf_counter()
    different = {each.trial: each for each in _different(planned)}
    units = [unit for each in different.values() if (unit := _unit(store, each)).variants]
    damaged = tuple(sorted(store.damaged))
    kept, run, failed = len(different) - len(units), 0, dict[str, TrialFailure]()
    try:
        with (
            (reporter or Silence()).stage("trials", len(different), done=kept) as advance,
            closing(run_units(units, measure, workers=workers, scheduler=scheduler)) as results,
        ):
            for result in results:
                each = different[result.unit.trial]
                for part in result.parts:
                    if isinstance(part, TrialSuccess):
                        _keep(store, each, part)
                    else:
                        _note(store, each, part)
                if isinstance(result, TrialFailure):
                    failed[each.trial] = result
                else:
                    run += 1
                advance(1, failed=int(isinstance(result, TrialFailure)))
    except KeyboardInterrupt:  # which may come between a trial's last entry and its count: the store knows
        finished = sum(all(map(store.holds, different[unit.trial].entries.values())) for unit in units)
        raise Interrupted(kept + finished, len(different)) from None
    losses = tuple(_failed(each, failed[each.trial]) for each in planned if each.trial in failed)
    return StudyOutcome(len(different), kept, run, losses, damaged, perf_counter() - start)


def _different(planned: Sequence[PlannedTrial]) -> Iterator[PlannedTrial]:
    """The first of those that are the same trial."""
    seen: set[str] = set()
    for each in planned:
        if each.trial not in seen:
            seen.add(each.trial)
            yield each


def _unit(store: Store, planned: PlannedTrial) -> Unit:
    """Return the work that is left of a trial: no variants where nothing is."""
    entries = {variant: store.read(identity) for variant, identity in planned.entries.items()}
    left = tuple(name for name, entry in entries.items() if entry is None or entry.state is not EntryState.CURRENT)
    stored = StoredTrial()
    if left and (detected := store.read_detections(planned.trial)):
        known = {name: entry for name, entry in entries.items() if name in left and entry and entry.estimates}
        stored = StoredTrial(
            TrialArchive(detected, {name: entry.estimates for name, entry in known.items()}),
            {name: entry.result.failures for name, entry in known.items() if entry.failures_code == code().failures},
        )
    return Unit(planned.trial, planned.scenario, left, stored)


def _keep(store: Store, planned: PlannedTrial, success: TrialSuccess) -> None:
    """Store a finished unit. Detections come first: an entry without them could never be scored again."""
    output = success.output
    if output.archive.detected:
        store.write_detections(planned.trial, output.archive.detected)
    for variant, result in output.results.items():
        estimates = output.archive.estimates.get(variant, b"")
        entry = Entry(planned.trial, variant, result, success.seconds / len(output.results), estimates)
        store.write(planned.entries[variant], entry)


def _note(store: Store, planned: PlannedTrial, failure: TrialFailure) -> None:
    for variant in failure.unit.variants:
        noted = {"trial": planned.trial, "variant": variant, "error": failure.error, "traceback": failure.traceback}
        store.write_failure(planned.entries[variant], noted)


def _failed(planned: PlannedTrial, failure: TrialFailure) -> FailedTrial:
    lost = [part for part in failure.parts if isinstance(part, TrialFailure)]
    return FailedTrial(
        trial=planned.trial,
        case=planned.setting.case,
        factors=dict(planned.setting.factors),
        seed=planned.seed,
        variants=tuple(variant for part in lost for variant in part.unit.variants),
        error=error_text(lost, planned.entries),
    )


def _entries(store: Store, planned: PlannedTrial, *, failed: bool) -> Iterator[Entry]:
    """What the store has of a trial; all of it, but of one that failed.

    Raises:
        StoreError: an entry is not there any more.
    """
    for identity in planned.entries.values():
        entry = store.read(identity)
        if entry is not None:
            yield entry
        elif not failed:
            raise StoreError(
                f"store {store.folder}: entry {identity} was finished and can no longer be read; the same command runs "
                "it again"
            )


def _info(study: Study, tally: StudyOutcome, command: str | None) -> dict[str, Any]:
    return {
        "name": study.name,
        "description": study.description,
        "factors": list(study.factors),
        "one_at_a_time": study.one_at_a_time,
        "settings": len(study.settings),
        "trials": tally.trials,
        "kept": tally.kept,
        "run": tally.run,
        "failed": [asdict(each) for each in tally.failed],
        "damaged": list(tally.damaged),
        **provenance(command=command, seeds=study.seeds, variants=study.variants, seconds=tally.seconds),
    }


def _check_place(folder: Path, store: Path) -> None:
    """Before the work: a place that is no good is better known at once, and nothing may be replaced but a study."""
    if folder.resolve() in (store.resolve(), *store.resolve().parents):
        raise ValueError(f"the results would take the place of the store {store}: name another folder by --store")
    if folder.exists() and not (folder / "study.json").is_file() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f"{folder} is there and holds no study: name another folder by --out, or rename the study")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {folder.parent}: cannot make this folder: {error.strerror}") from None
