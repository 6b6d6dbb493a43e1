"""Map over frames in several processes, with results that do not depend on the number of processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, TypeVar

import threadpoolctl

from simharness.runtime.errors import RunError

Result_co = TypeVar("Result_co", covariant=True)
Result = TypeVar("Result")

_CHUNKS_PER_WORKER = 8  # many, so that a slow chunk delays little; few, so that sending them costs little


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
        workers: number of processes; with 1 the work is done in this process. Processes are spawned, not forked,
            because the parent may hold threads or a GL context. Their linear algebra uses one thread.
        progress: called with the number of frames of each finished chunk.

    Raises:
        ValueError: fewer than one worker.
        RunError: the function raised, or a worker died. An error of the function is its cause, unless it is a RunError.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    chunks = list(_chunks(frames, workers))
    if workers == 1 or len(chunks) < 2:
        return list(_map_in_process(function, chunks, progress))
    return _map_in_pool(function, chunks, min(workers, len(chunks)), progress)


def _chunks(frames: range, workers: int) -> Iterator[range]:
    length = max(1, -(-len(frames) // (workers * _CHUNKS_PER_WORKER)))
    for start in range(0, len(frames), length):
        yield frames[start : start + length]


def _map_in_process(
    function: FrameFunction[Result], chunks: Sequence[range], progress: Callable[[int], None]
) -> Iterator[Result]:
    with threadpoolctl.threadpool_limits(1):
        for chunk in chunks:
            try:
                yield function(chunk)
            except RunError:
                raise
            except Exception as error:
                raise RunError(_failure(chunk, error)) from error
            progress(len(chunk))


def _map_in_pool(
    function: FrameFunction[Result], chunks: Sequence[range], workers: int, progress: Callable[[int], None]
) -> list[Result]:
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawn, initializer=_install, initargs=(function,)) as pool:
        futures: dict[Future[Result], range] = {}
        try:
            for chunk in chunks:
                futures[pool.submit(_call, chunk)] = chunk
            for future in as_completed(futures):
                future.result()
                progress(len(futures[future]))
        except BrokenProcessPool as error:
            span = _span(range(chunks[0].start, chunks[-1].stop))
            raise RunError(
                f"a worker process died within {span}; it may have run out of memory: try fewer workers, "
                "or --workers 1 to run in this process"
            ) from error
        except RunError:
            raise
        except Exception as error:
            raise RunError(_failure(futures[future], error)) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return [future.result() for future in futures]


def _failure(chunk: range, error: Exception) -> str:
    return f"{_span(chunk)}: {type(error).__name__}: {error}"


def _span(chunk: range) -> str:
    return f"frame {chunk.start}" if len(chunk) == 1 else f"frames {chunk.start} to {chunk.stop - 1}"


_installed: FrameFunction[Any] | None = None  # function of a worker process; None in the parent


def _install(function: FrameFunction[Any]) -> None:
    global _installed  # noqa: PLW0603 (state set by the initializer)
    threadpoolctl.threadpool_limits(1)
    _installed = function


def _call(frames: range) -> Any:
    assert _installed is not None
    return _installed(frames)
