"""Lookalikes: objects with a human figure (``Solid.figure``), and mirror images of people."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17
from simharness.types.mirror import Mirror
from simharness.world.scene.build import Scene

SURFACE_DEPTH = 0.3  # metres: largest distance of the surface of a figure in front of its joints
_GLASS_DEPTH = 0.03  # metres: the same for the glass of a mirror; its frame stands out slightly
_FLAT = 0.01  # metres: thickness below which a figure is a flat picture


@dataclass(frozen=True)
class Lookalikes:
    """The D lookalikes of a scene: F figures, then for each mirror the images of the P people.

    In a mirror image left and right joints are exchanged, because a detector labels them so.
    """

    names: tuple[str, ...]
    """Names such as "poster0" and "mirror0/person2", (D,)."""
    mesh: NDArray[np.int64]
    """Mesh index of the object among people and solids, as in ``Image.ids``, (D,)."""
    figures: Floats
    """COCO-17 joints of the figures in the world, (F, 17, 3), metres."""
    fronts: Floats
    """Horizontal vectors to the front of flat figures, visible only from there, (F, 3); zeros for the others."""
    mirrors: tuple[Mirror, ...]
    """Glass of the mirrors."""

    @classmethod
    def from_scene(cls, scene: Scene) -> "Lookalikes":
        """Return the lookalikes of a scene."""
        people = len(scene.bodies)
        with_figure = [(people + k, s.name, s.figure) for k, s in enumerate(scene.solids) if s.figure is not None]
        glass = [(people + k, s.name, s.mirror) for k, s in enumerate(scene.solids) if s.mirror is not None]
        figures = np.reshape([figure for *_, figure in with_figure], (-1, len(COCO17), 3))
        return cls(
            names=(
                *(name for _, name, _ in with_figure),
                *(f"{name}/person{p}" for _, name, _ in glass for p in range(people)),
            ),
            mesh=np.array([*(index for index, *_ in with_figure), *np.repeat([i for i, *_ in glass], people)], int),
            figures=figures,
            fronts=np.reshape([_front(figure) for figure in figures], (-1, 3)),
            mirrors=tuple(mirror for *_, mirror in glass),
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def allowed(self) -> Floats:
        """Largest distance of the surface of each lookalike in front of its targets, (D,), metres."""
        figures = len(self.figures)
        return np.repeat([SURFACE_DEPTH, _GLASS_DEPTH], [figures, len(self) - figures])

    def joints(self, people: Floats) -> Floats:
        """Return the apparent positions of the joints of all lookalikes.

        Args:
            people: joints of all people at n times, (n, P, 17, 3), metres.

        Returns:
            Positions, (n, D, 17, 3), metres; those of mirror images are behind the glass.
        """
        if not len(self):
            return people[:, :0]
        still = np.broadcast_to(self.figures, (len(people), *self.figures.shape))
        turned = people[:, :, COCO17.mirror]
        return np.concatenate([still, *(mirror.reflect(turned) for mirror in self.mirrors)], axis=1)

    def exist(self, present: Bools) -> Bools:
        """Return which lookalikes exist, (D,), while the people ``present`` (P,) are in the scene: no one else has a
        mirror image.
        """
        return np.concatenate([np.ones(len(self.figures), bool), *(present for _ in self.mirrors)])

    def targets(self, viewpoint: Floats, joints: Floats) -> tuple[Floats, Bools]:
        """Return the points to which lines of sight from a viewpoint must be free, and whether they exist.

        Occlusion of a person's reflection between the person and the glass is not considered.

        Args:
            viewpoint: position, (3,), metres.
            joints: apparent positions of the joints, (D, 17, 3), metres.

        Returns:
            Points, (D, 17, 3): joints of figures, and intersections with the glass of lines to reflected joints; and
            whether the joint could be visible, (D, 17): false from behind a picture or mirror, and beside the glass.
        """
        count = len(self.figures)
        points, shown = joints.copy(), np.ones(joints.shape[:2], bool)
        if not len(self):
            return points, shown
        flat = np.any(self.fronts, axis=-1)
        ahead = ((viewpoint - self.figures) * self.fronts[:, None]).sum(axis=-1)
        shown[:count] = (ahead > 0) | ~flat[:, None]
        people = (len(self) - count) // max(len(self.mirrors), 1)
        for k, mirror in enumerate(self.mirrors):
            part = slice(count + k * people, count + (k + 1) * people)
            image = joints[part]
            on_glass = shown[part] = mirror.shows(viewpoint, mirror.reflect(image))
            viewer_distance, image_distance = mirror.in_front(viewpoint), -mirror.in_front(image)
            whole = np.where(on_glass, viewer_distance + image_distance, 1.0)
            share = np.where(on_glass, viewer_distance / whole, 1.0)
            points[part] = viewpoint + (image - viewpoint) * share[..., None]
        return points, shown


def _front(figure: Floats) -> Floats:
    """Return the vector (3,) to the front of a flat figure (17, 3); zeros for a solid one."""
    across = figure[5] - figure[6]  # from the right to the left shoulder
    front = np.cross(across, [0.0, 0.0, 1.0])
    front /= np.linalg.norm(front)
    return front if np.ptp(figure @ front) < _FLAT else np.zeros(3)
