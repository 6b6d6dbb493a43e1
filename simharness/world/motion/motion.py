"""Motion of one person (pelvis pose and joint angles over time), and motions and props of one activity.

Trajectories of rigid objects, such as props, are sampled poses and their smooth interpolation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from mvpose.checks import set_arrays
from simharness.world.humans.anatomy import DOFS

RATE = 60.0  # Hz: planning rate of motions, which are read at any time: frames and cameras have separate clocks
_UNIT_TOLERANCE = 1e-6


def motion_clock(duration: float, *, margin: float = 0.0) -> Floats:
    """Return the times (N,) in seconds at which motions are planned.

    They cover ``-margin`` to ``duration + margin`` and contain 0. ``margin`` is the largest offset of a camera clock in
    seconds.
    """
    before = int(np.ceil(margin * RATE)) + 1
    after = int(np.ceil((duration + margin) * RATE)) + 1
    return np.arange(-before, after + 1) / RATE


@dataclass(frozen=True)
class Trajectory:
    """Poses of one rigid object at N times.

    Raises:
        ValueError: wrong shape, non-finite value, times that do not ascend, or a quaternion that does not have unit
            length.
    """

    time: Floats
    """Times in seconds, (N,), ascending; a single time means an object that stands still."""
    pose: Floats
    """Position in metres and orientation as a unit quaternion w x y z, (N, 7)."""

    def __post_init__(self) -> None:
        set_arrays(self, "trajectory ", time=("N",), pose=("N", 7))
        check_times(self.time, "trajectory")
        check_poses(self.pose, "trajectory pose")

    def __len__(self) -> int:
        return len(self.time)

    def at(self, time: ArrayLike) -> Floats:
        """Return poses (..., 7) at times (...); constant before the first and after the last time."""
        return interpolate_poses(self.time, self.pose, time)


def interpolate(time: Floats, values: Floats, when: ArrayLike) -> Floats:
    """Interpolate ``values`` (N, D) at ``time`` (N,) smoothly to the times ``when`` (...); returns (..., D).

    Cubic Hermite interpolation with central differences (Catmull and Rom, 1974): velocity is continuous, and the
    support is local, so that a curve does not depend on its total length. Values are constant beyond both ends.
    """
    when = np.asarray(np.clip(when, time[0], time[-1]), float)
    if len(time) == 1:
        return np.broadcast_to(values[0], (*when.shape, values.shape[1])).copy()
    k = np.clip(np.searchsorted(time, when, side="right") - 1, 0, len(time) - 2)
    before, after = np.maximum(k - 1, 0), np.minimum(k + 2, len(time) - 1)
    step = (time[k + 1] - time[k])[..., None]
    start, end = values[k], values[k + 1]
    leaving = step * (end - values[before]) / (time[k + 1] - time[before])[..., None]
    arriving = step * (values[after] - start) / (time[after] - time[k])[..., None]
    s = (when - time[k])[..., None] / step
    turn = s - 1
    return (1 + 2 * s) * turn**2 * start + s * turn**2 * leaving + s**2 * (3 - 2 * s) * end + s**2 * turn * arriving


def interpolate_poses(time: Floats, pose: Floats, when: ArrayLike) -> Floats:
    """Interpolate poses (N, 7) as :func:`interpolate` does; quaternions w x y z take the shorter arc and stay unit."""
    flips = np.where((pose[1:, 3:] * pose[:-1, 3:]).sum(axis=1) < 0, -1.0, 1.0)
    signs = np.concatenate([np.ones(min(len(pose), 1)), np.cumprod(flips)])
    steady = np.concatenate([pose[:, :3], pose[:, 3:] * signs[:, None]], axis=1)
    result = interpolate(time, steady, when)
    result[..., 3:] /= np.linalg.norm(result[..., 3:], axis=-1, keepdims=True)
    return result


def upright_poses(place: Floats, bearing: ArrayLike) -> Floats:
    """Return poses (..., 7) on the floor, at places (..., 2) in metres and turned to bearings (...) in radians."""
    half = np.asarray(bearing, float)[..., None] / 2
    flat = np.zeros_like(half)
    return np.concatenate([place, flat, np.cos(half), flat, flat, np.sin(half)], axis=-1)


def transform_points(points: NDArray[np.floating], pose: Floats) -> Floats:
    """Transform points (n, 3) from an object's frame, given by its pose (7,), to the world."""
    turn = Rotation.from_quat(pose[3:], scalar_first=True).as_matrix()
    return np.asarray(points @ turn.T + pose[:3])


