"""MocapSkeleton and joint rotations of a motion file."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers

END = " end"  # suffix of a joint name: tip of its bone, a joint without rotation


@dataclass(frozen=True)
class MocapSkeleton:
    """MocapSkeleton of J joints, the root first and parents before children. The zero pose has no rotations.

    Attributes:
        names: unique names of the joints.
        parents: index of each parent, (J,), -1 for the root.
        offsets: vectors from the parent to the joint in the zero pose, (J, 3), in the length unit of the file.
    """

    names: tuple[str, ...]
    parents: Integers
    offsets: Floats

    def __len__(self) -> int:
        return len(self.names)

    @property
    def zero(self) -> Floats:
        """Positions of the joints in the zero pose with the root at the origin, (J, 3)."""
        places = np.zeros((len(self), 3))
        for joint in range(1, len(self)):
            places[joint] = places[self.parents[joint]] + self.offsets[joint]
        return places

    def ancestors(self, joint: int) -> list[int]:
        """Return the joint, its parent and so on to the root."""
        line = [joint]
        while self.parents[line[-1]] >= 0:
            line.append(int(self.parents[line[-1]]))
        return line

    def children(self, joint: int) -> list[int]:
        """Return the children of a joint."""
        return np.flatnonzero(self.parents == joint).tolist()


@dataclass(frozen=True)
class RecordedMotion:
    """Recorded motion of a skeleton in N frames.

    Attributes:
        file: name of the file.
        skeleton: skeleton with J joints.
        rate: frames per second.
        root: position of the root in every frame, (N, 3), in the length unit of the file.
        turns: rotation of every joint relative to its parent, (N, J, 4) quaternions w x y z.
    """

    file: str
    skeleton: MocapSkeleton
    rate: float
    root: Floats
    turns: Floats

    def __len__(self) -> int:
        return len(self.root)

    @property
    def duration(self) -> float:
        """Time from the first frame to the last, seconds."""
        return (len(self) - 1) / self.rate

    def pose(self) -> tuple[Floats, Floats]:
        """Return positions (N, J, 3) of the joints and their rotations relative to the zero pose, (N, J, 3, 3)."""
        count = len(self.skeleton)
        local = Rotation.from_quat(self.turns.reshape(-1, 4), scalar_first=True).as_matrix().reshape(-1, count, 3, 3)
        places, turns = np.empty((len(self), count, 3)), np.empty_like(local)
        places[:, 0], turns[:, 0] = self.root, local[:, 0]
        for joint in range(1, count):
            parent = self.skeleton.parents[joint]
            places[:, joint] = places[:, parent] + turns[:, parent] @ self.skeleton.offsets[joint]
            turns[:, joint] = turns[:, parent] @ local[:, joint]
        return places, turns


def lowest_common_ancestor(skeleton: MocapSkeleton, first: int, second: int) -> int:
    """Return the nearest joint that is an ancestor of both."""
    above = set(skeleton.ancestors(first))
    return next(joint for joint in skeleton.ancestors(second) if joint in above)
