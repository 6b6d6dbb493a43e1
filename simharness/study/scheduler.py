"""Trials shared out: in this process, among processes of this machine, or on a Dask cluster.

What fails is tried again, for a worker may die of what it has no fault in, and given up after :data:`ATTEMPTS`; the
others go on. What the scenario is to blame for is given up at once: it would fail the same way again. Variants that
failed together are tried once more one by one, so that one that fails costs no other its result.
"""

from __future__ import annotations

import contextlib
import logging
import secrets
import traceback
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

from simharness.runtime.errors import RunError
from simharness.scenario.sections.scenario import Scenario
from simharness.study.measure import StoredTrial, TrialOutput
from simharness.trial.archive import TrialArchive
from simharness.trial.identity import code

if TYPE_CHECKING:
    from distributed import Client, Future

ATTEMPTS = 3
"""How often a trial may fail before it is given up."""

_PATIENCE = 30.0  # seconds to wait for a scheduler
_FIRST_WORKER = 30.0  # seconds to wait for the first worker of one that has none

Measure = Callable[[Scenario, Sequence[str], StoredTrial], TrialOutput]
"""What is done with a trial, in whatever process: :func:`simharness.study.measure.measure`. It must be picklable, and
say by a ValueError that the scenario is to blame."""


@dataclass(frozen=True)
class Unit:
    """What is shared out: a trial, and the variants of it that are wanted. It is detected once for all of them.

    Attributes:
        trial: its identity.
        scenario: at its seed.
        variants: of the method.
        stored: what the store has of the trial.
    """

    trial: str
    scenario: Scenario
    variants: tuple[str, ...]
    stored: StoredTrial = field(default_factory=StoredTrial)


@dataclass(frozen=True)
class TrialSuccess:
    """A unit that is done.

    Attributes:
        unit: which.
        output: results by variant, and what is to be stored beside them.
        seconds: that it took.
    """

    unit: Unit
    output: TrialOutput
    seconds: float

    @property
    def parts(self) -> tuple[TrialSuccess]:
        """It is one whole."""
        return (self,)


@dataclass(frozen=True)
class TrialFailure:
    """A unit that failed.

    Attributes:
        unit: which.
        error: in a line.
        traceback: of it; empty where there is none.
        final: whether it would fail the same way again.
        deaths: how many workers died over it.
        alone: what each variant did by itself, in the unit's order, where the unit has several; at least one failed.
    """

    unit: Unit
    error: str
    traceback: str
    final: bool = False
    deaths: int = 0
    alone: tuple[TrialSuccess | TrialFailure, ...] = ()

    @property
    def parts(self) -> tuple[TrialSuccess | TrialFailure, ...]:
        """What is known of its variants: each by itself, or that all failed together."""
        return self.alone or (self,)


