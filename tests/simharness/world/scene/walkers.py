"""Shared by tests of furnished rooms: people who walk in circles, cameras around them, and MuJoCo rays."""

import mujoco
import numpy as np

from mvpose import Camera, Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.world.motion.motion import motion_clock
from simharness.world.scene.placement.free_space import FreeSpace

# fmt: off
STANDING = np.array(
    [
        (.10, 0, 1.60), (.08, .03, 1.63), (.08, -.03, 1.63), (0, .07, 1.60), (0, -.07, 1.60), (0, .18, 1.42),
        (0, -.18, 1.42), (0, .22, 1.14), (0, -.22, 1.14), (.05, .24, .90), (.05, -.24, .90), (0, .09, .93),
        (0, -.09, .93), (.02, .09, .50), (.02, -.09, .50), (0, .09, .08), (0, -.09, .08),
    ]
)
# fmt: on


def crowd(count: int, duration: float, area: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (N,), pelvises (N, P, 3) and joints (N, P, 17, 3)."""
    rng, time = np.random.default_rng(seed), motion_clock(duration, margin=1.0)
    pelvises, joints = np.zeros((len(time), count, 3)), np.zeros((len(time), count, 17, 3))
    for k in range(count):
        middle, radius = rng.uniform(-1, 1, 2) * (area - 0.6), rng.uniform(0, 0.6)
        angle = rng.choice([-1, 1]) * rng.uniform(0.5, 1.2) * time + rng.uniform(0, 6)
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        pelvises[:, k] = np.column_stack([middle[0] + radius * c, middle[1] + radius * s, np.full(len(time), 0.93)])
        x, y, z = STANDING.T
        local = np.stack([-s * x - c * y, c * x - s * y, np.broadcast_to(z, (len(time), 17))], axis=-1)
        joints[:, k] = local + pelvises[:, k, None] * [1, 1, 0]
    return time, pelvises, joints


def ring(count: int = 5, *, radius: float = 3.5, height: float = 2.2) -> Rig:
    cameras = []
    for k, bearing in enumerate(2 * np.pi * np.arange(count) / count):
        center = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
        ahead = np.array([0, 0, 0.9]) - center
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(ahead, right), ahead])
        K = np.array([[520.0, 0, 399.5], [0, 520.0, 299.5], [0, 0, 1]])
        cameras.append(Camera(K=K, R=R, t=-R @ center, size=(800, 600), name=f"cam{k}"))
    return Rig(cameras)


def space(
    people: int = 4, *, duration: float = 6.0, area: float = 2.0, seed: int = 0, room=None, rig=None
) -> FreeSpace:
    return FreeSpace(room or RoomSection(), area, *crowd(people, duration, area, seed), rig or ring())


class Rays:
    """Rays of MuJoCo against the geoms of solids."""

    def __init__(self, solids) -> None:
        spec = mujoco.MjSpec()
        for solid in solids:
            solid.add_to(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._moving = [solid for solid in solids if solid.trajectory is not None]
        self.put(0.0)

    def put(self, time: float) -> None:
        for solid in self._moving:
            k = self.model.body(solid.name).mocapid[0]
            pose = solid.trajectory.at(time)
            self.data.mocap_pos[k], self.data.mocap_quat[k] = pose[:3], pose[3:]
        mujoco.mj_kinematics(self.model, self.data)

    def distance(self, start, ends) -> np.ndarray:
        """Return where the first geom is on the way to each end (n, 3), 0..1; inf without a hit."""
        ways = np.ascontiguousarray(ends - start, float)
        hits, geoms = np.zeros(len(ways)), np.zeros(len(ways), np.int32)
        for n, way in enumerate(ways):
            geom = np.zeros(1, np.int32)
            hits[n] = mujoco.mj_ray(self.model, self.data, np.array(start, float), way, None, 1, -1, geom)
            geoms[n] = geom[0]
        return np.where((geoms >= 0) & (hits <= 1), hits, np.inf)
