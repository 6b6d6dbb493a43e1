"""Bodies for tests with several people; each is made once, because fitting a body is slow."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import ARM, DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.contact import ContactModel
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.inverse_kinematics import shoulder_girdle
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


def penetration(cast: Sequence[Kinematics], motions: Sequence[Motion], time: ArrayLike) -> Floats:
    """Return the penetration depth of every pair at times (N,), (N, P, P) metres; see :class:`ContactModel`."""
    crowd = ContactModel(cast)
    people = [crowd.sample(person, motion, time) for person, motion in enumerate(motions)]
    depth = np.zeros((np.size(time), len(people), len(people)))
    for one, other in combinations(people, 2):
        depth[:, one.person, other.person] = depth[:, other.person, one.person] = crowd.penetration(one, other)
    return depth


def palm_pose(kinematics: Kinematics, motion: Motion, side: str) -> tuple[Floats, Floats]:
    """Return orientation (T, 3, 3) and position (T, 3) in metres of the centre of a palm; see ``Kinematics.arms``."""
    base, origin = shoulder_girdle(kinematics, motion, side)
    columns = [DOFS.index(f"{side}_{name}") for name in ARM]
    turn, place = kinematics.arms[side].forward(motion.angles[:, columns])
    return base @ turn, (base @ place[..., None])[..., 0] + origin