def check_times(time: Floats, what: str) -> None:
    """Raise ValueError for times that are empty, not finite, or do not ascend."""
    if not len(time) or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise ValueError(f"{what} time must be one or more finite seconds, ascending, got {time[:5].tolist()}...")


def check_poses(pose: Floats, what: str) -> None:
    """Raise ValueError for poses (N, 7) that are not finite or have quaternions that do not have unit length."""
    _check_finite(pose, what)
    off = np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1.0)
    if (off > _UNIT_TOLERANCE).any():
        raise ValueError(
            f"{what} quaternions (w x y z) must have unit length, the one at index {int(off.argmax())} is off by "
            f"{off.max():.2g}"
        )


def _check_finite(values: Floats, what: str) -> None:
    """Raise ValueError for values (N, D) that are not finite."""
    if not np.isfinite(values).all():
        bad = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise ValueError(f"{what} must be finite; the one at index {bad} is not")


@dataclass(frozen=True)
class Presence:
    """Times at which a person is in the scene, as closed intervals; at all other times the person is absent.

    Raises:
        ValueError: a wrong shape, or stays that overlap or end before they start.
    """

    intervals: Floats
    """Start and end of each stay, (n, 2) seconds, ascending; infinite for a stay without start or end."""

    def __post_init__(self) -> None:
        set_arrays(self, "presence ", intervals=("n", 2))
        if np.isnan(self.intervals).any() or (np.diff(self.intervals.ravel()) < 0).any():
            raise ValueError(f"presence intervals must be ascending seconds, got {self.intervals.tolist()}")

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

    Raises:
        ValueError: wrong shape, non-finite value, times that do not ascend, or a quaternion that does not have unit
            length.
    """

    time: Floats
    """Times in seconds, (T,), ascending."""
    root: Floats
    """Position of the pelvis in metres and orientation as a unit quaternion w x y z, (T, 7)."""
    angles: Floats
    """Joint angles in radians, (T, D), in the order of ``simharness.world.humans.anatomy.DOFS``."""

    def __post_init__(self) -> None:
        set_arrays(self, "motion ", time=("T",), root=("T", 7), angles=("T", len(DOFS)))
        check_times(self.time, "motion")
        check_poses(self.root, "motion root")
        _check_finite(self.angles, "motion angles")

    def __len__(self) -> int:
        return len(self.root)

    def at(self, time: ArrayLike) -> "Motion":
        """Return the motion resampled at times (n,), ascending; constant before the first and after the last time."""
        return Motion(np.asarray(time, float), *self.read(time))

    def read(self, time: ArrayLike) -> tuple[Floats, Floats]:
        """Return root (..., 7) and angles (..., D) at any times (...)."""
        return interpolate_poses(self.time, self.root, time), interpolate(self.time, self.angles, time)


PropKind = Literal["chair", "table", "box", "step", "bottle", "booth", "door"]


@dataclass(frozen=True)
class Prop:
    """Object that an activity uses; ``simharness.world.scene.objects.laboratory`` gives it a shape."""

    kind: PropKind
    """Kind of object."""
    size: tuple[float, float, float]
    """Extent in metres along its x (depth), y (width) and z (height) axes; z of a chair is the height of the seat, z of
    a table the height of the top."""
    trajectory: Trajectory
    """Pose over time. The origin is the centre of the underside; a chair faces +x."""

    @classmethod
    def at_rest(cls, kind: PropKind, size: tuple[float, float, float], place: Floats, bearing: float) -> "Prop":
        """Return the prop that stands at a place (2,) on the floor, turned to a bearing."""
        return cls(kind, size, Trajectory(np.zeros(1), upright_poses(place, bearing)[None]))


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
