"""Motion of one person (pelvis pose and joint angles over time), and motions and props of one activity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array
from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.trajectory import Trajectory, check_poses, check_times, interpolate, interpolate_poses


@dataclass(frozen=True)
class Presence:
    """Times at which a person is in the scene, as closed intervals; at all other times the person is absent.

    Attributes:
        intervals: start and end of each stay, (n, 2) seconds, ascending; infinite for a stay without start or end.

    Raises:
        ValueError: a wrong shape, or stays that overlap or end before they start.
    """

    intervals: Floats

    def __post_init__(self) -> None:
        intervals = as_array(self.intervals, ("n", 2), "presence intervals")
        if np.isnan(intervals).any() or (np.diff(intervals.ravel()) < 0).any():
            raise ValueError(f"presence intervals must be ascending seconds, got {intervals.tolist()}")
        object.__setattr__(self, "intervals", intervals)

    @property
    def always(self) -> bool:
        """Whether the person is never absent."""
        return bool((np.isneginf(self.intervals[:, 0]) & np.isposinf(self.intervals[:, 1])).any())

    def at(self, time: ArrayLike) -> Bools:
        """Return whether the person is present at times (...) in seconds, (...)."""
        time = np.asarray(time, float)[..., None]
        return np.asarray(((self.intervals[:, 0] <= time) & (time <= self.intervals[:, 1])).any(axis=-1))


ALWAYS = Presence(np.array([[-np.inf, np.inf]]))
"""Presence of a person who neither comes nor goes."""


def held(values: Floats, present: Bools) -> Floats:
    """Return values (T, ...) of one person in which those of absent times are those of the nearest present time.

    Args:
        values: values over time.
        present: presence over time, (T,); if it is nowhere true, the values are returned as they are.
    """
    known = np.flatnonzero(present)
    if len(known) in (0, len(present)):
        return values
    after = np.searchsorted(known, np.arange(len(present))).clip(0, len(known) - 1)
    before = (after - 1).clip(0)
    rows = np.arange(len(present))
    nearest = np.where(np.abs(known[before] - rows) <= np.abs(known[after] - rows), known[before], known[after])
    return values[nearest]


def presence_at(presence: Sequence[Presence], time: ArrayLike) -> Bools:
    """Return who is present at times (...), (..., P)."""
    time = np.asarray(time, float)
    if not presence:
        return np.zeros((*time.shape, 0), bool)
    return np.stack([each.at(time) for each in presence], axis=-1)


@dataclass(frozen=True)
class Motion:
    """Configuration of one person at T times, interpolated smoothly between them.

    Attributes:
        time: times in seconds, (T,), ascending.
        root: position of the pelvis in metres and orientation as a unit quaternion w x y z, (T, 7).
        angles: joint angles in radians, (T, D), in the order of ``simharness.world.humans.anatomy.DOFS``.

    Raises:
        ValueError: wrong shape, non-finite value, times that do not ascend, or a quaternion that does not have unit
            length.
    """

    time: Floats
    root: Floats
    angles: Floats

    def __post_init__(self) -> None:
        time = as_array(self.time, ("T",), "motion time")
        root = as_array(self.root, (len(time), 7), "motion root")
        angles = as_array(self.angles, (len(time), len(DOFS)), "motion angles")
        check_times(time, "motion")
        check_poses(root, "motion root")
        if not np.isfinite(angles).all():
            bad = int(np.flatnonzero(~np.isfinite(angles).all(axis=1))[0])
            raise ValueError(f"motion angles must be finite; those at index {bad} are not")
        for key, value in (("time", time), ("root", root), ("angles", angles)):
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(self.root)

    def at(self, time: ArrayLike) -> Motion:
        """Return the motion resampled at times (n,), ascending; constant before the first and after the last time."""
        return Motion(np.asarray(time, float), *self.read(time))

    def read(self, time: ArrayLike) -> tuple[Floats, Floats]:
        """Return root (..., 7) and angles (..., D) at any times (...)."""
        return interpolate_poses(self.time, self.root, time), interpolate(self.time, self.angles, time)


PropKind = Literal["chair", "table", "box", "step", "bottle", "booth", "door"]


@dataclass(frozen=True)
class Prop:
    """Object that an activity uses; ``simharness.world.scene.objects.props`` gives it a shape.

    Attributes:
        kind: kind of object.
        size: extent in metres along its x (depth), y (width) and z (height) axes; z of a chair is the height of the
            seat, z of a table the height of the top.
        trajectory: pose over time. The origin is the centre of the underside; a chair faces +x.
    """

    kind: PropKind
    size: tuple[float, float, float]
    trajectory: Trajectory


@dataclass(frozen=True)
class Performance:
    """Motions of the performers of one activity, in their order, and the props that they use.

    ``presence`` are the times at which each performer is in the scene; by default all times.
    """

    motions: tuple[Motion, ...]
    props: tuple[Prop, ...] = ()
    presence: tuple[Presence, ...] = ()

    def __post_init__(self) -> None:
        if not self.presence:
            object.__setattr__(self, "presence", (ALWAYS,) * len(self.motions))
