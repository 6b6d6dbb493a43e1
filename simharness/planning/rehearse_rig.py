"""Rehearsal of a rig: the fast layer for maps and comparisons, then scenes of the simulator where it matters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from mvpose import Camera, Rig
from mvpose.commands.progress import Reporter, Silence, counted
from simharness.planning.fast_layer import CameraTerms, FastLayer, Prediction
from simharness.planning.floor_coverage import coverage
from simharness.planning.forecast_error import ForecastErrors
from simharness.planning.rehearsal_result import (
    HEIGHTS,
    CameraWorth,
    Crowd,
    Estimated,
    ExtraCamera,
    Rehearsal,
    sentences,
)
from simharness.planning.rehearsal_scene import RehearsalSetup, SceneSettings
from simharness.planning.simulated_scenes import (
    Condition,
    SceneBatch,
    SceneResult,
    interval_of,
    loss_of,
    nan_mean,
    simulate_scenes,
)
from simharness.planning.tolerance import fault_conditions, tolerances
from simharness.reality.validation.variant_comparison import camera_subsets
from simharness.world.rigs.extra_camera import cameras_on_walls

_SPACING = 0.5  # metres between the places of the maps
_COARSE = 1.0  # metres between places where sets of cameras are compared
_COARSE_TURNS = 12  # directions in which people stand there
_VARIANT = "full"  # of the method


@dataclass(frozen=True)
class RehearsalEffort:
    """How much is simulated."""

    scenes: int = 16
    """Scenes of the rig, at the seeds 0, 1, ... from the seed of the rehearsal on."""
    crowd_scenes: int = 6
    """Scenes of each other number of people."""
    crowds: tuple[int, ...] = (1, 2, 6, 8, 10)
    """Other numbers of people that are simulated; the fast layer has all from 1 to ``most``."""
    most: int = 10
    """Largest number of people."""
    around: int = 16
    """Places on the walls where one more camera is tried, each at two heights; 0: none."""
    workers: int = 1
    """Processes; the results do not depend on it."""


def rehearse_rig(
    rig: Rig,
    setup: RehearsalSetup,
    *,
    subsets: bool = False,
    seed: int = 0,
    effort: RehearsalEffort | None = None,
    name: str = "rig",
    reporter: Reporter | None = None,
) -> Rehearsal:
    """Rehearse a rig: what the method will give with it, before its cameras hang.

    Args:
        rig: two or more cameras, metres, floor at z = 0.
        setup: where people are, how many, what hides them, and the detector.
        subsets: score all sets of two cameras and more, instead of the rig and the rig without each camera.
        seed: seed of everything.
        effort: how much is simulated.
        name: name of the rig in the result.
        reporter: receiver of progress.

    Raises:
        ValueError: a camera under the floor, outside of the room or inside an obstacle, a volume outside of the room,
            nobody visible to two cameras, or people who do not fit into the volume.
        RunError: any error of the simulation.
    """
    setup.check(rig)
    return _Rehearsing(name, rig, setup, subsets, seed, effort or RehearsalEffort(), reporter or Silence()).run()


@dataclass(frozen=True)
class _Compared:
    """Predictions of the fast layer on its coarse scenes: sets of cameras, one more camera, numbers of people."""

    sets: dict[tuple[int, ...], Prediction]
    extra: tuple[Camera, Prediction, int] | None
    crowds: dict[int, Prediction]


@dataclass(frozen=True)
class _Rehearsing:
    """Steps of a rehearsal."""

    name: str
    rig: Rig
    setup: RehearsalSetup
    subsets: bool
    seed: int
    effort: RehearsalEffort
    reporter: Reporter

    def run(self) -> Rehearsal:
        """Run all steps."""
        rig, target = self.rig, self.setup.target
        start = perf_counter()
        prediction, whole_places = self._maps()
        layer_seconds = perf_counter() - start
        compared = self._compare()
        base = compared.sets[self.whole]
        scenes, simulated = self._simulate(compared)
        good = (prediction.pcp >= target.pcp) & (prediction.error_mm <= target.error)
        mixed = interval_of(scenes, Condition(self.whole), "mixed")
        rehearsal = Rehearsal(
            name=self.name,
            rig=rig,
            setup=self.setup,
            prediction=prediction,
            coverage=coverage(rig, prediction.places, HEIGHTS),
            good=good,
            whole=self._estimated(scenes, self.whole, prediction),
            cameras={camera.name: self._worth(k, whole_places[k], scenes, compared) for k, camera in enumerate(rig)},
            subsets={
                tuple(rig[k].name for k in cameras): self._estimated(scenes, cameras, each)
                for cameras, each in compared.sets.items()
            },
            extra=self._extra(scenes, compared, base),
            crowds=self._crowds(simulated, compared),
            tolerances=tolerances(scenes, self.whole),
            scenes=tuple(scenes),
            mixed=mixed,
            seconds={"layer": layer_seconds, "all": perf_counter() - start},
        )
        return replace(rehearsal, sentences=sentences(rehearsal))

    @property
    def whole(self) -> tuple[int, ...]:
        """Indices of all cameras."""
        return tuple(range(len(self.rig)))

    @property
    def errors(self) -> ForecastErrors:
        """Errors of the forecast, besides the noise of its scenes."""
        return ForecastErrors.of_detector(self.setup.detector)

    def _layer(self, *, people: int, coarse: bool) -> FastLayer:
        return FastLayer.in_volume(
            self.setup.volume,
            detector=self.setup.detector,
            people=people,
            spacing=_COARSE if coarse else _SPACING,
            orientations=_COARSE_TURNS if coarse else 8,
            draws=1 if coarse else 2,
            obstacles=self.setup.obstacles,
            seed=self.seed,
        )

    def _maps(self) -> tuple[Prediction, list[float]]:
        """Return the prediction of all cameras, and the share of the places at which each sees a person whole.

        Raises:
            ValueError: two cameras see nobody.
        """
        rig = self.rig
        with self.reporter.stage("maps", len(rig) + 1) as advance:
            layer = self._layer(people=self.setup.people, coarse=False)
            terms = [layer.terms(camera) for camera in counted(rig, advance)]
            if not any(each.seen.any() for each in terms):
                raise ValueError(
                    "nothing is visible: no camera has anybody in the volume in its picture; check the volume, the "
                    "directions of the cameras, and that the calibration has metres with z up"
                )
            prediction = layer.predict(terms, variant=_VARIANT)
            advance(1)
        if not np.nansum(prediction.recall):
            raise ValueError(
                "nothing is visible: no person in the volume is seen by two cameras; check the volume and the "
                "directions of the cameras"
            )
        return prediction, [float(np.nanmean(each.whole)) for each in terms]

    def _compare(self) -> _Compared:
        """Return what the fast layer says of other sets of cameras and numbers of people."""
        rig, setup = self.rig, self.setup
        sets = self._sets()
        walls, ceiling = (None, np.inf) if setup.space is None else (setup.space.outline, setup.space.height)
        area, around = setup.volume.outline, self.effort.around
        candidates = cameras_on_walls(rig, area, walls=walls, ceiling=ceiling, around=around)
        numbers = range(1, self.effort.most + 1)
        with self.reporter.stage("compare", len(sets) + len(candidates) + len(numbers)) as advance:
            layer = self._layer(people=setup.people, coarse=True)
            terms = [layer.terms(camera) for camera in rig]
            predicted = {
                each: layer.predict([terms[k] for k in each], variant=_VARIANT)
                for each in counted(sets, advance)
                if len(each) > 1
            }
            extra = None
            for camera in counted(candidates, advance):
                prediction = layer.predict([*terms, layer.terms(camera)], variant=_VARIANT)
                if extra is None or _better(prediction, extra[1]):
                    extra = (camera, prediction, len(candidates))
            crowds = {number: self._with_people(number, layer, terms) for number in counted(numbers, advance)}
        return _Compared(predicted, extra, crowds)

    def _with_people(self, number: int, layer: FastLayer, terms: Sequence[CameraTerms]) -> Prediction:
        if number != self.setup.people:
            layer = self._layer(people=number, coarse=True)
            terms = [layer.terms(camera) for camera in self.rig]
        return layer.predict(terms, variant=_VARIANT)

    def _sets(self) -> list[tuple[int, ...]]:
        """Return the sets of cameras that are scored: all cameras, and all without each, or all sets."""
        if self.subsets:
            return camera_subsets(len(self.whole))
        return [self.whole, *(self._without(k) for k in self.whole)]

    def _without(self, camera: int) -> tuple[int, ...]:
        return tuple(k for k in self.whole if k != camera)

    def _simulate(self, compared: _Compared) -> tuple[list[SceneResult], dict[int, list[SceneResult]]]:
        """Return the scenes of the rig, and those of it with other numbers of people, without numbers that do not fit.

        The additional camera is one more camera of the scenes.
        """
        sets = dict.fromkeys([*compared.sets, *(self._without(k) for k in self.whole)])
        conditions = [Condition(each) for each in sets] + fault_conditions(self.whole)
        rig, people = self.rig, self.setup.people
        if compared.extra is not None:
            rig = Rig([*rig, compared.extra[0]])
            conditions.append(Condition((*self.whole, len(self.whole))))
        batches = {people: self._batch(rig, people, conditions, self.effort.scenes)}
        for number in sorted(self.effort.crowds, reverse=True):
            if number != people and number <= self.effort.most:
                alone = [Condition(self.whole)]
                batches[number] = self._batch(self.rig, number, alone, self.effort.crowd_scenes)
        with self.reporter.stage("simulate", sum(len(each.seeds) for each in batches.values())) as advance:
            results = simulate_scenes(list(batches.values()), workers=self.effort.workers, progress=advance)
        by_number = {number: scenes for number, scenes in zip(batches, results, strict=True) if scenes}
        return by_number[people], by_number

    def _batch(self, rig: Rig, people: int, conditions: Sequence[Condition], count: int) -> SceneBatch:
        settings = SceneSettings(rig, replace(self.setup, people=people), whole=self.whole)
        return SceneBatch(settings, tuple(conditions), tuple(range(self.seed, self.seed + count)))

    def _estimated(self, scenes: Sequence[SceneResult], cameras: tuple[int, ...], prediction: Prediction) -> Estimated:
        summary, condition = prediction.summary(), Condition(cameras)
        pcp, error, recall = (interval_of(scenes, condition, score) for score in ("pcp", "mpjpe_mm", "recall"))
        forecasts = self.errors.of_pcp(pcp), self.errors.of_mm(error), self.errors.of_pcp(recall)
        return Estimated(summary["pcp"].mean, summary["mpjpe_mm"].mean, *forecasts)

    def _worth(self, k: int, sees: float, scenes: Sequence[SceneResult], compared: _Compared) -> CameraWorth:
        rest, base = Condition(self._without(k)), Condition(self.whole)
        predicted = compared.sets.get(rest.cameras)
        layer = compared.sets[self.whole].summary()["pcp"].mean
        gained = loss_of(scenes, base, rest, "mpjpe_mm")
        return CameraWorth(
            camera=self.rig[k],
            sees=sees,
            without=None if predicted is None else self._estimated(scenes, rest.cameras, predicted),
            worth=self.errors.of_loss(loss_of(scenes, rest, base)),
            worth_mm=gained,
            layer_worth=float(layer if predicted is None else layer - predicted.summary()["pcp"].mean),
        )

    def _extra(self, scenes: Sequence[SceneResult], compared: _Compared, base: Prediction) -> ExtraCamera | None:
        if compared.extra is None:
            return None
        camera, prediction, places = compared.extra
        more, whole = (*self.whole, len(self.whole)), Condition(self.whole)
        return ExtraCamera(
            camera,
            places,
            self._estimated(scenes, more, prediction),
            self.errors.of_loss(loss_of(scenes, whole, Condition(more))),
            loss_of(scenes, Condition(more), whole, "mpjpe_mm"),
            float(prediction.summary()["pcp"].mean - base.summary()["pcp"].mean),
        )

    def _crowds(self, simulated: Mapping[int, Sequence[SceneResult]], compared: _Compared) -> tuple[Crowd, ...]:
        """Return the figures by number of people."""
        crowds, whole = [], Condition(self.whole)
        for number, prediction in compared.crowds.items():
            summary, scenes = prediction.summary(), simulated.get(number)
            pcp, mixed = (None if scenes is None else interval_of(scenes, whole, key) for key in ("pcp", "mixed"))
            pcp = None if pcp is None else self.errors.of_pcp(pcp)
            risk = nan_mean(prediction.risk)
            crowds.append(Crowd(number, summary["pcp"].mean, summary["mpjpe_mm"].mean, risk, pcp, mixed))
        return tuple(crowds)


def _better(one: Prediction, other: Prediction) -> bool:
    """Return whether a prediction has more PCP than another; of equal ones, to a tenth, the smaller error."""
    here, there = one.summary(), other.summary()
    key = (round(here["pcp"].mean, 1), -here["mpjpe_mm"].mean)
    return key > (round(there["pcp"].mean, 1), -there["mpjpe_mm"].mean)
