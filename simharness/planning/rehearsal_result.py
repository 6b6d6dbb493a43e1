"""Result of a rehearsal, its JSON, and what it says in plain sentences."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mvpose import Camera, Rig
from mvpose.arrays import Bools, Integers
from mvpose.json_values import json_value
from simharness.planning.fast_layer import Prediction
from simharness.planning.floor_coverage import good_rectangle
from simharness.planning.forecast_error import forecast_text
from simharness.planning.plan_result import names_text, people_text, size_text
from simharness.planning.rehearsal_scene import RehearsalSetup
from simharness.planning.simulated_scenes import SceneResult
from simharness.planning.tolerance import CLIFF, FaultTolerance
from simharness.statistics.intervals import Interval

LITTLE = 2.0
"""Points of PCP, lost or gained, that are no reason to buy or to move a camera."""

HEIGHTS = (0.1, 0.9, 1.7, 2.2)
"""Heights of coverage maps, metres: feet, hips, crown, and a raised hand."""


@dataclass(frozen=True)
class Estimated:
    """A set of cameras, as the fast layer predicts it and as the simulator shows it."""

    layer_pcp: float
    """PCP of the fast layer, percent."""
    layer_error_mm: float
    """Its expected joint error, mm."""
    pcp: Interval
    """Simulated PCP, percent."""
    mpjpe_mm: Interval
    """Simulated joint error, mm."""
    recall: Interval
    """Simulated recall of people, percent."""


@dataclass(frozen=True)
class CameraWorth:
    """What one camera contributes."""

    camera: Camera
    """The camera."""
    sees: float
    """Share of the places at which it sees a standing person whole, 0 to 1 (fast layer)."""
    without: Estimated | None
    """The rig without it; None of a rig of two cameras."""
    worth: Interval
    """Points of PCP that its failure costs in simulation, paired by scene."""
    worth_mm: Interval
    """What its failure adds to the joint error, mm."""
    layer_worth: float
    """Points of PCP that its failure costs by the fast layer."""

    @property
    def redundant(self) -> bool:
        """Whether its failure alone costs less than :data:`LITTLE` points of PCP, by the whole interval."""
        return self.without is not None and self.worth.high < LITTLE

    @property
    def needed(self) -> bool:
        """Whether its failure costs more than half a point of PCP, by the whole interval."""
        return self.worth.low > 0.5


@dataclass(frozen=True)
class ExtraCamera:
    """The best place found for one more camera."""

    camera: Camera
    """The camera, at its place."""
    places: int
    """Number of places and directions that were compared by the fast layer."""
    rig: Estimated
    """The rig with it."""
    gain: Interval
    """Points of PCP that it adds in simulation, paired by scene."""
    gain_mm: Interval
    """What it takes from the joint error, mm."""
    layer_gain: float
    """Points of PCP that it adds by the fast layer."""


@dataclass(frozen=True)
class Crowd:
    """A number of people in the volume."""

    people: int
    """Their number."""
    layer_pcp: float
    """PCP of the fast layer, percent."""
    layer_error_mm: float
    """Its expected joint error, mm."""
    layer_risk: float
    """Its mean probability of a wrong match, 0 to 1."""
    pcp: Interval | None = None
    """Simulated PCP, percent; None where so many were not simulated or do not fit."""
    mixed: Interval | None = None
    """Simulated percentage of matched groups that hold two people; None likewise."""


@dataclass(frozen=True)
class Rehearsal:
    """What a rig will give in a volume, before its cameras hang."""

    name: str
    """Name of the rig."""
    rig: Rig
    """Its cameras."""
    setup: RehearsalSetup
    """What it is rehearsed for."""
    prediction: Prediction
    """Fast layer, all cameras."""
    coverage: Integers
    """Number of cameras that have a point over each place in the picture, by :data:`HEIGHTS`, (H, P)."""
    good: Bools
    """Which places reach the target, (P,) (fast layer)."""
    whole: Estimated
    """All cameras."""
    cameras: Mapping[str, CameraWorth]
    """Worth of each camera, by name."""
    subsets: Mapping[tuple[str, ...], Estimated]
    """Sets of cameras by the names of their cameras; with those of leave-one-out and all cameras."""
    extra: ExtraCamera | None
    """One more camera; None where no place improves the rig."""
    crowds: tuple[Crowd, ...]
    """The same with other numbers of people, ascending."""
    tolerances: tuple[FaultTolerance, ...]
    """What errors of calibration and clocks cost."""
    scenes: tuple[SceneResult, ...]
    """Simulated scenes, for the maps of the simulation."""
    mixed: Interval
    """Simulated percentage of matched groups that hold two people, all cameras."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Time that the fast layer and the simulation took."""
    sentences: tuple[str, ...] = ()
    """The result in plain sentences, the most important first."""

    @property
    def good_share(self) -> float:
        """Share of the places that reach the target, 0 to 1."""
        return float(self.good.mean()) if len(self.good) else 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the rehearsal as JSON: see ``docs/guide/rehearse.md``. A value that does not apply is null."""
        prediction, setup = self.prediction, self.setup
        maps = {"places", "pcp", "recall", "error_mm", "views", "ellipse", "risk"}
        content = {
            "name": self.name,
            "sentences": self.sentences,
            "people": setup.people,
            "detector": setup.detector.name,
            "target": {"pcp": setup.target.pcp, "mpjpe_mm": setup.target.error, "share": self.good_share},
            "volume": {"outline": setup.volume.outline, "height": setup.volume.height},
            **_estimated(self.whole),
            "mixed": self.mixed,
            "map": {
                **{key: value for key, value in vars(prediction).items() if key in maps},
                "good": self.good,
                "cameras_by_height": {f"{at:g}": row for at, row in zip(HEIGHTS, self.coverage, strict=True)},
            },
            "cameras": {name: _worth(each) for name, each in self.cameras.items()},
            "subsets": [{"cameras": names} | _estimated(each) for names, each in self.subsets.items()],
            "extra": None if self.extra is None else _extra(self.extra),
            "crowds": [_crowd(each) for each in self.crowds],
            "tolerance": {each.fault.key: _tolerance(each) for each in self.tolerances},
            "layer_seconds": self.seconds.get("layer"),
        }
        return {key: json_value(value, decimals=4) for key, value in content.items()}


def _estimated(each: Estimated) -> dict[str, Any]:
    layer = {"pcp": each.layer_pcp, "error_mm": each.layer_error_mm}
    return {"pcp": each.pcp, "mpjpe_mm": each.mpjpe_mm, "recall": each.recall, "layer": layer}


def _worth(each: CameraWorth) -> dict[str, Any]:
    return {
        "worth": each.worth,
        "worth_mm": each.worth_mm,
        "layer_worth": each.layer_worth,
        "sees": each.sees,
        "redundant": each.redundant,
        "position": each.camera.center,
        "without": None if each.without is None else _estimated(each.without),
    }


def _extra(extra: ExtraCamera) -> dict[str, Any]:
    return {
        "position": extra.camera.center,
        "direction": extra.camera.R[2],
        "gain": extra.gain,
        "gain_mm": extra.gain_mm,
        "layer_gain": extra.layer_gain,
        "places": extra.places,
        "rig": _estimated(extra.rig),
    }


def _crowd(each: Crowd) -> dict[str, Any]:
    layer = {"pcp": each.layer_pcp, "error_mm": each.layer_error_mm, "risk": each.layer_risk}
    return {"people": each.people, "pcp": each.pcp, "mixed": each.mixed, "layer": layer}


def _tolerance(each: FaultTolerance) -> dict[str, Any]:
    levels = zip(each.fault.levels, each.pcp, each.mpjpe_mm, each.loss, strict=True)
    return {
        "unit": each.fault.unit,
        "cliff": each.cliff,
        "cliff_points": CLIFF,
        "levels": [dict(zip(("level", "pcp", "mpjpe_mm", "loss"), level, strict=True)) for level in levels],
    }


_CROWDED = 90.0  # PCP, percent: with fewer the method is of little use


def sentences(rehearsal: Rehearsal) -> tuple[str, ...]:
    """Return the result in plain sentences, the most important first."""
    of = (_verdict, _numbers, _cameras, _one_more, _crowd_sentence, _tolerance_sentence, _matching)
    return tuple(text for each in of if (text := each(rehearsal)))


def _verdict(rehearsal: Rehearsal) -> str:
    setup, count, whole = rehearsal.setup, len(rehearsal.rig), rehearsal.whole
    people, size = people_text(setup.people), size_text(*setup.volume.size)
    target = f"PCP {setup.target.pcp:g} and {setup.target.error:g} mm"
    surely = whole.pcp.low >= setup.target.pcp and whole.mpjpe_mm.high <= setup.target.error
    never = whole.pcp.high < setup.target.pcp or whole.mpjpe_mm.low > setup.target.error
    enough = "are enough" if surely else "may be enough"
    if rehearsal.good_share > 0.995:
        return f"{count} cameras {enough} for {people} in the whole volume of {size}: everywhere {target} are met."
    rectangle = good_rectangle(rehearsal.prediction.places, rehearsal.good)
    if rectangle is None:
        short = "are not" if never else "may not be"
        return f"{count} cameras {short} enough for {people} in {size}: nowhere are {target} met."
    inner = size_text(*(rectangle[1] - rectangle[0]))
    return (
        f"{count} cameras {enough} for {people} within {inner}; {100 * rehearsal.good_share:.0f} % of the volume of "
        f"{size} meets the target, {target}."
    )


def _numbers(rehearsal: Rehearsal) -> str:
    whole = rehearsal.whole
    return (
        f"The forecast: {forecast_text(whole.pcp)} % of the body parts are placed correctly (PCP), and joints of "
        f"people who are found are off by {forecast_text(whole.mpjpe_mm, digits=0)} mm."
    )


def _cameras(rehearsal: Rehearsal) -> str:
    worths = sorted(rehearsal.cameras.values(), key=lambda each: -each.worth.mean)
    if all(each.without is None for each in worths):
        return "With two cameras, the failure of either one leaves no positions in space."
    first, second = worths[0], worths[1]
    redundant = [each for each in rehearsal.cameras.values() if each.redundant]
    needed = [each for each in worths if each.needed]
    parts = []
    if first.needed and first.worth.low > second.worth.mean:
        size = forecast_text(first.worth)
        parts.append(f"camera {first.camera.name} matters most: its failure costs {size} points of PCP")
    elif len(redundant) < len(worths):
        low, high = min(each.worth.low for each in worths), max(each.worth.high for each in worths)
        parts.append(
            "which camera matters most cannot be told: the failure of one costs "
            f"{max(low, 0.0):.1f} to {high:.1f} points of PCP"
        )
    if redundant:
        names = [each.camera.name for each in redundant]
        which = "any camera" if len(names) == len(worths) else "any of " + names_text(names)
        which = f"camera {names[0]}" if len(names) == 1 else which
        alone = " alone, not several at once" if len(names) > 1 else ""
        parts.append(f"{which} could be spared{alone}: its failure costs less than {LITTLE:g} points of PCP")
    if len(needed) == len(worths):
        parts.append("no camera can be spared")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def _one_more(rehearsal: Rehearsal) -> str:
    extra = rehearsal.extra
    if extra is None:
        return ""
    x, y, z = extra.camera.center
    where = f"at x = {x:.1f}, y = {y:.1f}, {z:.1f} m high"
    gained = f"{forecast_text(extra.gain)} points of PCP and takes {max(extra.gain_mm.mean, 0.0):.0f} mm from the error"
    if extra.gain.high < LITTLE and extra.gain_mm.mean < 0.1 * rehearsal.whole.mpjpe_mm.mean:
        return f"One more camera brings little: the best place, {where}, adds {gained}."
    if extra.gain.low > 0:
        return f"One more camera should hang {where}: it adds {gained}."
    return f"Whether one more camera helps cannot be told: the best place, {where}, adds {gained}."


def _crowd_sentence(rehearsal: Rehearsal) -> str:
    known = [(each.people, each.pcp) for each in rehearsal.crowds if each.pcp is not None]
    if len(known) < 2:
        return ""
    people, pcp = known[-1]
    last = f"with {people} it is {forecast_text(pcp, digits=0)}"
    surely = max((count for count, value in known if value.low >= _CROWDED), default=0)
    perhaps = max((count for count, value in known if value.high >= _CROWDED), default=0)
    if not perhaps:
        return f"PCP is below {_CROWDED:g} with any number of people; {last}."
    if surely == perhaps:
        return f"PCP stays at {_CROWDED:g} or above up to {people_text(surely)}; {last}."
    first = f"for certain up to {people_text(surely)}, perhaps" if surely else "perhaps"
    return f"PCP stays at {_CROWDED:g} or above {first} up to {people_text(perhaps)}; {last}."


def _tolerance_sentence(rehearsal: Rehearsal) -> str:
    if not rehearsal.tolerances:
        return ""
    limits = {each.fault.key: each.limit for each in rehearsal.tolerances}
    return (
        f"Errors that cost 5 points of PCP: {limits['rotation']} in the orientation of every camera, "
        f"{limits['translation']} in its position, {limits['clock_offset']} in its clock."
    )


def _matching(rehearsal: Rehearsal) -> str:
    if not np.isfinite(rehearsal.mixed.mean) or rehearsal.mixed.mean < 1.0:
        return ""
    return f"In {rehearsal.mixed.mean:.0f} % of the matches two people are taken for one."
