"""What looks like a person and is none: figures on things (``Solid.figure``), and everyone in every mirror."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17
from simharness.types.mirror import Mirror

if TYPE_CHECKING:
    from simharness.world.scene.build import Scene


OWN_SURFACE = 0.3  # metres: a figure's own surface may lie so far in front of its joints
_GLASS = 0.03  # metres: the same of a mirror's glass, whose frame stands out a little
_FLAT = 0.01  # metres, the thickness of a figure below which it is a picture


@dataclass(frozen=True)
class Lookalikes:
    """The D things of a scene that look like people: F figures, then the P people in one mirror after the other.

    In a mirror left and right change sides, as they do to a detector.

    Attributes:
        names: "poster0", "mirror0/person2", (D,).
        mesh: index of the thing among people and solids, as ``Image.ids`` has it, (D,).
        figures: COCO-17 joints in the world, (F, 17, 3), metres.
        fronts: horizontal vectors to the front of figures that are seen from there alone, (F, 3); zeros of the others.
        mirrors: the glass of the mirrors.
    """

    names: tuple[str, ...]
    mesh: NDArray[np.int64]
    figures: Floats
    fronts: Floats
    mirrors: tuple[Mirror, ...]

    @classmethod
    def of(cls, scene: Scene) -> Lookalikes:
        """Those of a scene."""
        people = len(scene.bodies)
        found = [(people + k, s.name, s.figure) for k, s in enumerate(scene.solids) if s.figure is not None]
        glass = [(people + k, s.name, s.mirror) for k, s in enumerate(scene.solids) if s.mirror is not None]
        figures = np.reshape([figure for *_, figure in found], (-1, len(COCO17), 3))
        return cls(
            names=(*(name for _, name, _ in found), *(f"{n}/person{p}" for _, n, _ in glass for p in range(people))),
            mesh=np.array([*(index for index, *_ in found), *np.repeat([i for i, *_ in glass], people)], int),
            figures=figures,
            fronts=np.reshape([_front(figure) for figure in figures], (-1, 3)),
            mirrors=tuple(mirror for *_, mirror in glass),
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def allowed(self) -> Floats:
        """How far in front of a target its own surface may be, (D,), metres."""
        figures = len(self.figures)
        return np.repeat([OWN_SURFACE, _GLASS], [figures, len(self) - figures])

    def joints(self, people: Floats) -> Floats:
        """Where their joints appear to be.

        Args:
            people: joints of everyone in n moments, (n, P, 17, 3), metres.

        Returns:
            (n, D, 17, 3) metres; of people in mirrors behind the glass.
        """
        if not len(self):
            return people[:, :0]
        still = np.broadcast_to(self.figures, (len(people), *self.figures.shape))
        turned = people[:, :, COCO17.mirror]
        return np.concatenate([still, *(mirror.reflect(turned) for mirror in self.mirrors)], axis=1)

    def targets(self, eye: Floats, joints: Floats) -> tuple[Floats, Bools]:
        """What of them an eye could see, and where it must look unhindered for it.

        Whom and what a person's reflection is hidden by in the mirror, between person and glass, is not looked at.

        Args:
            eye: metres, (3,).
            joints: where they appear to be, (D, 17, 3), metres.

        Returns:
            Points (D, 17, 3): the joints of figures, and where the ways to reflected joints meet the glass; and whether
            there is anything to see, (D, 17): not from behind a picture or a mirror, nor beside the glass.
        """
        count = len(self.figures)
        points, shown = joints.copy(), np.ones(joints.shape[:2], bool)
        if not len(self):
            return points, shown
        flat = np.any(self.fronts, axis=-1)
        ahead = ((eye - self.figures) * self.fronts[:, None]).sum(axis=-1)
        shown[:count] = (ahead > 0) | ~flat[:, None]
        for mirror, (image, point, there) in zip(self.mirrors, self._in_mirrors(joints, points, shown), strict=True):
            there[:] = mirror.shows(eye, mirror.reflect(image))
            mine, theirs = mirror.in_front(eye), -mirror.in_front(image)
            share = np.where(there, mine / np.where(there, mine + theirs, 1.0), 1.0)
            point[:] = eye + (image - eye) * share[..., None]
        return points, shown

    def _in_mirrors(self, *arrays: NDArray) -> list[tuple[NDArray, ...]]:
        """For each mirror its part of arrays (D, ...), to be written to."""
        first, mirrors = len(self.figures), len(self.mirrors)
        people = (len(self) - first) // max(mirrors, 1)
        parts = [slice(first + m * people, first + (m + 1) * people) for m in range(mirrors)]
        return [tuple(array[part] for array in arrays) for part in parts]


def _front(figure: Floats) -> Floats:
    """Of a figure (17, 3) on a sheet a vector (3,) to its front; zeros of one in the round."""
    across = figure[5] - figure[6]  # to the left
    front = np.cross(across, [0.0, 0.0, 1.0])
    front /= np.linalg.norm(front)
    return front if np.ptp(figure @ front) < _FLAT else np.zeros(3)
