"""Forward kinematics of a body, and the derivatives of its joints."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.rotations import to_matrices


@dataclass(frozen=True)
class Pose:
    """Poses of a body in T frames."""

    body: ArticulatedBody
    """The body with S segments and M joints."""
    root: Floats
    """Origin of the root segment, (T, 3), metres."""
    rotations: Floats
    """Rotation of every segment relative to its parent, (T, S, 3, 3); that of the root relative to the world."""

    @cached_property
    def frames(self) -> tuple[Floats, Floats]:
        """Rotations of the segments in the world, (T, S, 3, 3), and their origins, (T, S, 3)."""
        turned, origins = np.empty_like(self.rotations), np.empty(self.rotations.shape[:3])
        for segment, parent in enumerate(self.body.parents):
            if parent < 0:
                turned[:, segment], origins[:, segment] = self.rotations[:, segment], self.root
                continue
            turned[:, segment] = turned[:, parent] @ self.rotations[:, segment]
            origins[:, segment] = origins[:, parent] + turned[:, parent] @ self.body.offsets[segment]
        return turned, origins

    @cached_property
    def joints(self) -> Floats:
        """Places of the joints in the world, (T, M, 3), metres."""
        turned, origins = self.frames
        carriers = list(self.body.carriers)
        return origins[:, carriers] + np.einsum("tmij,mj->tmi", turned[:, carriers], self.body.places)


@dataclass(frozen=True)
class Freedom:
    """Axes about which a body can turn: D rotations, after the three translations of the root."""

    body: ArticulatedBody
    """The body."""
    segments: Integers
    """Segment of each axis, (D,)."""
    axes: Floats
    """The axes in the frames of their segments, (D, 3)."""

    @classmethod
    def of_body(cls, body: ArticulatedBody) -> "Freedom":
        """Return all axes of a body."""
        pairs = [(k, axis) for k, segment in enumerate(body.segments) for axis in segment.axes]
        return cls(body, np.array([k for k, _ in pairs]), np.array([axis for _, axis in pairs]))

    def __len__(self) -> int:
        return 3 + len(self.segments)

    @cached_property
    def moving(self) -> tuple[Integers, Integers]:
        """Pairs of a joint and an axis that moves it, each (k,)."""
        carriers = self.body.carriers
        lines = [set(self.body.ancestors(carrier)) for carrier in carriers]
        # A joint in the origin of its segment does not move when the segment turns.
        fixed = [carrier if centre else -1 for carrier, centre in zip(carriers, self.body.centres, strict=True)]
        pairs = [
            (joint, axis)
            for joint, line in enumerate(lines)
            for axis, segment in enumerate(self.segments.tolist())
            if segment in line and segment != fixed[joint]
        ]
        joints, axes = np.array(pairs).T
        return joints, axes

    def jacobian(self, pose: Pose) -> Floats:
        """Return the derivatives of the joints, (T, M, 3, 3 + D), metres per metre and per radian.

        A segment turns by a small angle d about its own axis a: R becomes R exp(d a).
        """
        turned, origins = pose.frames
        joints, axes = self.moving
        segments = self.segments[axes]
        world = np.einsum("tdij,dj->tdi", turned[:, self.segments], self.axes)
        arms = pose.joints[:, joints] - origins[:, segments]
        result = np.zeros((len(pose.root), len(self.body.joints), 3, len(self)))
        result[..., :3] = np.eye(3)
        result[:, joints, :, 3 + axes] = np.cross(world[:, axes], arms).swapaxes(0, 1)
        return result

    def moved(self, pose: Pose, steps: Floats, turns: Floats) -> Pose:
        """Return poses after steps of the root (T, 3) and turns (T, D), radians."""
        vectors = np.zeros((*pose.rotations.shape[:2], 3))
        for axis, segment in enumerate(self.segments.tolist()):
            vectors[:, segment] += turns[:, axis, None] * self.axes[axis]
        return Pose(pose.body, pose.root + steps, pose.rotations @ to_matrices(vectors))
