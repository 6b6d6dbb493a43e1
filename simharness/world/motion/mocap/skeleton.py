"""What a motion file holds: a skeleton of joints, and how they were turned in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers

END = " end"  # after the name of a joint: the tip of its bone, a joint that does not turn


@dataclass(frozen=True)
class Skeleton:
    """J joints, parents before children, the root first. In the zero pose no joint is turned.

    Attributes:
        names: of the joints, no two alike.
        parents: (J,), -1 for the root.
        offsets: from the parent to the joint in the zero pose, (J, 3), the file's unit of length.
    """

    names: tuple[str, ...]
    parents: Integers
    offsets: Floats

    def __len__(self) -> int:
        return len(self.names)

    @property
    def zero(self) -> Floats:
        """Places of the joints in the zero pose, the root at the origin, (J, 3)."""
        places = np.zeros((len(self), 3))
        for joint in range(1, len(self)):
            places[joint] = places[self.parents[joint]] + self.offsets[joint]
        return places

    def ancestors(self, joint: int) -> list[int]:
        """The joint, its parent and so on to the root."""
        line = [joint]
        while self.parents[line[-1]] >= 0:
            line.append(int(self.parents[line[-1]]))
        return line

    def children(self, joint: int) -> list[int]:
        """The joints whose parent it is."""
        return np.flatnonzero(self.parents == joint).tolist()


@dataclass(frozen=True)
class Recording:
    """N frames of a skeleton.

    Attributes:
        file: its name.
        skeleton: J joints.
        rate: frames a second.
        root: place of the root in every frame, (N, 3), the file's unit of length.
        turns: of every joint against its parent, (N, J, 4) quaternions w x y z.
    """

    file: str
    skeleton: Skeleton
    rate: float
    root: Floats
    turns: Floats

    def __len__(self) -> int:
        return len(self.root)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.rate

    def pose(self) -> tuple[Floats, Floats]:
        """Forward kinematics: places (N, J, 3) of the joints, and their turns against the zero pose (N, J, 3, 3)."""
        count = len(self.skeleton)
        local = Rotation.from_quat(self.turns.reshape(-1, 4), scalar_first=True).as_matrix().reshape(-1, count, 3, 3)
        places, turns = np.empty((len(self), count, 3)), np.empty_like(local)
        places[:, 0], turns[:, 0] = self.root, local[:, 0]
        for joint in range(1, count):
            parent = self.skeleton.parents[joint]
            places[:, joint] = places[:, parent] + turns[:, parent] @ self.skeleton.offsets[joint]
            turns[:, joint] = turns[:, parent] @ local[:, joint]
        return places, turns


def lowest_common_ancestor(skeleton: Skeleton, first: int, second: int) -> int:
    """The joint that carries both."""
    above = set(skeleton.ancestors(first))
    return next(joint for joint in skeleton.ancestors(second) if joint in above)
