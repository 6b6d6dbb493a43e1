"""Search for the best set of cameras: greedy starts, exchanges of single cameras, then small movements of each.

Greedy selection is within 1 - 1/e of the best set for coverage (Nemhauser, Wolsey and Fisher, Mathematical
Programming 1978); exchanges of single members (Fedorov's algorithm for designs of experiments, 1972) remove most of
what it loses, and several randomised starts the rest. ``benchmarks/planning/optimisers.py`` compares it with
differential evolution and dual annealing at equal time.

Every start and every refinement draws from its own stream and is a step of a :class:`Ledger`, so that the
result depends on the seed alone and an interrupted search goes on.

Sets keep to limits: the number of cameras, the numbers of each kind of mount, the budget, and their distances.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_json_object
from simharness.planning.candidates import Candidate, far_enough, moved
from simharness.planning.planned_room import MountKind, Room
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
            if self._path is not None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(self._path, json.dumps({"identity": self._identity, "steps": self._steps}).encode())
        return self._steps[name]


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
    limits: "Limits",
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
    values: Value[Terms], terms: Sequence[Terms], limits: "Limits", start: int, seed: int, fixed: Sequence[Terms]
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
    limits: "Limits",
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


_KINDS: tuple[MountKind, ...] = ("wall", "ceiling", "tripod")
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Limits:
    """What sets of candidates are allowed.

    Attributes:
        count: number of candidates of a full set; None: as many as the budget buys.
        places: position of each candidate, (C, 3), metres.
        kinds: index of the kind of each candidate's mount, (C,): wall, ceiling, tripod.
        costs: cost of each candidate, (C,).
        fixed: positions of cameras that hang already, (F, 3), metres.
        least, most: numbers allowed of each kind, (3,).
        budget: largest sum of costs.
        spacing: smallest distance between two cameras, metres.
    """

    count: int | None
    places: Floats
    kinds: Integers
    costs: Floats
    fixed: Floats
    least: Integers
    most: Integers
    budget: float
    spacing: float

    @classmethod
    def of_room(cls, room: Room, candidates: Sequence[Candidate], count: int | None) -> "Limits":
        """Return the limits of a room.

        Args:
            room: the room.
            candidates: the candidates, C.
            count: number of cameras, fixed ones included; None: as many as the budget buys.

        Raises:
            ValueError: limits that no set fulfils; the message names the keys.
        """
        keys, where = room.keys.cameras, room.file or room.name
        ranges = np.array([keys.wall, keys.ceiling, keys.tripod])
        kinds = np.array([_KINDS.index(room.mounts[each.mount].kind) for each in candidates], np.int64)
        budget = np.inf if keys.budget is None else keys.budget
        cheapest = min(lens.cost for lens in room.lenses)
        for kind, (least, most) in zip(_KINDS, ranges, strict=True):
            if least > most:
                raise ValueError(f"{where}: cameras.{kind} = [{least}, {most}]: expected [least, most]")
            if least and kind not in {mount.kind for mount in room.mounts}:
                raise ValueError(
                    f"{where}: cameras.{kind} asks for {least} or more, but [places] has none of this kind"
                )
        if count is None and not np.isfinite(budget):
            raise ValueError(f"{where}: the number of cameras is missing: give --cameras N, cameras.count, or a budget")
        if count is None and cheapest == 0:
            raise ValueError(f"{where}: a lens costs nothing, so the budget buys any number: give --cameras N")
        free = None if count is None else count - len(room.fixed)
        present = np.bincount(kinds, minlength=3) > 0
        if free is not None and int(ranges[present, 1].sum()) < free:
            raise ValueError(
                f"{where}: {free} cameras are to be placed, but cameras.wall, ceiling and tripod allow at most "
                f"{int(ranges[present, 1].sum())} on the places that there are: raise them"
            )
        if free is not None and int(ranges[:, 0].sum()) > free:
            raise ValueError(
                f"{where}: cameras.wall, ceiling and tripod ask for {int(ranges[:, 0].sum())} cameras or more, but "
                f"only {free} are to be placed: lower them, or give a larger --cameras"
            )
        needed = cheapest * (free if free is not None else 2 - len(room.fixed))
        if needed > budget + _ROUNDING:
            raise ValueError(
                f"{where}: cameras.budget = {budget:g} does not buy {free or 2} cameras of {cheapest:g} or more each: "
                "raise it, or plan fewer cameras"
            )
        return cls(
            count=free,
            places=np.array([each.place for each in candidates]).reshape(-1, 3),
            kinds=kinds,
            costs=np.array([room.lenses[each.lens].cost for each in candidates], float),
            fixed=np.array([camera.center for camera in room.fixed]).reshape(-1, 3),
            least=ranges[:, 0],
            most=ranges[:, 1],
            budget=float(budget),
            spacing=keys.spacing,
        )

    def next_ones(self, chosen: Sequence[int]) -> Bools:
        """Return which candidates may be added to a set such that a full set remains possible, (C,)."""
        allowed = np.ones(len(self.places), bool)
        taken = np.array(list(chosen), np.int64)
        numbers = np.bincount(self.kinds[taken], minlength=3)
        allowed &= (numbers < self.most)[self.kinds]
        left = self.budget - self.costs[taken].sum()
        if self.count is not None:
            remaining = self.count - len(taken)
            if remaining <= 0:
                return np.zeros(len(self.places), bool)
            lacking = np.maximum(self.least - numbers, 0)
            if lacking.sum() >= remaining:
                allowed &= (lacking > 0)[self.kinds]
            left -= (remaining - 1) * self.costs.min(initial=0.0)
        allowed &= self.costs <= left + _ROUNDING
        for place in (*self.fixed, *self.places[taken]):
            allowed &= np.linalg.norm(self.places - place, axis=1) >= self.spacing - _ROUNDING
        allowed[taken] = False
        return allowed
