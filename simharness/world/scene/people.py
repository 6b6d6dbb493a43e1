"""People of a scene as they are before they move: dressed body, kinematics and visible mesh.

They depend on their shape and look alone and take half of the time in which a scene is built. Scenes that differ in
cameras, clutter, faults or detector have the same people, so a process keeps the people whom it made last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.accessories import plain, wear
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.figure import figure_mesh
from simharness.world.humans.population import draw_shape, is_child
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import Look
from simharness.world.motion.poses.kinematics import Kinematics

_KEPT = 24  # people, about 5 MB each: those of a scene and of the next ones


@dataclass(frozen=True)
class Person:
    """One person in the rest pose. Several scenes may share it, so its arrays are never changed.

    Attributes:
        look: clothes, hair and accessories.
        body: dressed body with accessories.
        mover: kinematics of the body of the plain look (:func:`~simharness.world.humans.accessories.plain`). Poses are
            computed in its MuJoCo data, so threads must not share it.
    """

    look: Look
    body: Body
    mover: Kinematics

    @cached_property
    def figure(self) -> Mesh:
        """Visible mesh of body and clothing in the rest pose."""
        return figure_mesh(self.body, self.look)


@lru_cache(maxsize=_KEPT)
def make_person(shape: Shape, look: Look) -> Person:
    """Return the person of a shape and look, made once in a process."""
    bare, simple = make_body(shape), plain(look)
    moved = dress(bare, simple)
    same = (look.hat, look.hair_style) == (simple.hat, simple.hair_style)
    return Person(look, wear(moved if same else dress(bare, look), look), Kinematics(moved))


@lru_cache(maxsize=_KEPT)
def shape_of_person(seed: int, person: int, children: float) -> Shape:
    """Return the shape of a person of a scene, drawn from the streams of that person.

    Args:
        seed: seed of the scene.
        person: index of the person.
        children: share of people who are children, 0 to 1.
    """
    return draw_shape(stream(seed, "people", person, "shape"), child=is_child(seed, person, children))
