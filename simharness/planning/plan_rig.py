"""Plan of a rig: the best places for N cameras in a room, judged by the fast layer and confirmed by simulation.

1. Candidates: cameras on a grid of places that look at points of the volume (:mod:`.candidates`).
2. Search: greedy starts and exchanges (:mod:`.search`), with a value that costs tenths of a millisecond
   (:mod:`.rig_value`); then small movements of the cameras of the best sets.
3. Judgement: the fast layer runs the method on the best sets, on scenes that the search has not seen.
4. Confirmation: the best of them are simulated on the same scenes, beside the rigs that people hang without a plan.
"""

import hashlib
import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import Rig
from mvpose.arrays import Floats
from mvpose.commands.progress import Reporter, Silence, counted
from simharness.planning.candidates import Candidate, alike, around, candidates_in
from simharness.planning.fast_layer import FastLayer, Prediction
from simharness.planning.forecast_error import ForecastErrors
from simharness.planning.plan_result import Alternative, CurvePoint, Figures, PlannedCamera, RigPlan
from simharness.planning.planned_room import Room
from simharness.planning.rig_comparison import VARIANT, corner_rig, fit_value, layer_of, rig_of, ring_rig, simulate_rigs
from simharness.planning.rig_value import ERROR, RigValue
from simharness.planning.room_file import read_room
from simharness.planning.search import CandidateSet, Ledger, Limits, exchange_search, refine
from simharness.planning.simulated_scenes import interval_of
from simharness.runtime.version import code_version

_CURVE_STARTS = 2  # of the searches for other numbers of cameras
_REFINED = 2  # sets that are refined, judged and simulated
_JUDGED_PLACES, _JUDGED_REPEATS = 60, 8
_NEAR_BEST = 1.0  # points of the objective within which a set is as good as the best
_PREVIEW_SHARE = 1e-3  # of seen joints: less is nothing


@dataclass(frozen=True)
class PlanEffort:
    """How much is searched and simulated."""

    scenes: int = 8
    """Simulated scenes that confirm the plan; 0: none."""
    starts: int = 6
    """Greedy starts of the search."""
    curve: tuple[int, ...] = (-2, -1, 0, 1, 2)
    """Numbers of cameras beyond the requested one for which the curve is computed."""
    candidates: int = 1200
    """Largest number of cameras from which the search chooses."""
    workers: int = 1
    """Processes of the simulation; the results do not depend on it."""


def plan_rig(
    room: Room | Path | str,
    cameras: int | None = None,
    *,
    lenses: Sequence[str] = (),
    effort: PlanEffort | None = None,
    seed: int = 0,
    folder: Path | None = None,
    reporter: Reporter | None = None,
) -> RigPlan:
    """Plan where cameras should hang.

    Args:
        room: a room, or its file.
        cameras: number of cameras, those that hang already included; by default that of the room file, or as many as
            its budget buys.
        lenses: names of the lenses to choose from; all by default.
        effort: how much is searched and simulated.
        seed: seed of all draws.
        folder: folder in which finished steps are kept, so that an interrupted plan goes on; None: nowhere.
        reporter: receiver of progress.

    Raises:
        ValueError: an impossible room or number of cameras, no place to hang, or nobody visible; the message names the
            keys.
    """
    room = read_room(room) if isinstance(room, str | Path) else room
    room = room.with_lenses(tuple(lenses)) if lenses else room
    count = _count(room, cameras)
    work = _Work(room, count, effort or PlanEffort(), seed=seed, folder=folder, reporter=reporter or Silence())
    return work.plan()


def _count(room: Room, cameras: int | None) -> int | None:
    """Return the number of cameras of a plan; None: as many as the budget buys.

    Raises:
        ValueError: fewer than two, or fewer than hang already.
    """
    keys, where = room.keys.cameras, room.file or room.name
    count, key = (cameras, "--cameras") if cameras is not None else (keys.count, "cameras.count")
    if count is None:
        return None
    if count < 2:
        raise ValueError(f"{where}: {key} = {count}: one camera gives no positions in space; expected at least 2")
    if count <= len(room.fixed):
        raise ValueError(
            f"{where}: {key} = {count}: {len(room.fixed)} cameras hang already ([[fixed]]); expected a larger number"
        )
    return count