def run_units(
    units: Collection[Unit], measure: Measure, *, workers: int = 1, scheduler: str | None = None
) -> Generator[TrialSuccess | TrialFailure, None, None]:
    """Measure units, each until it is done or has failed for good, and yield them as they come.

    A unit of several variants that has failed :data:`ATTEMPTS` times is divided: each variant is tried by itself, and
    given up at once if it fails as all did together. What comes of that is one result, too.

    Closing the iterator, or an error in whoever iterates, ends all work.

    Args:
        units: in the order in which they are begun, no two of one trial.
        measure: what to do with each.
        workers: processes; 1 works in this one, where a crash cannot be survived. They are spawned, so a script that
            calls this needs its ``if __name__ == "__main__"``.
        scheduler: address of a Dask scheduler whose workers do it instead.

    Raises:
        ValueError: fewer than one worker; no scheduler at the address, or it has no workers, or they run other code.
        RunError: the cluster went away.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    if scheduler is None and workers == 1:
        yield from _run_in_process(units, measure)
    elif units:
        with _client(min(workers, len(units)), scheduler) as client:
            yield from _run_on_cluster(units, measure, client)


def attempt(measure: Measure, unit: Unit) -> TrialSuccess | TrialFailure:
    """Measure a unit once. Errors come back as text, for not every exception can travel."""
    start = perf_counter()
    try:
        output = measure(unit.scenario, unit.variants, unit.stored)
    except Exception as error:
        said = str(error) if isinstance(error, ValueError | RunError) else f"{type(error).__name__}: {error}"
        return TrialFailure(unit, said, traceback.format_exc(), final=isinstance(error, ValueError))
    return TrialSuccess(unit, output, perf_counter() - start)


def error_text(failures: Iterable[TrialFailure], variants: Collection[str]) -> str:
    """The errors of failures in a line, with whose they are, but where all variants have the same one.

    Args:
        failures: of variants of one trial.
        variants: all of the trial.
    """
    whose: dict[str, list[str]] = {}
    for each in failures:
        whose.setdefault(each.error, []).extend(each.unit.variants)
    if len(whose) == 1 and set(*whose.values()) == set(variants):
        return next(iter(whose))
    return "; ".join(f"{', '.join(names)}: {error}" for error, names in whose.items())


def _split_by_variant(failure: TrialFailure) -> list[Unit]:
    """The variants of a unit that has failed for good, each a unit; none where that would tell nothing new."""
    if failure.final or len(failure.unit.variants) < 2:
        return []
    return [replace(failure.unit, variants=(variant,)) for variant in failure.unit.variants]


def _join_parts(together: TrialFailure, alone: Iterable[TrialSuccess | TrialFailure]) -> TrialSuccess | TrialFailure:
    """What came of a unit that failed: what its variants did one by one."""
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
    """Attempt a unit until it is done or has failed for good; ``together``: the failure that it is a part of."""
    for _ in range(ATTEMPTS):
        result = attempt(measure, unit)
        if isinstance(result, TrialSuccess) or result.final or _repeats_error(result, together):
            break
    return result


def _repeats_error(failure: TrialFailure, together: TrialFailure | None) -> bool:
    """Whether a variant fails by itself as it did, :data:`ATTEMPTS` times, with the others."""
    return together is not None and failure.error == together.error


def _run_on_cluster(
    units: Iterable[Unit], measure: Measure, client: Client
) -> Generator[TrialSuccess | TrialFailure, None, None]:
    """As many units are on their way as the cluster has threads: more would wait at workers that may die under them.

    When a worker dies nobody knows which of the units that were at it has killed it. So those come last, one at a time:
    then there is no doubt, and one that needs much memory has the machine to itself.
    """
    waiting, suspects, alone = iter(units), deque[Unit](), False
    parts = deque[Unit]()  # of units that are divided; they come before what waits
    together: dict[str, TrialFailure] = {}  # by trial, how they failed
    finished: dict[str, list[TrialSuccess | TrialFailure]] = {}  # by trial, what came of its parts so far
    failed: Counter[tuple[str, tuple[str, ...]]] = Counter()
    running: dict[Future[Any], Unit] = {}
    completed = _completed()

    def submit(unit: Unit) -> None:
        # A name of its own each time: what failed under a name would not be run under it again.
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
        del future  # what is held would be measured anew, were the worker that has it to die
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


def _completed() -> Any:
    from distributed import as_completed

    return as_completed()


def _result(future: Future[Any], unit: Unit) -> TrialSuccess | TrialFailure:
    """What came back, or that the worker died of it.

    Raises:
        RunError: nothing will come back.
    """
    from distributed import KilledWorker

    if future.status == "finished":
        result: TrialSuccess | TrialFailure = future.result()
        return result
    if future.status != "error":
        raise RunError(f"the Dask scheduler went away, or somebody else cancelled trial {unit.trial}")
    error = future.exception()
    if isinstance(error, KilledWorker):
        return TrialFailure(
            unit, "the worker process died; it may have run out of memory", "", deaths=error.allowed_failures + 1
        )
    return TrialFailure(unit, f"{type(error).__name__}: {error}", "")


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """A client of a cluster of this machine, or of the one at an address."""
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        with _connected(scheduler) as client:
            yield client
        return
    # Report a dead worker at once: _run_on_cluster decides what follows, and reports it, so nothing is logged.
    quiet = {"distributed.scheduler.allowed-failures": 0, "logging": {"distributed": "critical"}}
    with (
        dask.config.set(quiet),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # any free port: the scheduler has one without a dashboard, too
            silence_logs=logging.CRITICAL,
            memory_limit=0,  # Dask would share the memory out evenly, and kill whoever takes more
        ) as cluster,
        Client(cluster) as client,
    ):
        client.register_plugin(_interrupt_shield())
        yield client


@contextlib.contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    from distributed import Client

    try:
        client = Client(scheduler, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ValueError(f"--scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_FIRST_WORKER)
        except TimeoutError:
            raise ValueError(f"--scheduler {scheduler}: it has no workers; start some by: dask worker") from None
        for address, theirs in client.run(code, on_error="return").items():
            if isinstance(theirs, Exception):
                raise ValueError(f"--scheduler {scheduler}: worker {address} cannot import simharness: {theirs}")
            if theirs != code():
                raise ValueError(
                    f"--scheduler {scheduler}: worker {address} runs another version of simharness or mvpose, and "
                    "results would be kept under the wrong one: install this version there"
                )
        yield client


def _interrupt_shield() -> Any:
    """Ctrl-C reaches all processes of a terminal; only this one is to act on it."""
    from distributed import WorkerPlugin

    class Deaf(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            import signal

            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return Deaf()
