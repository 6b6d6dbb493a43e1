"""Bodies for tests with several people; each is made once, because fitting a body is slow."""

from functools import cache

import numpy as np

from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.poses.kinematics import Kinematics


@cache
def performer(k: int, *, child: bool = False) -> Kinematics:
    """Return the body of a person, always the same for the same number."""
    return Kinematics(make_body(draw_shape(stream(k, "casting"), child=child)))


def foot_vertices(mover: Kinematics) -> dict[str, np.ndarray]:
    """Return the mask of the skin vertices of the foot, by side."""
    body = mover.body
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    return {
        side: np.isin(most, [body.index(f"{side}Foot"), body.index(f"{side}ToeBase")]) for side in ("Left", "Right")
    }
