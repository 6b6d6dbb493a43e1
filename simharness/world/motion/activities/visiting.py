"""Activity "visit": coming in, walking from place to place, and going out again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats
from simharness.world.motion.activities.route_walking import walk_route
from simharness.world.motion.activity_registry import activity
from simharness.world.motion.motion import Performance
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.routes import Route


@activity("visit", track=Route)
def visit(
    performers: Sequence[Kinematics], route: Route, time: Floats, *, rng: np.random.Generator, pace: float
) -> Performance:
    """Walk along a route and stand where it stops; absent where the route is outside of the room."""
    (mover,) = performers
    return Performance((walk_route(mover, route, time, rng=rng, pace=pace),), presence=(route.presence,))
