"""Motions and props of one activity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from simharness.world.motion.motion import Motion
from simharness.world.motion.presence import ALWAYS, Presence
from simharness.world.motion.trajectory import Trajectory

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
