"""Scheduler of trials: in this process, in processes of this machine, or on a Dask cluster.

A trial that fails is tried again, because a worker may die for reasons outside the trial, and given up after
:data:`ATTEMPTS` attempts; the other trials go on. An error of the scenario is final at once, because it would happen
again. Variants that failed together are tried once more one by one, so that the others keep their results.
"""

import contextlib
import logging
import secrets
import traceback
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

from mvpose.commands.errors import RunError
from simharness.runtime.frame_pool import worker_context
from simharness.scenario.sections.scenario import Scenario
from simharness.study.stored_trial import StoredTrial, TrialOutput
from simharness.trial.archive import TrialArchive
from simharness.trial.identity import code

if TYPE_CHECKING:
    from distributed import Client, Future

ATTEMPTS = 3
"""Number of attempts before a trial is given up."""

_PATIENCE = 30.0  # seconds to wait for a scheduler
_FIRST_WORKER = 30.0  # seconds to wait for the first worker of a scheduler without workers

Measure = Callable[[Scenario, Sequence[str], StoredTrial], TrialOutput]
"""Function that measures a trial in any process, by default
:func:`simharness.study.stored_trial.run_stored_trial`. It must be picklable and raise a ValueError for an error of
the scenario."""


@dataclass(frozen=True)
class Unit:
    """Unit of work: a trial and its requested variants, which share the detections."""

    trial: str
    """Identity of the trial."""
    scenario: Scenario
    """Resolved scenario at its seed."""
    variants: tuple[str, ...]
    """Variants of the method."""
    stored: StoredTrial = field(default_factory=StoredTrial)
    """Stored parts of the trial."""


@dataclass(frozen=True)
class TrialSuccess:
    """Result of a finished unit."""

    unit: Unit
    """The unit."""
    output: TrialOutput
    """Results by variant, and archives to be stored."""
    seconds: float
    """Duration."""

    @property
    def parts(self) -> "tuple[TrialSuccess]":
        """The result itself, as the only part."""
        return (self,)


@dataclass(frozen=True)
class TrialFailure:
    """Failure of a unit."""

    unit: Unit
    """The unit."""
    error: str
    """Message of the error, one line."""
    traceback: str
    """Traceback; empty where there is none."""
    final: bool = False
    """Whether the unit would fail in the same way again."""
    deaths: int = 0
    """Number of workers that died while they ran it."""
    alone: "tuple[TrialSuccess | TrialFailure, ...]" = ()
    """Results of the variants one by one, in the order of the unit, at least one of them a failure; empty where the
    variants were not tried one by one."""

    @property
    def parts(self) -> "tuple[TrialSuccess | TrialFailure, ...]":
        """Results of the variants one by one, or this failure of all variants together."""
        return self.alone or (self,)


