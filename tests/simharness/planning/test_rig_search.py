"""Search for rigs: brute force on small cases, limits, determinism, resumption."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mvpose.arrays import Floats
from simharness.planning.candidates import Candidate, candidates_in, far_enough
from simharness.planning.planned_room import Room
from simharness.planning.room_file import make_room
from simharness.planning.room_keys import RoomKeys
from simharness.planning.search import CandidateSet, Ledger, Limits, exchange_search, refine

SEEDS = range(6)


class Coverage:
    """Value of sets of cameras that each see some points: the share seen by two or more, and a little by one."""

    def terms(self, candidate: Candidate) -> Floats:
        points = np.random.default_rng(5).uniform(-2, 2, (200, 3))
        ways = points - candidate.place
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        return (ways @ candidate.direction > 0.93).astype(float)

    def value(self, terms: Sequence[Floats]) -> float:
        seen = np.sum(terms, axis=0) if len(terms) else np.zeros(1)
        return float((seen >= 2).mean() + 0.1 * (seen >= 1).mean())

    def values_with(self, terms: Sequence[Floats], others: Sequence[Floats]) -> Floats:
        return np.array([self.value([*terms, other]) for other in others])


def small_room(**cameras: Any) -> Room:
    return make_room(
        RoomKeys.model_validate(
            {
                "room": {"size": (6.0, 5.0, 3.0)},
                "volume": {"size": (3.0, 3.0)},
                "lenses": [{"name": "dear", "fov": 80.0, "cost": 3.0}, {"name": "cheap", "fov": 50.0, "cost": 1.0}],
                "cameras": cameras,
            }
        )
    )


def few(room: Room, count: int, seed: int) -> list[Candidate]:
    everyone = candidates_in(room)
    return [everyone[k] for k in np.random.default_rng(seed).choice(len(everyone), count, replace=False)]


def best_of_all(values: Coverage, terms: Sequence[Floats], limits: Limits) -> float:
    """Return the best value of all allowed sets of three."""
    best = -np.inf
    for chosen in itertools.combinations(range(len(terms)), 3):
        if all(limits.next_ones(chosen[:k])[chosen[k]] for k in range(3)):
            best = max(best, values.value([terms[k] for k in chosen]))
    return best


@pytest.mark.parametrize("seed", SEEDS)
def test_search_finds_the_best_of_all_sets(seed: int) -> None:
    room, values = small_room(), Coverage()
    candidates = few(room, 14, seed)
    terms, limits = [values.terms(each) for each in candidates], Limits.of_room(room, candidates, 3)
    found = exchange_search(values, terms, limits, starts=6, seed=seed)
    assert found[0][1] == pytest.approx(best_of_all(values, terms, limits))
    assert found[0][1] == pytest.approx(values.value([terms[k] for k in found[0][0]]))


class Union(Coverage):
    """Value of sets of cameras by the number of points that any of them sees."""

    def value(self, terms: Sequence[Floats]) -> float:
        return float(np.any(terms, axis=0).sum())


def test_exchange_leaves_the_first_choice_of_a_greedy_start() -> None:
    room = small_room(spacing=0.0)
    candidates = few(room, 3, 0)
    terms = [
        np.isin(np.arange(10), seen).astype(float) for seen in ([0, 1, 2, 3, 4, 5], [0, 1, 2, 6, 7], [3, 4, 5, 8, 9])
    ]
    assert exchange_search(Union(), terms, Limits.of_room(room, candidates, 2), starts=1, seed=0) == [((1, 2), 10.0)]


def test_budget_spacing_and_kinds_hold_in_every_set() -> None:
    room, values = small_room(budget=5.0, spacing=1.5), Coverage()
    candidates = few(room, 40, 1)
    terms, limits = [values.terms(each) for each in candidates], Limits.of_room(room, candidates, 3)
    for chosen, _ in exchange_search(values, terms, limits, starts=6, seed=0):
        rig = [candidates[k] for k in chosen]
        assert len(rig) == 3
        assert sum(room.lenses[each.lens].cost for each in rig) <= 5.0
        assert far_enough(room, rig)


def test_budget_without_a_number_buys_as_many_as_it_can() -> None:
    room, values = small_room(budget=4.0), Coverage()
    cheap = [each for each in few(room, 60, 1) if each.lens == 1]
    limits = Limits.of_room(room, cheap, None)
    found = exchange_search(values, [values.terms(each) for each in cheap], limits, starts=2, seed=0)
    assert len(found[0][0]) == 4


def test_least_numbers_of_a_kind_are_kept() -> None:
    room = make_room(
        RoomKeys.model_validate(
            {
                "room": {"size": (6.0, 5.0, 3.0)},
                "volume": {"size": (3.0, 3.0)},
                "places": {"walls": {"heights": (1.0, 2.5)}, "ceiling": {}},
                "cameras": {"ceiling": (2, 2)},
            }
        )
    )
    values, candidates = Coverage(), candidates_in(room, spacing=2.0)
    terms, limits = [values.terms(each) for each in candidates], Limits.of_room(room, candidates, 4)
    for chosen, _ in exchange_search(values, terms, limits, starts=3, seed=0):
        assert [room.mounts[candidates[k].mount].kind for k in chosen].count("ceiling") == 2


def test_refinement_never_loses_and_keeps_to_the_places() -> None:
    room, values = small_room(), Coverage()
    start = tuple(few(room, 3, 2))
    before = values.value([values.terms(each) for each in start])
    after = refine(values, room, CandidateSet(start, before), seed=0, key="test")
    assert after.value > before
    assert after.value == pytest.approx(values.value([values.terms(each) for each in after.candidates]))
    assert all(room.may_hang(room.mounts[each.mount], np.array(each.place)) for each in after.candidates)
    assert refine(values, room, CandidateSet(start, before), seed=0, key="test") == after


class Interrupted(Coverage):
    """Value that fails after some calls, as an interruption does."""

    def __init__(self, calls: int) -> None:
        self.calls = calls

    def values_with(self, terms: Sequence[Floats], others: Sequence[Floats]) -> Floats:
        self.calls -= 1
        if self.calls < 0:
            raise KeyboardInterrupt
        return super().values_with(terms, others)


def test_interrupted_search_goes_on_and_gives_the_same(tmp_path: Path) -> None:
    room = small_room()
    candidates = few(room, 12, 4)
    terms, limits = [Coverage().terms(each) for each in candidates], Limits.of_room(room, candidates, 3)
    whole = exchange_search(Coverage(), terms, limits, starts=4, seed=9)
    path = tmp_path / "search.json"
    with pytest.raises(KeyboardInterrupt):
        exchange_search(Interrupted(20), terms, limits, starts=4, seed=9, ledger=Ledger(path, "a"))
    kept = Ledger(path, "a")
    assert "start 3 0" in kept
    assert "start 3 3" not in kept
    counting = Interrupted(10_000)
    assert exchange_search(counting, terms, limits, starts=4, seed=9, ledger=kept) == whole
    fresh = Interrupted(10_000)
    exchange_search(fresh, terms, limits, starts=4, seed=9)
    assert counting.calls > fresh.calls, "finished starts are not computed again"
    assert "start 3 0" not in Ledger(path, "b"), "another identity begins anew"


def test_damaged_ledger_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "search.json"
    path.write_text("{", encoding="utf-8")
    assert Ledger(path, "a").result("x", lambda: 1) == 1
    assert "x" in Ledger(path, "a")
