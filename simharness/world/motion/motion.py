"""Motion of one person (pelvis pose and joint angles over time), and motions and props of one activity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.checks import as_array
from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.presence import ALWAYS, Presence
from simharness.world.motion.trajectory import Trajectory, check_poses, check_times, interpolate, interpolate_poses


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
