"""Fitted bodies as hierarchies of nodes with rotations over time, the common ground of BVH and glTF."""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.people.people_files import marker_label
from mvpose.recording import People
from mvpose.skeleton_fit import FittedBody

_TIP = 0.05  # metres; length of the end of a limb or of a joint without children, which formats need


@dataclass(frozen=True)
class Hierarchy:
    """Nodes of one person and their motion in all T frames of a recording.

    Before and after the time in which the person is seen, its first and last poses are held.
    """

    identity: int
    """Identity of the person."""
    names: tuple[str, ...]
    """Names of the N nodes, parents before children: segments, then the joints on them as "Nose", "LEye"."""
    parents: tuple[int, ...]
    """Index of the parent of each node, (N,); -1 for the root."""
    offsets: Floats
    """From the parent to the node, (N, 3), metres."""
    tips: Floats
    """From a node without children to its end, (N, 3), metres; NaN for nodes with children."""
    root: Floats
    """Place of the root, (T, 3), metres."""
    rotations: Floats
    """Rotation of every node relative to its parent, (T, N, 3, 3)."""
    seen: slice
    """Frames from the first to the last in which the person is seen."""

    def turned(self, axes: Floats) -> "Hierarchy":
        """Return the hierarchy in other axes of the world: ``axes`` (3, 3) is the rotation to them."""
        rotations = axes @ self.rotations @ axes.T
        parts = (self.offsets @ axes.T, self.tips @ axes.T, self.root @ axes.T, rotations)
        return Hierarchy(self.identity, self.names, self.parents, *parts, self.seen)

    def children(self, node: int) -> list[int]:
        """Return the children of a node."""
        return [child for child, parent in enumerate(self.parents) if parent == node]


def hierarchy(fit: FittedBody, people: People) -> Hierarchy:
    """Return the nodes of a fitted body, with z up, in all frames of its recording."""
    body, pose = fit.body, fit.pose
    attached = [row for row, centre in enumerate(body.centres) if not centre]
    names = (*(each.name for each in body.segments), *(marker_label(body.joints[row]) for row in attached))
    parents = (*body.parents, *(body.carriers[row] for row in attached))
    bones = np.array([*(each.bone for each in body.segments), *[(1.0, 0.0, 0.0)] * len(attached)])
    tips = _TIP * bones
    tips[[parent for parent in parents if parent >= 0]] = np.nan
    frames = np.clip(np.arange(people.frames) - fit.first, 0, len(fit.times) - 1)
    rotations = np.broadcast_to(np.eye(3), (people.frames, len(names), 3, 3)).copy()
    rotations[:, : len(body.segments)] = pose.rotations[frames]
    offsets = np.concatenate([body.offsets, body.places[attached]])
    seen = slice(fit.first, fit.first + len(fit.times))
    return Hierarchy(fit.identity, names, parents, offsets, tips, pose.root[frames], rotations, seen)
