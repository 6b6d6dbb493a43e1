"""Map over frames in several processes, with results that do not depend on the number of processes.

:func:`map_frames` cuts frames into chunks that any process may take in any order; :func:`map_jobs` takes the ranges of
frames from its caller, for work that needs its frames in one process.

A new Python process imports for two seconds what a trial needs, and a run with two workers starts two processes in each
of its stages. On Linux workers are therefore forked from a server process that has imported most of it and has done
nothing else. They are never forked from this process, which may hold threads or a GL context.
"""

import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from typing import Any, Protocol, TypeVar

import threadpoolctl

from mvpose.commands.errors import RunError

Result_co = TypeVar("Result_co", covariant=True)
Result = TypeVar("Result")
_Job = tuple[range, *tuple[Any, ...]]  # arguments of a call; the first are its frames
_CHUNKS_PER_WORKER = 8  # many, so that a slow chunk delays little; few, so that sending them costs little

IMPORTED = ("simharness.trial.stages.build_trial", "simharness.trial.stages.simulation", "distributed")
"""Modules that the server imports. With them come neither Polars nor ONNX Runtime, which start threads on import."""


class FrameFunction(Protocol[Result_co]):
    """Function of consecutive frame indices that keeps no state between calls.

    It is pickled once for each worker, so that its data (a model, a sequence) is sent once and not with every chunk. It
    is a frozen dataclass with ``__call__``, or a ``functools.partial`` of a function of a module.
    """

    def __call__(self, frames: range, /) -> Result_co:
        """Return the result of these frames."""
        ...


def map_frames(
    function: FrameFunction[Result],
    frames: range,
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> list[Result]:
    """Call ``function`` on consecutive chunks of ``frames`` and return the results in their order.

    The chunks depend on the number of workers; the joined results must not.

    Args:
        function: see :class:`FrameFunction`.
        frames: consecutive frame indices.
        workers: number of processes; with 1 the work is done in this process. Their linear algebra uses one
            thread.
        progress: called with the number of frames of each finished chunk.

    Raises:
        ValueError: fewer than one worker.
        RunError: the function raised, or a worker died. An error of the function is its cause, unless it is a RunError.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    return map_jobs(function, [(chunk,) for chunk in chunks_of(frames, workers)], workers=workers, progress=progress)


def map_jobs(
    function: Callable[..., Result],
    jobs: Sequence[_Job],
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
    unit: str = "frame",
) -> list[Result]:
    """Call ``function`` with the arguments of each job and return the results in the order of the jobs.

    Args:
        function: as :func:`map_frames`, with more arguments where the jobs have them.
        jobs: arguments of each call; the first are its frames. Long jobs should come first.
        workers: as :func:`map_frames`.
        progress: called with the number of frames of each finished job.
        unit: what the numbers count that stand for frames, for messages.

    Raises:
        ValueError: as :func:`map_frames`.
        RunError: as :func:`map_frames`.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    if workers == 1 or len(jobs) < 2:
        return list(_map_in_process(function, jobs, progress, unit))
    return _map_in_pool(function, jobs, min(workers, len(jobs)), progress, unit)


def chunks_of(frames: range, workers: int) -> list[range]:
    """Return the frames in consecutive chunks, a few for each worker."""
    length = max(1, -(-len(frames) // (workers * _CHUNKS_PER_WORKER)))
    return [frames[start : start + length] for start in range(0, len(frames), length)]


def worker_context() -> BaseContext:
    """Return the multiprocessing context of workers: "forkserver" on Linux, "spawn" where system libraries cannot fork.

    The server keeps the environment variables and the output streams that this process had at the first call.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(IMPORTED))
    forkserver.ensure_running()
    return context


def _map_in_process(
    function: Callable[..., Result], jobs: Sequence[_Job], progress: Callable[[int], None], unit: str
) -> Iterator[Result]:
    with threadpoolctl.threadpool_limits(1):
        for job in jobs:
            try:
                yield function(*job)
            except RunError:
                raise
            except Exception as error:
                raise RunError(_failure(job[0], error, unit)) from error
            progress(len(job[0]))


def _map_in_pool(
    function: Callable[..., Result], jobs: Sequence[_Job], workers: int, progress: Callable[[int], None], unit: str
) -> list[Result]:
    context = worker_context()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_install, initargs=(function,)) as pool:
        futures: dict[Future[Result], range] = {}
        try:
            for job in jobs:
                futures[pool.submit(_call, job)] = job[0]
            for future in as_completed(futures):
                try:
                    future.result()
                except (RunError, BrokenProcessPool):
                    raise
                except Exception as error:
                    raise RunError(_failure(futures[future], error, unit)) from error
                progress(len(futures[future]))
        except BrokenProcessPool as error:
            span = _span(range(min(job[0].start for job in jobs), max(job[0].stop for job in jobs)), unit)
            raise RunError(
                f"a worker process died within {span}; it may have run out of memory: try fewer workers, "
                "or --workers 1 to run in this process"
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return [future.result() for future in futures]


def _failure(chunk: range, error: Exception, unit: str) -> str:
    return f"{_span(chunk, unit)}: {type(error).__name__}: {error}"


def _span(chunk: range, unit: str) -> str:
    return f"{unit} {chunk.start}" if len(chunk) == 1 else f"{unit}s {chunk.start} to {chunk.stop - 1}"


_installed: Callable[..., Any] | None = None  # function of a worker process; None in the parent


def _install(function: Callable[..., Any]) -> None:
    global _installed  # noqa: PLW0603 (state set by the initializer)
    threadpoolctl.threadpool_limits(1)
    _installed = function


def _call(job: _Job) -> Any:
    assert _installed is not None
    return _installed(*job)
