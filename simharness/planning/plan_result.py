"""Plan: where the cameras of a room should hang, what that reaches, and how sure it is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from mvpose import Rig
from mvpose.json_values import json_value
from simharness.planning.candidates import Candidate
from simharness.planning.fast_layer import Prediction
from simharness.planning.forecast_error import ForecastErrors, forecast_text
from simharness.planning.planned_room import Room
from simharness.planning.room_keys import TargetKeys
from simharness.statistics.intervals import Interval


@dataclass(frozen=True)
class Figures:
    """Figures of a rig in the volume."""

    pcp: Interval
    """Percentage of correct parts, with its 90 % interval: by the fast layer of a recording of ten seconds, else of a
    forecast by simulation."""
    error_mm: Interval
    """Mean error of joints, millimetres, with its interval."""
    share: float = math.nan
    """Share of the places of the volume within the target, percent; NaN where it was not computed."""
    worst: float = math.nan
    """Least PCP of a place, percent; NaN where it was not computed."""

    def to_json(self) -> dict[str, Any]:
        """Return the figures by their names in JSON; NaN where unknown."""
        return {
            "pcp": {"value": self.pcp.mean, "low": self.pcp.low, "high": self.pcp.high},
            "mpjpe_mm": {"value": self.error_mm.mean, "low": self.error_mm.low, "high": self.error_mm.high},
            "share_within_target": self.share,
            "worst_pcp": self.worst,
        }

    @classmethod
    def of_prediction(cls, prediction: Prediction, target: TargetKeys) -> Self:
        """Return the figures that the fast layer predicts; places where nobody can stand do not count."""
        figures = prediction.summary()
        within = (prediction.pcp >= target.pcp) & (prediction.error_mm <= target.error)
        known = np.isfinite(prediction.pcp)
        return cls(
            figures["pcp"], figures["mpjpe_mm"], 100.0 * float(within[known].mean()), float(prediction.pcp[known].min())
        )

    @classmethod
    def of_row(cls, row: Sequence[Any]) -> Self:
        """Return the figures of a row of the ledger, which has them as a tuple."""
        pcp, error, share, worst = row
        return cls(Interval(*pcp), Interval(*error), share, worst)


@dataclass(frozen=True)
class PlannedCamera:
    """Camera of a plan."""

    name: str
    """Its name."""
    candidate: Candidate | None
    """Where it hangs; None of a camera that hangs already."""
    mount: str
    """Name of its mount, "wall 2"; "fixed" of a camera that hangs already."""
    lens: str
    """Name of its lens."""
    sure: float
    """Share of the near-best rigs that have a camera like it, 0 to 1; NaN of a camera that hangs already."""
    worth: float
    """Loss of predicted PCP without it, points."""


@dataclass(frozen=True)
class Alternative:
    """Rig that was compared."""

    title: str
    """Name for people: "plan", "second best", "corners", "ring"."""
    rig: Rig = field(repr=False)
    """The rig."""
    predicted: Figures
    """Its figures by the fast layer."""
    simulated: Figures | None = None
    """Its figures by simulation; None where it was not simulated."""


@dataclass(frozen=True)
class CurvePoint:
    """What the best found rig of a number of cameras gives, by the fast layer, with the cost of its lenses."""

    cameras: int
    figures: Figures
    cost: float


@dataclass(frozen=True)
class RigPlan:
    """Planned rig."""

    room: Room = field(repr=False)
    """The room."""
    rig: Rig = field(repr=False)
    """The planned cameras, those that hang already first."""
    cameras: tuple[PlannedCamera, ...]
    """Each camera of the rig."""
    alternatives: tuple[Alternative, ...]
    """The plan first, then other rigs."""
    prediction: Prediction = field(repr=False)
    """Maps of the plan by the fast layer."""
    curve: tuple[CurvePoint, ...]
    """What fewer and more cameras would give."""
    near_best: int
    """Number of near-best rigs by which ``sure`` is counted."""
    candidates: int
    """Number of cameras from which the search chose."""
    simulated_scenes: int
    """Number of simulated scenes; 0: none."""
    seed: int
    """Seed of the plan."""
    seconds: dict[str, float] = field(default_factory=dict, compare=False)
    """Duration by stage, of this run."""

    @property
    def best(self) -> Alternative:
        """The plan itself."""
        return self.alternatives[0]

    @property
    def figures(self) -> Figures:
        """Figures of the plan: simulated ones where there are any."""
        return self.best.simulated or self.best.predicted

    def to_json(self) -> dict[str, Any]:
        """Return the plan as JSON values."""
        simulated = self.best.simulated
        content = {
            "room": self.room.name,
            "seed": self.seed,
            "cameras": {each.name: self._camera(k, each) for k, each in enumerate(self.cameras)},
            "predicted": self.best.predicted.to_json(),
            "simulated": None if simulated is None else simulated.to_json(),
            "simulated_scenes": self.simulated_scenes,
            "alternatives": [
                {
                    "title": each.title,
                    "predicted": each.predicted.to_json(),
                    "simulated": None if each.simulated is None else each.simulated.to_json(),
                }
                for each in self.alternatives
            ],
            "curve": [{"cameras": p.cameras, "cost": p.cost, **p.figures.to_json()} for p in self.curve],
            "map": {
                "places": self.prediction.places.round(3).tolist(),
                **{key: getattr(self.prediction, key) for key in ("pcp", "error_mm", "views")},
            },
            "near_best": self.near_best,
            "candidates": self.candidates,
        }
        return {key: json_value(value, decimals=4) for key, value in content.items()}

    def _camera(self, index: int, camera: PlannedCamera) -> dict[str, Any]:
        built = self.rig[index]
        return {
            "position": built.center.round(3).tolist(),
            "direction": built.R[2].round(4).tolist(),
            "mount": camera.mount,
            "lens": camera.lens,
            "sure": camera.sure,
            "worth": camera.worth,
        }


_NEARLY_ALL = 98.0  # PCP: more cameras add little


def sentences(plan: RigPlan) -> list[str]:
    """Return what the plan says in plain sentences, the most important first."""
    room, figures, target = plan.room, plan.figures, plan.room.keys.target
    area, people = size_text(*room.volume.size), people_text(room.keys.people.count)
    how = f"in {plan.simulated_scenes} simulated scenes" if plan.best.simulated is not None else "by the fast layer"
    lines = [
        f"{len(plan.rig)} cameras give {forecast_text(figures.pcp)} PCP and "
        f"{forecast_text(figures.error_mm, digits=0)} mm for {people} within {area}, {how}."
    ]
    share = plan.best.predicted.share
    if math.isfinite(share):
        lines.append(
            f"{share:.0f} % of the volume is within the target of {target.pcp:g} PCP and {target.error:g} mm; its "
            f"worst place has {plan.best.predicted.worst:.0f} PCP."
        )
    enough = [p for p in plan.curve if p.figures.share >= 99.5]
    now = len(plan.rig)
    if enough and enough[0].cameras < now:
        lines.append(f"{enough[0].cameras} cameras would be enough for this target everywhere in the volume.")
    elif enough and enough[0].cameras > now:
        lines.append(f"{enough[0].cameras} cameras would bring the whole volume within the target.")
    fewest = next((p for p in plan.curve if p.figures.pcp.mean >= _NEARLY_ALL), None)
    if fewest is not None and fewest.cameras < now:
        got = fewest.figures
        lines.append(
            f"{fewest.cameras} cameras already give {got.pcp.mean:.1f} PCP and {got.error_mm.mean:.0f} mm by the fast "
            f"layer, {now} give {plan.best.predicted.pcp.mean:.1f} and {plan.best.predicted.error_mm.mean:.0f}."
        )
    more = next((p for p in plan.curve if p.cameras == now + 1), None)
    same = next((p for p in plan.curve if p.cameras == now), None)
    if more is not None and same is not None:
        gain = more.figures.pcp.mean - same.figures.pcp.mean
        # Two draws of one layer: their difference has the error of the model alone.
        added = ForecastErrors.of_detector(room.detector).of_loss(Interval(gain, np.nan, np.nan, 1))
        helps = "would" if added.low > 0 else "may"
        lines.append(f"One more camera {helps} add {forecast_text(added)} PCP.")
    placed = [each for each in plan.cameras if each.candidate is not None]
    sure = [each.name for each in placed if each.sure >= 0.8]
    free = [each.name for each in placed if each.sure < 0.4]
    if plan.near_best > 1 and sure:
        hang = "hangs" if len(sure) == 1 else "hang"
        lines.append(f"{names_text(sure)} {hang} at about the same place in nearly every good rig.")
    if plan.near_best > 1 and free:
        them = "it" if len(free) == 1 else "them"
        lines.append(f"{names_text(free)} may also hang elsewhere: other good rigs do without {them}.")
    return lines


def names_text(names: Sequence[str]) -> str:
    """Return one name or more in a sentence: "cam1, cam2 and cam4"."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def people_text(count: int) -> str:
    """Return a number of people in a sentence."""
    return "1 person" if count == 1 else f"{count} people"


def size_text(x: float, y: float) -> str:
    """Return the sides of a rectangle, metres, in a sentence."""
    return f"{x:.1f} by {y:.1f} m"
