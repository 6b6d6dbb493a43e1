"""Optimisers of rigs at equal processor time: ``python -m benchmarks.planning.optimisers``.

The search of ``simharness plan`` (greedy starts, exchanges, small movements) takes its time; differential evolution and
dual annealing of SciPy then get the same time, on the same value of rigs, over the continuous places, directions and
lenses of all cameras.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import differential_evolution, dual_annealing

from benchmarks.method.report import table
from benchmarks.planning.rooms import draw_room
from mvpose.arrays import Floats
from simharness.planning.candidates import Candidate, candidates_in, far_enough
from simharness.planning.planned_room import Room
from simharness.planning.rig_comparison import fit_value
from simharness.planning.rig_value import RigValue
from simharness.planning.search import CandidateSet, Limits, exchange_search, refine

FIRST_SEED = 2000  # no room of the benchmark of plans
_PARAMETERS = 5  # of a camera: place along all mounts, height, bearing, tilt, lens
_TURN = np.radians(60.0)  # largest angle between a camera's bearing and the middle of the volume
_TILT = np.radians([-55.0, 15.0])


class _TimeIsUp(Exception):
    """End of an optimiser's time."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the optimisers on random rooms."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.optimisers", description=__doc__)
    parser.add_argument("--rooms", type=int, default=3, metavar="N")
    parser.add_argument("--candidates", type=int, default=600, metavar="N")
    parser.add_argument("--starts", type=int, default=3, metavar="N")
    options = parser.parse_args(arguments)
    rows = [["room", "cameras", "seconds", "exchange", "differential evolution", "dual annealing"]]
    for seed in range(FIRST_SEED, FIRST_SEED + options.rooms):
        room = draw_room(seed)
        count = room.keys.cameras.count
        assert count is not None
        candidates = candidates_in(room, most=options.candidates)
        value = fit_value(room, candidates, seed=seed)
        begun = time.process_time()
        best = _exchange(room, value, candidates, count, options.starts, seed)
        seconds = time.process_time() - begun
        others = [_timed(each, room, value, count, seconds, seed) for each in (_evolution, _annealing)]
        figures = [f"{each:.2f}" for each in (best, *others)]
        rows.append([room.name, f"{count}", f"{seconds:.0f}", *figures])
        print(rows[-1], flush=True)
    print(table(rows, "<>>>>>"))
    return 0


def _exchange(
    room: Room, value: RigValue, candidates: Sequence[Candidate], count: int, starts: int, seed: int
) -> float:
    terms = [value.terms(each) for each in candidates]
    sets = exchange_search(value, terms, Limits.of_room(room, candidates, count), starts=starts, seed=seed)
    chosen, found = sets[0]
    start = CandidateSet(tuple(candidates[k] for k in chosen), found)
    return refine(value, room, start, seed=seed, key="benchmark").value


def _timed(optimise: Callable[..., None], room: Room, value: RigValue, count: int, seconds: float, seed: int) -> float:
    """Return the best value that an optimiser finds in some seconds of processor time."""
    best, end = 0.0, time.process_time() + seconds

    def loss(x: Floats) -> float:
        nonlocal best
        if time.process_time() > end:
            raise _TimeIsUp
        rig = [_camera(room, each) for each in x.reshape(count, _PARAMETERS)]
        hung = [each for each in rig if each is not None]
        if len(hung) < count or not far_enough(room, hung):
            return float(count - len(hung))
        found = value.value([value.terms(each) for each in hung])
        best = max(best, found)
        return -found

    with contextlib.suppress(_TimeIsUp):
        optimise(loss, [(0.0, 1.0)] * (_PARAMETERS * count), seed)
    return best


def _evolution(loss: Callable[[Floats], float], bounds: list[tuple[float, float]], seed: int) -> None:
    differential_evolution(loss, bounds, rng=seed, popsize=4, maxiter=10**6, tol=0.0, polish=False)


def _annealing(loss: Callable[[Floats], float], bounds: list[tuple[float, float]], seed: int) -> None:
    dual_annealing(loss, bounds, rng=seed, maxiter=10**6, no_local_search=True)


def _camera(room: Room, x: Floats) -> Candidate | None:
    """Return the camera of parameters (5,) from 0 to 1; None where none may hang."""
    lengths = np.array([mount.lengths[0] for mount in room.mounts])
    ends = np.cumsum(lengths) / lengths.sum()
    index = int(min(np.searchsorted(ends, x[0]), len(ends) - 1))
    start = ends[index] - lengths[index] / lengths.sum()
    mount = room.mounts[index]
    place = mount.at([(x[0] - start) / (ends[index] - start), 0.5, x[1]])
    if not room.may_hang(mount, place):
        return None
    middle = room.volume.outline.mean(axis=0) - place[:2]
    bearing = float(np.arctan2(middle[1], middle[0]) + _TURN * (2 * x[2] - 1))
    lens = int(min(x[4] * len(room.lenses), len(room.lenses) - 1))
    a, b, c = place.tolist()
    return Candidate(index, lens, (a, b, c), bearing, float(_TILT[0] + x[3] * (_TILT[1] - _TILT[0])))


if __name__ == "__main__":
    sys.exit(main())
