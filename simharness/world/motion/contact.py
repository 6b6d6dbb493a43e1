"""Interpenetration of people, measured by MuJoCo with the contact geometry of their bodies."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Bools, Floats
from simharness.world.motion.motion import ALWAYS, Motion, Presence
from simharness.world.motion.poses.kinematics import Addresses, Cast, Kinematics

_FLESH = 0.15  # metres: largest extent of a body beyond the heads of its bones


@dataclass(frozen=True)
class SampledBody:
    """Body of one person at N times, with its bounding rectangles on the floor."""

    person: int
    """Index into the cast."""
    motion: Motion
    """Motion, sampled at these times."""
    low: Floats
    """Lowest x and y of the body, (N, 2) metres."""
    high: Floats
    """Highest x and y of the body, (N, 2) metres."""
    present: Bools
    """Whether the person is in the scene at these times, (N,)."""

    def near(self, other: "SampledBody") -> NDArray[np.intp]:
        """Return the indices of the times at which the bounding rectangles of two people overlap."""
        meet = (self.low < other.high) & (other.low < self.high)
        return np.flatnonzero(meet.all(axis=1))


class ContactModel:
    """Contact between bodies, computed for one pair at a time in a MuJoCo model of the two alone.

    Args:
        cast: bodies, in the order of the people.
    """

    def __init__(self, cast: Cast) -> None:
        self._cast = tuple(cast)
        self._pairs: dict[tuple[int, int], _Pair] = {}

    def sample(self, person: int, motion: Motion, time: ArrayLike, presence: Presence = ALWAYS) -> SampledBody:
        """Return the body of a person at times (N,) in seconds."""
        mover, sampled = self._cast[person], motion.at(time)
        bones = mover.transforms(sampled)[:, :, :2]
        heads = np.matmul(bones[..., :3], mover.body.heads[:, :, None])[..., 0] + bones[..., 3]
        low, high = heads.min(axis=1) - _FLESH, heads.max(axis=1) + _FLESH
        return SampledBody(person, sampled, low, high, presence.at(time))

    def penetration(self, one: SampledBody, other: SampledBody) -> Floats:
        """Return the penetration depth of two people, (N,) metres, 0 where they do not touch.

        It is the depth of the deepest MuJoCo contact between their geometries: the distance by which these would have
        to move to separate.
        """
        depth = np.zeros(len(one.motion))
        near = one.near(other)
        if len(near):
            depth[near] = self._pair(one.person, other.person).depths(one.motion, other.motion, near)
        return depth

    def _pair(self, one: int, other: int) -> "_Pair":
        if (one, other) not in self._pairs:
            self._pairs[one, other] = _Pair(self._cast[one], self._cast[other])
        return self._pairs[one, other]


class _Pair:
    """MuJoCo model of two people."""

    def __init__(self, one: Kinematics, other: Kinematics) -> None:
        spec = mujoco.MjSpec()
        spec.modelname = "pair"
        for prefix, mover in (("one/", one), ("other/", other)):
            spec.attach(mover.spec.copy(), prefix=prefix, frame=spec.worldbody.add_frame())
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._one = Addresses(self._model, one.body, prefix="one/")
        self._other = Addresses(self._model, other.body, prefix="other/")

    def depths(self, one: Motion, other: Motion, rows: NDArray[np.intp]) -> Floats:
        """Return the depth of the deepest contact at rows (n,) of two motions, (n,) metres."""
        depth = np.zeros(len(rows))
        for k, row in enumerate(rows):
            self._one.write(self._data.qpos, one.root[row], one.angles[row])
            self._other.write(self._data.qpos, other.root[row], other.angles[row])
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_collision(self._model, self._data)
            if self._data.ncon:
                depth[k] = max(0.0, -self._data.contact.dist.min())
        return depth
