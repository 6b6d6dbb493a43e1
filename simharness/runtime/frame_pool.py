"""Frames shared out among processes: the same results in the same order, whatever the number of workers."""

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

_CHUNKS_PER_WORKER = 8  # enough for the slowest chunk not to hold the others up, few enough to send cheaply


class FrameFunction(Protocol[Result_co]):
    """What can be mapped over frames: gets consecutive frame indices, keeps nothing between calls.

    It is pickled once for each worker, so what it carries (a model, a sequence) travels once and not with
    every chunk: a frozen dataclass with ``__call__`` or a ``functools.partial`` of a module's function.
    """

    def __call__(self, frames: range, /) -> Result_co:
        """The result of these frames."""
        ...


def map_frames(
    function: FrameFunction[Result],
    frames: range,
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> list[Result]:
    """Call ``function`` on consecutive chunks of ``frames`` and return the results in their order.

    Where chunks begin and end depends on the number of workers; what they add up to must not.

    Args:
        function: see :class:`FrameFunction`.
        frames: consecutive frame indices.
        workers: processes; 1 works in this one. They are spawned, not forked, for the parent may hold threads
            or a GL context, and their linear algebra keeps to one thread.
        progress: called with the number of frames of each chunk that is done.

    Raises:
        ValueError: fewer than one worker.
        RunError: the function raised, or a worker died. The function's own error is its cause, if it is no RunError.
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
                "or --workers 1 to see it happen in this process"
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


_installed: FrameFunction[Any] | None = None  # of a worker process; None in the parent


def _install(function: FrameFunction[Any]) -> None:
    global _installed  # noqa: PLW0603 (how an initializer hands over state)
    threadpoolctl.threadpool_limits(1)
    _installed = function


def _call(frames: range) -> Any:
    assert _installed is not None
    return _installed(frames)