def run_units(
    units: Collection[Unit],
    measure: Measure,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    client: "Client | None" = None,
) -> Generator[TrialSuccess | TrialFailure, None, None]:
    """Measure units and yield their results in the order in which they finish.

    A unit of several variants that has failed :data:`ATTEMPTS` times is split: each variant is tried alone, and given
    up at once if it fails with the same error as before. The results of the variants are joined to one result.

    Closing the iterator, or an error in the loop over it, ends all work.

    Args:
        units: units in the order in which they start; no two of the same trial.
        measure: function that measures a unit.
        workers: number of processes. With 1 the work is done in this process, and a crash ends it. Each imports
            the main module, so a script that calls this needs ``if __name__ == "__main__"``.
        scheduler: address of a Dask scheduler whose workers are used instead.
        client: client of :func:`local_workers` that many calls share; it stays open.

    Raises:
        ValueError: fewer than one worker; no scheduler at the address, or it has no workers, or they run other code.
        RunError: the connection to the cluster was lost.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    if client is not None:
        yield from _run_on_cluster(units, measure, client)
    elif scheduler is None and workers == 1:
        yield from _run_in_process(units, measure)
    elif units:
        with _connected(scheduler) if scheduler is not None else local_workers(min(workers, len(units))) as cluster:
            yield from _run_on_cluster(units, measure, cluster)


def attempt(measure: Measure, unit: Unit) -> TrialSuccess | TrialFailure:
    """Measure a unit once. Errors are returned as text, because not every exception can be pickled."""
    start = perf_counter()
    try:
        output = measure(unit.scenario, unit.variants, unit.stored)
    except Exception as error:
        message = str(error) if isinstance(error, ValueError | RunError) else f"{type(error).__name__}: {error}"
        return TrialFailure(unit, message, traceback.format_exc(), final=isinstance(error, ValueError))
    return TrialSuccess(unit, output, perf_counter() - start)


def error_text(failures: Iterable[TrialFailure], variants: Collection[str]) -> str:
    """Return the errors of failures in one line, with the names of their variants unless all have the same error.

    Args:
        failures: failures of variants of one trial.
        variants: all variants of the trial.
    """
    whose: dict[str, list[str]] = {}
    for each in failures:
        whose.setdefault(each.error, []).extend(each.unit.variants)
    if len(whose) == 1 and set(*whose.values()) == set(variants):
        return next(iter(whose))
    return "; ".join(f"{', '.join(names)}: {error}" for error, names in whose.items())


def _split_by_variant(failure: TrialFailure) -> list[Unit]:
    """Return a unit for each variant of a failed unit; none where it has one variant or the failure is final."""
    if failure.final or len(failure.unit.variants) < 2:
        return []
    return [replace(failure.unit, variants=(variant,)) for variant in failure.unit.variants]


def _join_parts(together: TrialFailure, alone: Iterable[TrialSuccess | TrialFailure]) -> TrialSuccess | TrialFailure:
    """Return the result of a failed unit, joined from the results of its variants one by one."""
    unit = together.unit
    alone = tuple(sorted(alone, key=lambda each: unit.variants.index(each.unit.variants[0])))
    done = [each for each in alone if isinstance(each, TrialSuccess)]
    lost = [each for each in alone if isinstance(each, TrialFailure)]
    if lost:
        return TrialFailure(unit, error_text(lost, unit.variants), lost[0].traceback, alone=alone)
    output = TrialOutput(
        {variant: each for part in done for variant, each in part.output.results.items()},
        TrialArchive(
            next((part.output.archive.detected for part in done if part.output.archive.detected), b""),
            {variant: each for part in done for variant, each in part.output.archive.estimates.items()},
        ),
    )
    return TrialSuccess(unit, output, sum(each.seconds for each in done))


def _run_in_process(units: Iterable[Unit], measure: Measure) -> Generator[TrialSuccess | TrialFailure, None, None]:
    for unit in units:
        result = _attempt_repeatedly(unit, measure)
        if isinstance(result, TrialFailure) and (parts := _split_by_variant(result)):
            result = _join_parts(result, [_attempt_repeatedly(part, measure, together=result) for part in parts])
        yield result


def _attempt_repeatedly(
    unit: Unit, measure: Measure, together: TrialFailure | None = None
) -> TrialSuccess | TrialFailure:
    """Attempt a unit until it is finished or given up.

    Args:
        unit: the unit.
        measure: function that measures it.
        together: failure of all variants together, if the unit is one variant of a split unit.
    """
    for _ in range(ATTEMPTS):
        result = attempt(measure, unit)
        if isinstance(result, TrialSuccess) or result.final or _repeats_error(result, together):
            break
    return result


def _repeats_error(failure: TrialFailure, together: TrialFailure | None) -> bool:
    """Return whether a variant alone fails with the same error as it did :data:`ATTEMPTS` times with the others."""
    return together is not None and failure.error == together.error


def _run_on_cluster(
    units: Iterable[Unit], measure: Measure, client: "Client"
) -> Generator[TrialSuccess | TrialFailure, None, None]:
    """Run units on a cluster, at most one for each thread, because units that wait at a worker are lost if it dies.

    If a worker dies, each of its units may be the cause. These units are therefore run last, one at a time: then the
    cause is certain, and a unit that needs much memory has the machine to itself.
    """
    from distributed import as_completed

    waiting, suspects, alone = iter(units), deque[Unit](), False
    parts = deque[Unit]()  # of units that were split; they run before the waiting units
    together: dict[str, TrialFailure] = {}  # failure of all variants together, by trial
    finished: dict[str, list[TrialSuccess | TrialFailure]] = {}  # results of the parts so far, by trial
    failed: Counter[tuple[str, tuple[str, ...]]] = Counter()
    running: dict[Future[Any], Unit] = {}
    completed: Any = as_completed()

    def submit(unit: Unit) -> None:
        # A new key each time, because Dask does not run a failed key again.
        future = client.submit(attempt, measure, unit, key=f"{unit.trial}-{secrets.token_hex(4)}", pure=False)
        running[future] = unit
        completed.add(future)

    while True:
        while not alone and len(running) < max(1, sum(client.nthreads().values())):
            unit = parts.popleft() if parts else next(waiting, None)
            if unit is None:
                alone = not running
                break
            submit(unit)
        if alone and not running and suspects:
            submit(suspects.popleft())
        if not running:
            return
        future = next(completed)
        unit = running.pop(future)
        result, whole = _result(future, unit), together.get(unit.trial)
        del future  # a held result would be measured again if its worker died
        if isinstance(result, TrialFailure):
            tried = unit.trial, unit.variants
            failed[tried] += max(1, result.deaths) if alone else 1
            if not (result.final or failed[tried] >= ATTEMPTS or _repeats_error(result, whole)):
                if result.deaths:
                    suspects.append(unit)
                else:
                    submit(unit)
                continue
            if whole is None and (divided := _split_by_variant(result)):
                together[unit.trial], finished[unit.trial] = result, []
                (suspects if alone or result.deaths else parts).extend(divided)
                continue
        if whole is None:
            yield result
            continue
        finished[unit.trial].append(result)
        if len(finished[unit.trial]) == len(whole.unit.variants):
            yield _join_parts(whole, finished.pop(unit.trial))


def _result(future: "Future[Any]", unit: Unit) -> TrialSuccess | TrialFailure:
    """Return the result of a finished future; a failure where its worker died.

    Raises:
        RunError: the connection was lost, or another client cancelled the future.
    """
    from distributed import KilledWorker

    if future.status == "finished":
        result: TrialSuccess | TrialFailure = future.result()
        return result
    if future.status != "error":
        raise RunError(f"the connection to the Dask scheduler was lost, or another client cancelled trial {unit.trial}")
    error = future.exception()
    if isinstance(error, KilledWorker):
        return TrialFailure(
            unit, "the worker process died; it may have run out of memory", "", deaths=error.allowed_failures + 1
        )
    return TrialFailure(unit, f"{type(error).__name__}: {error}", "")


@contextlib.contextmanager
def local_workers(workers: int) -> "Iterator[Client]":
    """Give a client of a new cluster of this machine."""
    import dask
    from distributed import Client, LocalCluster

    # Report a dead worker at once: _run_on_cluster decides what follows, and reports it, so nothing is logged.
    quiet = {"distributed.scheduler.allowed-failures": 0, "logging": {"distributed": "critical"}}
    start = {
        "distributed.worker.multiprocessing-method": worker_context().get_start_method(),
        "distributed.worker.profile.enabled": False,  # it samples the stack a hundred times a second; nobody reads it
    }
    with (
        dask.config.set({**quiet, **start}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # any free port; the scheduler opens one even without a dashboard
            silence_logs=logging.CRITICAL,
            memory_limit=0,  # otherwise Dask divides the memory evenly and kills workers that use more
        ) as cluster,
        Client(cluster) as client,
    ):
        client.register_plugin(_ignore_interrupts())
        yield client


@contextlib.contextmanager
def _connected(scheduler: str) -> "Iterator[Client]":
    from distributed import Client

    try:
        client = Client(scheduler, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ValueError(f"--scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_FIRST_WORKER)
        except TimeoutError:
            raise ValueError(f"--scheduler {scheduler}: it has no workers; start one with: dask worker") from None
        for address, digests in client.run(code, on_error="return").items():
            if isinstance(digests, Exception):
                raise ValueError(f"--scheduler {scheduler}: worker {address} cannot import simharness: {digests}")
            if digests != code():
                raise ValueError(
                    f"--scheduler {scheduler}: worker {address} runs another version of simharness or mvpose, and "
                    "results would be stored under the wrong version: install this version there"
                )
        yield client


def _ignore_interrupts() -> Any:
    """Return a Dask plugin that makes workers ignore Ctrl-C, which reaches all processes of a terminal."""
    from distributed import WorkerPlugin

    class IgnoreInterrupts(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            import signal

            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return IgnoreInterrupts()
