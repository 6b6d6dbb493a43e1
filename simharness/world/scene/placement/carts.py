"""Carts that move about: each to and fro on a line, or round and round, with people never in its way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.motion.trajectory import Trajectory
from simharness.world.scene.objects.fixtures import draw_cart
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH, LIMB, FreeSpace, Site

_SPEED = (0.35, 0.7)  # m/s, the most on the way
_LINE = (0.4, 2.5)  # metres from the middle of a line to its ends
_ROUND = 0.7  # metres, the least radius
_ON_A_LINE = 0.6  # chance
_ASKEW = 0.2  # radians, standard deviation of a way's bearing about that of a wall
_TRIES = 2000
_PHASES = 24  # of one period, at which what stands is kept clear of
_COARSE = 6  # every sixth moment tells most meetings with people
_LIMBS_REACH = 1.6  # metres from a pelvis to any joint, at most


def place_cart(seed: int, k: int, site: Site) -> Solid:
    """Draw cart k and a way for it.

    At all times for which people are planned it is as far from them as things at rest are, and clear of what stands
    there, of the ways of other carts, of walls and of lenses.

    Raises:
        ValueError: no way is free.
    """
    thing = draw_cart(stream(seed, "clutter", "cart", k))
    rng = stream(seed, "clutter", "cart", k, "way")
    space = site.space
    for _ in range(_TRIES):
        way = _draw_way(rng, space)
        period = way.at(way.period * np.arange(_PHASES) / _PHASES)
        if not all(site.clear(thing.extent.moved(pose[:2], _yaw(pose))) for pose in period):
            continue
        pose = way.at(space.time)
        if not (_meets_people(thing.extent, pose, space, _COARSE) or _meets_people(thing.extent, pose, space, 1)):
            return thing.along(Trajectory(space.time, pose), kind="clutter", name=f"cart{k}")
    raise ValueError(
        f"clutter.carts: no way is free for cart {k} in {_TRIES} tries, among the people, the things and the cameras "
        f"in room.size = {list(space.room.size)}: lower clutter.carts, people.area or people.count, or enlarge "
        "room.size"
    )


@dataclass(frozen=True)
class _Way:
    """A harmonic way about a middle: an ellipse, whose second radius is 0 for a line.

    Attributes:
        middle: (2,) metres.
        bearing: of the first radius, radians.
        radii: metres, (2,).
        period: seconds; negative for clockwise.
        phase: where on it time 0 is, radians.
    """

    middle: Floats
    bearing: float
    radii: Floats
    period: float
    phase: float

    def at(self, time: Floats) -> Floats:
        """Poses (n, 7) at times (n,): on a line the cart keeps facing one way, on a round it faces ahead."""
        angle = 2 * np.pi * time / self.period + self.phase
        c, s = np.cos(self.bearing), np.sin(self.bearing)
        turn = np.array([[c, s], [-s, c]])
        place = self.middle + np.column_stack([np.cos(angle), np.sin(angle)]) * self.radii @ turn
        ahead = np.column_stack([-np.sin(angle), np.cos(angle)]) * self.radii @ turn * np.sign(self.period)
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) if self.radii[1] else np.full(len(time), self.bearing)
        flat = np.zeros(len(time))
        return np.column_stack([place, flat, np.cos(yaw / 2), flat, flat, np.sin(yaw / 2)])


def _draw_way(rng: np.random.Generator, space: FreeSpace) -> _Way:
    on_a_line, speed, sense = rng.uniform() < _ON_A_LINE, rng.uniform(*_SPEED), rng.choice([-1.0, 1.0])
    quarter, askew, phase = rng.integers(4), rng.normal(0.0, _ASKEW), rng.uniform(0, 2 * np.pi)
    share, reach = rng.uniform(-1, 1, 2), rng.uniform(0, 1, 2)
    bearing = float(quarter * np.pi / 2 + askew)
    if on_a_line:
        radii = np.array([_LINE[0] + (_LINE[1] - _LINE[0]) * reach[0] ** 2, 0.0])
        middle = share * space.half
    else:
        radii = _ROUND + np.maximum(space.half - _ROUND, 0) * reach
        middle = share * np.maximum(space.half - radii, 0)
    return _Way(middle, bearing, radii, float(sense * 2 * np.pi * radii.max() / speed), phase)


def _meets_people(extent: Box, pose: Floats, space: FreeSpace, stride: int) -> bool:
    """Whether anyone comes too near to a thing of this extent on its way; every ``stride``-th moment is looked at."""
    pose, pelvises = pose[::stride], space.pelvises[::stride]
    apart = np.linalg.norm(pelvises[..., :2] - pose[:, None, :2], axis=-1)
    n, p = np.nonzero(apart < np.hypot(*extent.half[:2]) + _LIMBS_REACH)
    if _least(extent, pose[n], pelvises[n, p][:, None]) < BODY_HALF_WIDTH:
        return True
    return _least(extent, pose[n], space.joints[::stride][n, p]) < LIMB


def _least(extent: Box, pose: Floats, points: Floats) -> float:
    """Least distance on the floor between a thing in poses (n, 7) and points (n, J, 3)."""
    yaw = np.arctan2(pose[:, 6], pose[:, 3]) * 2
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = np.moveaxis(points[..., :2] - pose[:, None, :2], -1, 0)
    local = np.stack([c * x + s * y, c * y - s * x, np.zeros_like(x)], axis=-1)
    return float(extent.distance_on_floor(local).min(initial=np.inf))


def _yaw(pose: Floats) -> float:
    return float(2 * np.arctan2(pose[6], pose[3]))
