"""Run of a study: finished trials are read from the store, missing ones are run, and the result folder is written."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from mvpose.commands.output_files import check_writable, make_folder
from mvpose.commands.progress import Reporter, Silence
from mvpose.files.atomic_files import atomic_folder
from simharness.scenario.load import Study, Value
from simharness.scenario.sections.scenario import Scenario
from simharness.study.factors import refined_values
from simharness.study.scheduler import Measure, TrialFailure, TrialSuccess, Unit, error_text, run_units
from simharness.study.stored_trial import StoredTrial
from simharness.study.stored_trial import run_stored_trial as measure_trial
from simharness.study.study_folder import PlannedTrial, Results, document, plan, read_study, tables, write_study
from simharness.study.trial_store import Entry, EntryState, Store, StoreError
from simharness.trial.archive import TrialArchive
from simharness.trial.identity import code, provenance
from simharness.trial.needs import require_memory
from simharness.trial.stages.estimators import estimators_of

_STUDY = "simharness study"


@dataclass(frozen=True)
class FailedTrial:
    """Trial in which at least one variant could not be measured."""

    trial: str
    """Identity of the trial."""
    case: str
    """Case of its setting."""
    factors: Mapping[str, Value]
    """Factors of its setting."""
    seed: int
    """Seed of the trial."""
    variants: tuple[str, ...]
    """Missing variants."""
    error: str
    """Message of the error, with the names of the variants unless all variants have the same error."""


@dataclass(frozen=True)
class StudyOutcome:
    """Numbers of kept, run and failed trials of a study."""

    trials: int
    """Number of trials; a trial that several settings share counts once."""
    kept: int
    """Number of trials that were finished before."""
    run: int
    """Number of trials that were finished in this run."""
    failed: tuple[FailedTrial, ...]
    """The failed trials. Their variants that were measured are stored."""
    damaged: tuple[str, ...]
    """Damaged entries of the store, which were run again."""
    seconds: float
    """Duration of the run."""


class Interrupted(KeyboardInterrupt):
    """Interruption of a study by Ctrl-C, with the number of finished trials."""

    def __init__(self, finished: int, trials: int) -> None:
        super().__init__(f"interrupted: {finished} of {trials} trials are stored; the same command continues")


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
    """Run the unfinished trials of a study and write its results.

    Where its sweep is refined, values are added between those where scores break, and run, until their number is
    reached. Which ones follows from the trials alone, so that the same command continues an interrupted refinement.

    Args:
        study: the study.
        out: parent of the result folder, which has the name of the study. The folder appears when it is complete and
            replaces an earlier one.
        store: the folder of finished trials; ``out / "store"`` by default.
        workers: processes; see :func:`simharness.study.scheduler.run_units`.
        scheduler: address of a Dask scheduler to use instead of processes.
        reporter: receiver of progress, one step for each trial.
        command: command line of the user, for ``study.json``.
        measure: function that measures a trial.

    Returns:
        The results, as :func:`simharness.study.study_folder.read_study` reads them;
        ``info["failed"]`` lists what is missing.

    Raises:
        ValueError: the result folder holds something else, the store is no store, the scheduler does not answer, or a
            user-defined estimator cannot be loaded.
        RunError: the disk is full, or the connection to the cluster was lost. Finished trials stay in the store.
        Interrupted: Ctrl-C. Finished trials stay in the store.
    """
    folder, store = out / study.name, out / "store" if store is None else store
    _check_place(folder, store)
    estimators_of(study.base.method)  # report errors now rather than at every trial
    opened, swept, done = Store(store), study, list[StudyOutcome]()
    added: dict[str, tuple[float, ...]] = {}
    while True:
        planned = plan(study)
        done.append(
            run_planned(planned, opened, workers=workers, scheduler=scheduler, reporter=reporter, measure=measure)
        )
        order = {id(setting): index for index, setting in enumerate(study.settings)}
        ordered = sorted(planned, key=lambda each: (order[id(each.setting)], each.seed))
        failed = {each.trial for each in done[-1].failed}
        rows = [
            (each, entry) for each in ordered for entry in stored_entries(opened, each, failed=each.trial in failed)
        ]
        new = _next_values(study, rows, added, folder)
        if not new:
            break
        added = {key: (*added.get(key, ()), *new.get(key, ())) for key in {**added, **new}}
        study = swept.with_values(added)
    run = sum(each.run for each in done)
    tally = replace(
        done[-1],
        kept=done[-1].trials - run - len(failed),
        run=run,
        damaged=done[0].damaged,
        seconds=sum(each.seconds for each in done),
    )
    info = _info(study, tally, command)
    try:
        with atomic_folder(folder, _STUDY) as partial:
            write_study(partial, info, tables(rows, study.factors), document(study))
    except OSError as error:
        raise StoreError(
            f"{folder}: cannot be written: {error.strerror}. All trials are stored: free some disk space and run the "
            "same command again"
        ) from error
    return read_study(folder)


def _next_values(
    study: Study, rows: Sequence[tuple[PlannedTrial, Entry]], added: Mapping[str, Sequence[float]], folder: Path
) -> dict[str, tuple[float, ...]]:
    """Return the values to add to a study that has these results and was refined by some values already."""
    most = study.plan.sweep.refine
    if not most or not rows:
        return {}
    found = tables(rows, study.factors)
    info = {"factors": study.factors, "one_at_a_time": study.one_at_a_time, "variants": study.variants}
    left = {key: most - len(added.get(key, ())) for key in study.factors}
    return refined_values(Results(**vars(found), info=info, folder=folder), left)


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
    """Run one of ``n`` parts of a study and only store its trials; ``simharness merge`` merges the stores.

    Args:
        study: the study.
        shard: index of the part, from 1 to n, and n.
        store: the folder of finished trials.
        workers: see :func:`run_study`.
        scheduler: see :func:`run_study`.
        reporter: see :func:`run_study`.
        measure: see :func:`run_study`.

    Raises:
        ValueError: the part does not exist, or see :func:`run_study`.
        RunError, Interrupted: see :func:`run_study`.
    """
    part, parts = shard
    if not 1 <= part <= parts:
        raise ValueError(f"shard must be i/n with i from 1 to n, got {part}/{parts}")
    estimators_of(study.base.method)
    planned = list(_unique(plan(study)))[part - 1 :: parts]
    return run_planned(planned, Store(store), workers=workers, scheduler=scheduler, reporter=reporter, measure=measure)


def run_planned(
    planned: Sequence[PlannedTrial],
    store: Store,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    reporter: Reporter | None = None,
    measure: Measure = measure_trial,
) -> StudyOutcome:
    """Measure the trials that are missing or outdated in the store; the arguments and errors of :func:`run_study`."""
    start = perf_counter()
    unique = {each.trial: each for each in _unique(planned)}
    units = [unit for each in unique.values() if (unit := _unit(store, each)).variants]
    damaged = tuple(sorted(store.damaged))
    if scheduler is None:
        require_memory(_distinct(units), workers=min(workers, len(units)))
    kept, run, failed = len(unique) - len(units), 0, dict[str, TrialFailure]()
    try:
        with (
            (reporter or Silence()).stage("trials", len(unique), done=kept) as advance,
            closing(run_units(units, measure, workers=workers, scheduler=scheduler)) as results,
        ):
            for result in results:
                each = unique[result.unit.trial]
                for part in result.parts:
                    if isinstance(part, TrialSuccess):
                        _keep(store, each, part)
                    else:
                        _store_failure(store, each, part)
                if isinstance(result, TrialFailure):
                    failed[each.trial] = result
                else:
                    run += 1
                advance(1, failed=int(isinstance(result, TrialFailure)))
    except KeyboardInterrupt:  # may come between writing a trial and counting it: count in the store
        finished = sum(all(map(store.holds, unique[unit.trial].entries.values())) for unit in units)
        raise Interrupted(kept + finished, len(unique)) from None
    failures = tuple(_failed(each, failed[each.trial]) for each in planned if each.trial in failed)
    return StudyOutcome(len(unique), kept, run, failures, damaged, perf_counter() - start)


def _unique(planned: Sequence[PlannedTrial]) -> Iterator[PlannedTrial]:
    """Yield each trial once: the first of those with the same identity."""
    seen: set[str] = set()
    for each in planned:
        if each.trial not in seen:
            seen.add(each.trial)
            yield each


def _unit(store: Store, planned: PlannedTrial) -> Unit:
    """Return the remaining work of a trial; a unit without variants if it is finished."""
    entries = {variant: store.read(identity) for variant, identity in planned.entries.items()}
    missing = tuple(name for name, entry in entries.items() if entry is None or entry.state is not EntryState.CURRENT)
    stored = StoredTrial()
    if missing and (detected := store.read_detections(planned.trial)):
        known = {name: entry for name, entry in entries.items() if name in missing and entry and entry.estimates}
        stored = StoredTrial(
            TrialArchive(detected, {name: entry.estimates for name, entry in known.items()}),
            {name: entry.result.failures for name, entry in known.items() if entry.failures_code == code().failures},
        )
    return Unit(planned.trial, planned.scenario, missing, stored)


def _distinct(units: Sequence[Unit]) -> list[Scenario]:
    """Return one scenario for each setting of the units: seeds change no needs."""
    return list(
        {unit.scenario.model_copy(update={"seed": 0}).model_dump_json(): unit.scenario for unit in units}.values()
    )


def _keep(store: Store, planned: PlannedTrial, success: TrialSuccess) -> None:
    """Store a finished unit. Detections are written first, because an entry without them cannot be scored again."""
    output = success.output
    if output.archive.detected:
        store.write_detections(planned.trial, output.archive.detected)
    for variant, result in output.results.items():
        estimates = output.archive.estimates.get(variant, b"")
        entry = Entry(planned.trial, variant, result, success.seconds / len(output.results), estimates)
        store.write(planned.entries[variant], entry)


def _store_failure(store: Store, planned: PlannedTrial, failure: TrialFailure) -> None:
    for variant in failure.unit.variants:
        store.write_failure(
            planned.entries[variant],
            {"trial": planned.trial, "variant": variant, "error": failure.error, "traceback": failure.traceback},
        )


def _failed(planned: PlannedTrial, failure: TrialFailure) -> FailedTrial:
    failures = [part for part in failure.parts if isinstance(part, TrialFailure)]
    return FailedTrial(
        trial=planned.trial,
        case=planned.setting.case,
        factors=dict(planned.setting.factors),
        seed=planned.seed,
        variants=tuple(variant for part in failures for variant in part.unit.variants),
        error=error_text(failures, planned.entries),
    )


def stored_entries(store: Store, planned: PlannedTrial, *, failed: bool = False) -> Iterator[Entry]:
    """Yield the stored entries of a trial; entries may be missing only if the trial failed.

    Raises:
        StoreError: an entry of a finished trial cannot be read any more.
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
    """Check before the run that the result folder can be written and replaces nothing but a study."""
    if folder.resolve() in (store.resolve(), *store.resolve().parents):
        raise ValueError(f"the results would replace the store {store}: choose another folder with --store")
    make_folder(folder.parent)
    check_writable(folder, _STUDY)
