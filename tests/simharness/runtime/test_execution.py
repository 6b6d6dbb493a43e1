"""Map over frames in several processes."""

import itertools
import os
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
import threadpoolctl

from mvpose.commands.errors import RunError
from simharness.runtime.frame_pool import map_frames


def square(frames: range) -> list[int]:
    return [frame**2 for frame in frames]


@dataclass(frozen=True)
class Scaled:
    """Frame function with static state that is pickled for the workers."""

    factors: np.ndarray

    def __call__(self, frames: range) -> np.ndarray:
        return self.factors[frames.start : frames.stop] * 2


def fail_at(bad: int, frames: range) -> int:
    if bad in frames:
        raise KeyError("planted")
    return len(frames)


def die_at(bad: int, frames: range) -> int:
    if bad in frames:
        os._exit(11)
    return len(frames)


def threads(frames: range) -> list[int]:
    np.linalg.eigh(np.eye(3))
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_chunks_cover_the_frames_in_order(count):
    chunks = map_frames(square, range(count))
    assert list(itertools.chain(*chunks)) == [frame**2 for frame in range(count)]


def test_no_frames_give_no_results():
    assert map_frames(square, range(0)) == []


def test_frames_need_not_begin_at_zero():
    assert list(itertools.chain(*map_frames(square, range(300, 310)))) == [frame**2 for frame in range(300, 310)]


def test_progress_counts_every_frame_once():
    seen = []
    map_frames(square, range(23), progress=seen.append)
    assert sum(seen) == 23


@pytest.mark.slow
def test_two_workers_give_the_results_of_one():
    function = Scaled(np.random.default_rng(0).normal(size=(23, 5)))
    seen = []
    shared = map_frames(function, range(23), workers=2, progress=seen.append)
    assert sum(seen) == 23
    np.testing.assert_array_equal(np.concatenate(shared), np.concatenate(map_frames(function, range(23))))


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_ends_the_run_and_names_the_frames(workers):
    with pytest.raises(RunError, match=r"frame.* KeyError: 'planted'") as caught:
        map_frames(partial(fail_at, 7), range(20), workers=workers)
    assert isinstance(caught.value.__cause__, KeyError)


def test_a_dead_worker_ends_the_run_and_does_not_hang():
    with pytest.raises(RunError, match="worker process died"):
        map_frames(partial(die_at, 7), range(20), workers=2)


@pytest.mark.parametrize("workers", [1, 2])
def test_linear_algebra_uses_one_thread(workers):
    for pools in map_frames(threads, range(4), workers=workers):
        assert pools
        assert set(pools) == {1}


def test_a_function_that_cannot_be_sent_to_workers_is_named():
    with pytest.raises(Exception, match="pickle"):
        map_frames(lambda frames: [*frames], range(4), workers=2)


def test_fewer_than_one_worker_is_refused():
    with pytest.raises(ValueError, match="workers must be at least 1, got 0"):
        map_frames(square, range(3), workers=0)
