"""Tolerance of a rig: what errors of its calibration and its clocks cost, and where its cliff is.

Errors of cameras are independent: a level is the standard deviation of the error of orientations about each axis, of
positions along each axis, or of the clocks. The method does not know them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from simharness.planning.simulated_scenes import Condition, SceneResult, interval_of, loss_of
from simharness.statistics.intervals import Interval

CLIFF = 5.0
"""Loss of PCP, points, from which an error of calibration or clocks counts as too large."""


@dataclass(frozen=True)
class FaultKind:
    """Kind of error."""

    key: str
    """Key of the section ``[faults]`` of scenarios."""
    title: str
    """Name in text."""
    unit: str
    """Unit in text."""
    scale: float
    """Units of text in one unit of the scenario."""
    levels: tuple[float, ...]
    """Levels, in units of text, ascending."""


FAULTS: Mapping[str, FaultKind] = MappingProxyType(
    {
        "rotation": FaultKind("rotation", "orientation of the cameras", "°", 1.0, (0.25, 0.5, 1.0, 2.0)),
        "translation": FaultKind("translation", "position of the cameras", "cm", 100.0, (0.25, 0.5, 1.0, 2.0)),
        "clock_offset": FaultKind("clock_offset", "clocks of the cameras", "ms", 1000.0, (10.0, 33.0, 67.0)),
    }
)
"""Kinds of errors by key. 33 and 67 ms are one and two frames of a film of 30 frames per second."""


@dataclass(frozen=True)
class FaultTolerance:
    """What errors of one kind cost a rig."""

    fault: FaultKind
    """Kind of error."""
    pcp: tuple[Interval, ...]
    """PCP at each level, percent."""
    mpjpe_mm: tuple[Interval, ...]
    """Joint error at each level, mm."""
    loss: tuple[Interval, ...]
    """Points of PCP lost at each level, paired by scene."""
    cliff: float | None
    """Level, in units of text, from which :data:`CLIFF` points are lost, between two levels by interpolation; None
    where it is beyond the largest."""

    @property
    def limit(self) -> str:
        """Largest error that costs less than :data:`CLIFF` points, as text: "0.4°", "more than 2 cm"."""
        space = "" if self.fault.unit == "°" else " "
        if self.cliff is None:
            return f"more than {self.fault.levels[-1]:g}{space}{self.fault.unit}"
        return f"{self.cliff:.2g}{space}{self.fault.unit}"


def fault_conditions(cameras: Sequence[int]) -> list[Condition]:
    """Return a condition for every level of every kind of error.

    Args:
        cameras: indices of the cameras of the rig.
    """
    whole = tuple(cameras)
    return [Condition(whole, key, level / fault.scale) for key, fault in FAULTS.items() for level in fault.levels]


def tolerances(results: Sequence[SceneResult], cameras: Sequence[int]) -> tuple[FaultTolerance, ...]:
    """Return the tolerance of a rig to every kind of error.

    Args:
        results: scenes that were scored under the conditions of :func:`fault_conditions` and without a fault.
        cameras: indices of the cameras of the rig.
    """
    whole = tuple(cameras)
    found = []
    for key, fault in FAULTS.items():
        conditions = [Condition(whole, key, level / fault.scale) for level in fault.levels]
        loss = tuple(loss_of(results, each, Condition(whole)) for each in conditions)
        found.append(
            FaultTolerance(
                fault,
                tuple(interval_of(results, each, "pcp") for each in conditions),
                tuple(interval_of(results, each, "mpjpe_mm") for each in conditions),
                loss,
                cliff_of(fault.levels, [each.mean for each in loss]),
            )
        )
    return tuple(found)


def cliff_of(levels: Sequence[float], losses: Sequence[float]) -> float | None:
    """Return the level at which the loss first reaches :data:`CLIFF`, by linear interpolation from no loss at level 0.

    Args:
        levels: levels, ascending and positive.
        losses: loss at each level, points.
    """
    at, lost = np.array([0.0, *levels]), np.array([0.0, *losses])
    beyond = np.flatnonzero(lost >= CLIFF)
    if not len(beyond):
        return None
    k = int(beyond[0])
    return float(at[k - 1] + (CLIFF - lost[k - 1]) / (lost[k] - lost[k - 1]) * (at[k] - at[k - 1]))