class _Work:
    """Steps of a plan; the result of each is kept in the ledger."""

    def __init__(
        self, room: Room, count: int | None, effort: PlanEffort, *, seed: int, folder: Path | None, reporter: Reporter
    ) -> None:
        self.room, self.count, self.effort, self.seed, self.reporter = room, count, effort, seed, reporter
        self.candidates = candidates_in(room, most=effort.candidates)
        self.limits = Limits.of_room(room, self.candidates, count)
        path = None if folder is None else folder / "search.json"
        self.ledger = Ledger(path, _identity(room, seed, effort.candidates))
        self.seconds: dict[str, float] = {}

    def plan(self) -> RigPlan:
        """Return the plan."""
        with self._timed("search"):
            sets = self._search(self.limits, self.effort.starts, "search")
            near = [each for each in sets if each.value >= sets[0].value - _NEAR_BEST]
            refined = self._refined(sets)
        with self._timed("curve"):
            curve = self._curve(sets[0])
        with self._timed("judge"):
            judged = self._judged(refined)
            usual = self._usual(len(refined[0].candidates))
        with self._timed("simulate"):
            alternatives, best = self._confirmed(judged, usual)
        names = [camera.name for camera in alternatives[0].rig]
        prediction, worth = self._worth(best)
        return RigPlan(
            room=self.room,
            rig=alternatives[0].rig,
            cameras=self._cameras(names, best, near, worth),
            alternatives=alternatives,
            prediction=prediction,
            curve=curve,
            near_best=len(near),
            candidates=len(self.candidates),
            simulated_scenes=self.effort.scenes,
            seed=self.seed,
            seconds=self.seconds,
        )

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start

    @cached_property
    def value(self) -> RigValue:
        """Value of sets of cameras."""
        return fit_value(self.room, self.candidates, seed=self.seed)

    @cached_property
    def fixed_terms(self) -> list[Floats]:
        """Contributions of the cameras that hang already."""
        return [self.value.terms_of(camera) for camera in self.room.fixed]

    @cached_property
    def terms(self) -> list[Floats]:
        """Contributions of the candidates, computed when a step first needs them.

        Raises:
            ValueError: no candidate sees anybody.
        """
        value = self.value
        with self.reporter.stage("cameras", len(self.candidates)) as advance:
            terms = [value.terms(each) for each in counted(self.candidates, advance)]
        if max(float(each[..., 4].mean()) for each in terms) < _PREVIEW_SHARE:
            raise ValueError(
                f"{self.room.file or self.room.name}: no camera at any place sees anybody in the volume: obstacles "
                "hide it, or it is out of view; change obstacles, places, volume, or lenses"
            )
        return terms

    def _search(self, limits: Limits, starts: int, title: str) -> list[CandidateSet]:
        names = [f"start {limits.count} {k}" for k in range(starts)]
        terms = self.terms if any(name not in self.ledger for name in names) else []
        with self.reporter.stage(title, starts) as advance:
            found = exchange_search(
                self.value if terms else _Unused(), terms, limits, starts=starts, seed=self.seed,
                fixed=self.fixed_terms if terms else (), ledger=self.ledger, advance=advance,
            )  # fmt: skip
        if not found:
            raise ValueError(
                f"{self.room.file or self.room.name}: no camera can be placed: cameras.spacing, budget and the numbers "
                "of each kind leave no candidate; change them"
            )
        wanted = limits.count
        if wanted is not None and len(found[0][0]) < wanted:
            raise ValueError(
                f"{self.room.file or self.room.name}: only {len(found[0][0])} of {wanted} cameras find a place "
                f"{self.room.keys.cameras.spacing:g} m from each other: lower cameras.spacing, or give more places"
            )
        return [CandidateSet(tuple(self.candidates[k] for k in chosen), value) for chosen, value in found]

    def _refined(self, sets: Sequence[CandidateSet]) -> list[CandidateSet]:
        best = sets[:_REFINED]
        results = []
        with self.reporter.stage("refine", len(best)) as advance:
            for k, each in enumerate(counted(best, advance)):
                key = f"refined {self.count} {self.effort.starts} {k}"

                def work(each: CandidateSet = each, key: str = key) -> Any:
                    fixed = self.fixed_terms
                    found = refine(self.value, self.room, each, seed=self.seed, key=key, fixed=fixed)
                    return [[astuple(camera) for camera in found.candidates], found.value]

                cameras, value = self.ledger.result(key, work)
                chosen = tuple(Candidate(c[0], c[1], (c[2][0], c[2][1], c[2][2]), c[3], c[4]) for c in cameras)
                results.append(CandidateSet(around(self.room, chosen), value))
        return results

    def _curve(self, best: CandidateSet) -> tuple[CurvePoint, ...]:
        fixed, now = len(self.room.fixed), len(best.candidates)
        points = []
        for offset in sorted(set(self.effort.curve)):
            free = now + offset
            if free < max(1, 2 - fixed) or free > len(self.candidates):
                continue
            name = f"curve {self.count} {self.effort.starts} {free}"
            if name not in self.ledger and offset:
                try:
                    limits = Limits.of_room(self.room, self.candidates, free + fixed)
                    sets = self._search(limits, _CURVE_STARTS, f"{free + fixed} cameras")
                except ValueError:
                    continue  # the limits of the room do not allow so many
            elif offset == 0:
                sets = [best]
            else:
                sets = []
            figures, cost = self.ledger.result(name, partial(self._curve_point, sets[0] if sets else best))
            points.append(CurvePoint(free + fixed, Figures.of_row(figures), cost))
        return tuple(points)

    def _curve_point(self, found: CandidateSet) -> tuple[Any, float]:
        cost = sum(self.room.lenses[each.lens].cost for each in found.candidates)
        return self._figures_of(self._rig(found.candidates)), cost

    @cached_property
    def layer(self) -> FastLayer:
        """Fast layer on scenes that the search has not seen."""
        return layer_of(self.room, places=_JUDGED_PLACES, repeats=_JUDGED_REPEATS, seed=self.seed + 1)

    def _figures_of(self, rig: Rig) -> tuple[Any, ...]:
        """Return the figures of a rig by the fast layer, as values for the ledger."""
        prediction = self.layer.predict([self.layer.terms(camera) for camera in rig], variant=VARIANT)
        return astuple(Figures.of_prediction(prediction, self.room.keys.target))

    def _judged(self, refined: Sequence[CandidateSet]) -> list[tuple[CandidateSet, Figures]]:
        """Return the refined sets with their figures by the fast layer, best first."""
        results = []
        for k, each in enumerate(refined):
            figures = self.ledger.result(
                f"judged {self.count} {self.effort.starts} {k}", partial(self._figures_of, self._rig(each.candidates))
            )
            results.append((each, Figures.of_row(figures)))
        return sorted(results, key=lambda pair: -self._objective(pair[1]))

    def _objective(self, figures: Figures) -> float:
        """Return the objective of the room by figures; ties are broken by the mean PCP and the error."""
        kind = self.room.keys.objective.kind
        main = {"mean": 0.0, "share": figures.share, "worst": figures.worst}[kind]
        off = ERROR * min(figures.error_mm.mean / self.room.keys.target.error, 1.0)
        return main + (1.0 if kind == "mean" else 1e-3) * figures.pcp.mean - off

    def _usual(self, free: int) -> list[tuple[str, Rig, Figures]]:
        """Return the rigs that people hang without a plan, with their figures by the fast layer."""
        results = []
        for title, make in (("corners", corner_rig), ("ring", ring_rig)):
            try:
                rig = self._rig(make(self.room, free))
            except ValueError:
                continue
            figures = self.ledger.result(f"{title} {free}", partial(self._figures_of, rig))
            results.append((title, rig, Figures.of_row(figures)))
        return results

    def _confirmed(
        self, judged: Sequence[tuple[CandidateSet, Figures]], usual: Sequence[tuple[str, Rig, Figures]]
    ) -> tuple[tuple[Alternative, ...], CandidateSet]:
        """Return the compared rigs, the plan first, and the set of the plan."""
        titles = ("plan", "second", "third", *(f"{k}th" for k in range(4, 4 + len(judged))))
        rigs = [self._rig(found.candidates) for found, _ in judged] + [rig for _, rig, _ in usual]
        predicted = [figures for _, figures in judged] + [figures for _, _, figures in usual]
        simulated: list[Figures | None] = [None] * len(rigs)
        order = list(range(len(judged)))
        if self.effort.scenes:
            simulated = list(self._simulated(rigs))
            # The simulation chooses among the best few, by its mean PCP.
            order.sort(key=lambda k: -(simulated[k] or predicted[k]).pcp.mean)
        names = list(titles[: len(judged)]) + [title for title, _, _ in usual]
        order += range(len(judged), len(rigs))
        alternatives = tuple(Alternative(names[n], rigs[k], predicted[k], simulated[k]) for n, k in enumerate(order))
        return alternatives, judged[order[0]][0]

    def _simulated(self, rigs: Sequence[Rig]) -> list[Figures]:
        key = hashlib.blake2b(
            b"".join(each.K.tobytes() + each.R.tobytes() + each.t.tobytes() for rig in rigs for each in rig),
            digest_size=8,
        ).hexdigest()

        def work() -> Any:
            results, conditions = simulate_rigs(
                self.room,
                rigs,
                seeds=range(self.effort.scenes),
                seed=self.seed,
                workers=self.effort.workers,
                reporter=self.reporter,
            )
            errors = ForecastErrors.of_detector(self.room.detector)
            of_pcp = [errors.of_pcp(interval_of(results, each, "pcp")) for each in conditions]
            of_mm = [errors.of_mm(interval_of(results, each, "mpjpe_mm")) for each in conditions]
            return [astuple(Figures(*both)) for both in zip(of_pcp, of_mm, strict=True)]

        found = self.ledger.result(f"simulated {self.effort.scenes} {key}", work)
        return [Figures.of_row(row) for row in found]

    def _worth(self, best: CandidateSet) -> tuple[Prediction, list[float]]:
        """Return the maps of the plan, and the loss of PCP without each of its cameras."""
        terms = [self.layer.terms(camera) for camera in self._rig(best.candidates)]
        whole = self.layer.predict(terms, variant=VARIANT)
        pcp = float(np.nanmean(whole.person_pcp))
        if len(terms) < 3:
            return whole, [pcp] * len(terms)
        return whole, [
            pcp - float(np.nanmean(self.layer.predict([*terms[:k], *terms[k + 1 :]], variant=VARIANT).person_pcp))
            for k in range(len(terms))
        ]

    def _cameras(
        self, names: Sequence[str], best: CandidateSet, near: Sequence[CandidateSet], worth: Sequence[float]
    ) -> tuple[PlannedCamera, ...]:
        fixed = len(self.room.fixed)
        cameras = [
            PlannedCamera(name, None, "fixed", "", float("nan"), worth[k]) for k, name in enumerate(names[:fixed])
        ]
        for k, each in enumerate(best.candidates):
            sure = float(np.mean([any(alike(each, other) for other in found.candidates) for found in near]))
            mount = self.room.mounts[each.mount].name
            lens = self.room.lenses[each.lens]
            title = f"{lens.name}, turned" if lens.turned else lens.name
            cameras.append(PlannedCamera(names[fixed + k], each, mount, title, sure, worth[fixed + k]))
        return tuple(cameras)

    def _rig(self, candidates: Sequence[Candidate]) -> Rig:
        return rig_of(self.room, candidates)


class _Unused:
    """Value of a search all of whose steps are kept already."""

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"{name}: every step is in the ledger")


def _identity(room: Room, seed: int, most: int) -> str:
    """Return a text that changes with everything on which finished steps depend."""
    lenses = [(lens.name, lens.turned) for lens in room.lenses]
    values = [room.keys.model_dump(mode="json"), room.detector.model_dump(mode="json"), lenses, seed, most]
    return hashlib.blake2b(json.dumps([*values, code_version()], sort_keys=True).encode(), digest_size=16).hexdigest()
