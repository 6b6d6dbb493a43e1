"""Limits of a set of cameras: their number, the numbers of each kind of mount, the budget, and their distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from simharness.planning.candidates import Candidate
from simharness.planning.mounts import MountKind
from simharness.planning.planned_room import Room

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
    def of(cls, room: Room, candidates: Sequence[Candidate], count: int | None) -> Limits:
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
