"""Search for the best set of cameras: greedy starts, exchanges of single cameras, then small movements of each.

Greedy selection is within 1 - 1/e of the best set for coverage (Nemhauser, Wolsey and Fisher, Mathematical
Programming 1978); exchanges of single members (Fedorov's algorithm for designs of experiments, 1972) remove most of
what it loses, and several randomised starts the rest. ``benchmarks/planning/optimisers.py`` compares it with
differential evolution and dual annealing at equal time.

Every start and every refinement draws from its own stream and is a step of a :class:`Ledger`, so that the
result depends on the seed alone and an interrupted search goes on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_json_object
from simharness.planning.candidates import Candidate, far_enough, moved
from simharness.planning.limits import Limits
from simharness.planning.planned_room import Room
from simharness.types.random_streams import stream

Terms = TypeVar("Terms")
_PASSES = 6  # exchanges of each camera, at most
_GAIN = 1e-9  # smaller gains are rounding
_SHARE = 0.5  # of the candidates, drawn for each step of all greedy starts but the first
_STEPS = (  # metres along the edges of the mount, then degrees of bearing and tilt: coarse to fine
    (0.6, 0.6, 0.4, 12.0, 8.0),
    (0.25, 0.25, 0.2, 5.0, 4.0),
    (0.1, 0.1, 0.1, 2.0, 2.0),
)
_DRAWS = 8  # random movements of each camera at each scale


class Ledger:
    """Results of finished steps by name: JSON values, written to a file whenever one more is finished.

    Args:
        path: the file; None: nothing is kept.
        identity: text that changes with everything that determines the results. A file of another identity, or one
            that cannot be read, is begun anew.
    """

    def __init__(self, path: Path | None, identity: str) -> None:
        self._path = path
        self._identity = identity
        self._steps: dict[str, Any] = {}
        if path is not None and path.is_file():
            try:
                kept = read_json_object(path, what="finished steps of a search")
                if kept["identity"] == identity:
                    self._steps = dict(kept["steps"])
            except (ValueError, KeyError, TypeError, OSError):
                self._steps = {}

    def __contains__(self, name: str) -> bool:
        return name in self._steps

    def result(self, name: str, work: Callable[[], Any]) -> Any:
        """Return the result of a step: the kept one, or that of ``work``, which is kept from then on.

        The result is that of a round trip through JSON in both cases, so that an interrupted run gives the same.
        """
        if name not in self._steps:
            self._steps[name] = json.loads(json.dumps(work()))
            self._write()
        return self._steps[name]

    def _write(self) -> None:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(self._path, json.dumps({"identity": self._identity, "steps": self._steps}).encode())


class Value(Protocol[Terms]):
    """Value of sets of cameras: larger is better."""

    def terms(self, candidate: Candidate) -> Terms:
        """Return what a camera contributes, which is computed once."""
        ...

    def value(self, terms: Sequence[Terms]) -> float:
        """Return the value of a set."""
        ...

    def values_with(self, terms: Sequence[Terms], others: Sequence[Terms]) -> Floats:
        """Return the value of a set with each of other cameras added, (n,)."""
        ...


@dataclass(frozen=True)
class CandidateSet:
    """Set of cameras with its value."""

    candidates: tuple[Candidate, ...]
    value: float


def exchange_search(
    values: Value[Terms],
    terms: Sequence[Terms],
    limits: Limits,
    *,
    starts: int,
    seed: int,
    fixed: Sequence[Terms] = (),
    ledger: Ledger | None = None,
    advance: Callable[[int], Any] = lambda steps: None,
) -> list[tuple[tuple[int, ...], float]]:
    """Return sets of candidates that no exchange of a single one improves, best first.

    Args:
        values: value of sets.
        terms: contribution of each candidate, C.
        limits: allowed sets.
        starts: number of greedy starts; the first looks at all candidates, the others at random halves.
        seed: seed of the draws.
        fixed: contributions of cameras that are in every set.
        ledger: finished steps.
        advance: report of finished starts.
    """
    ledger = ledger or Ledger(None, "")
    found: dict[tuple[int, ...], float] = {}
    for start in range(starts):
        name = f"start {limits.count} {start}"
        chosen, value = ledger.result(name, partial(_start, values, terms, limits, start, seed, fixed))
        if chosen:
            found[tuple(chosen)] = value
        advance(1)
    return sorted(found.items(), key=lambda each: (-each[1], each[0]))


def refine(
    values: Value[Terms],
    room: Room,
    found: CandidateSet,
    *,
    seed: int,
    key: str,
    fixed: Sequence[Terms] = (),
    steps: Sequence[Sequence[float]] = _STEPS,
) -> CandidateSet:
    """Return a set of cameras whose places and directions are improved by small movements of one camera at a time.

    Each camera tries both directions of each parameter and some random movements, from large to small ones, and takes
    each movement that improves the set.

    Args:
        values: value of sets.
        room: the room.
        found: set to start from.
        seed: seed of the draws.
        key: name of the stream of draws.
        fixed: contributions of the cameras that hang already.
        steps: sizes of the movements, three in metres and two in degrees each.
    """
    rng = stream(seed, "plan", "refine", key)
    cameras = list(found.candidates)
    terms = [values.terms(each) for each in cameras]
    best = found.value
    for sizes in steps:
        scale = np.array([*sizes[:3], *np.radians(sizes[3:])])
        for slot in range(len(cameras)):
            draws = rng.standard_normal((_DRAWS, 5))
            others = [*fixed, *terms[:slot], *terms[slot + 1 :]]
            for step in np.vstack([np.eye(5), -np.eye(5), draws]) * scale:
                # A step that succeeds is taken again, as long as it improves the set.
                while (changed := moved(room, cameras[slot], step)) is not None:
                    if not far_enough(room, [*cameras[:slot], changed, *cameras[slot + 1 :]], room.fixed):
                        break
                    trial = values.terms(changed)
                    value = values.value([*others, trial])
                    if value <= best + _GAIN:
                        break
                    cameras[slot], terms[slot], best = changed, trial, value
    return CandidateSet(tuple(cameras), float(best))


def _start(
    values: Value[Terms], terms: Sequence[Terms], limits: Limits, start: int, seed: int, fixed: Sequence[Terms]
) -> tuple[list[int], float]:
    rng = stream(seed, "plan", "start", start)
    chosen: list[int] = []
    while (allowed := limits.next_ones(chosen)).any():
        pool = np.flatnonzero(allowed)
        if start:
            pool = rng.permutation(pool)[: max(1, int(np.ceil(_SHARE * len(pool))))]
        gains = values.values_with([*fixed, *(terms[k] for k in chosen)], [terms[int(k)] for k in pool])
        chosen.append(int(pool[int(np.argmax(gains))]))
    return _exchanged(values, terms, limits, chosen, rng, fixed)


def _exchanged(
    values: Value[Terms],
    terms: Sequence[Terms],
    limits: Limits,
    chosen: list[int],
    rng: np.random.Generator,
    fixed: Sequence[Terms],
) -> tuple[list[int], float]:
    """Exchange single candidates until no exchange improves the set; return it in increasing order."""
    best = values.value([*fixed, *(terms[k] for k in chosen)])
    unchanged = 0
    order = rng.permutation(len(chosen)).tolist()
    for turn in range(_PASSES * len(chosen)):
        if unchanged == len(chosen):
            break
        slot = order[turn % len(chosen)]
        rest = chosen[:slot] + chosen[slot + 1 :]
        pool = np.flatnonzero(limits.next_ones(rest))
        pool = pool[pool != chosen[slot]]
        unchanged += 1
        if not len(pool):
            continue
        gained = values.values_with([*fixed, *(terms[k] for k in rest)], [terms[k] for k in pool])
        top = int(np.argmax(gained))
        if gained[top] > best + _GAIN:
            chosen[slot], best, unchanged = int(pool[top]), float(gained[top]), 0
    return sorted(chosen), float(best)
