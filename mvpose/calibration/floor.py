"""The floor on which people stand, and a world whose z axis points up from it.

Pictures do not show how a world is turned. The lower foot of people who walk is on the floor; trunks are upright more
often than not, and say which side is up, and how the floor lies along directions in which nobody went.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.calibration.rig_size import Bodies
from mvpose.camera import Rig
from mvpose.reconstruction.bone_length_prior import STATURE

ANKLE = 0.08
"""Height of the ankle of a foot on the floor, metres (lateral malleolus: Gordon et al., ANSUR II, 2014)."""

_HIP = 0.53 * STATURE  # metres: height of the hips of an adult who stands (Drillis & Contini, 1966)
_TOGETHER = 5  # bodies of a person, a fifth of a second apart, that count as one foothold: errors last for a second
_FEWEST = 8  # footholds
_LEAN = np.radians(5.0)  # standard deviation of the mean direction of trunks from the vertical
_SCATTER = 0.03  # metres: standard deviation of the height of a foothold; larger ones count less
_ALIGNED = 0.7  # length of the mean of unit vectors along trunks, below which people do not stand


@dataclass(frozen=True)
class FloorPlane:
    """The floor in the world of a rig."""

    up: Floats
    """Unit vector away from it, (3,)."""
    origin: Floats
    """Point on it amid the people, (3,), metres."""
    feet: int
    """Footholds that show it; 0 where only trunks do."""

    def leveled(self, rig: Rig) -> Rig:
        """Return the rig in a world with its origin on the floor, z up, and x to the right of the first camera."""
        right = rig[0].R[0] - (rig[0].R[0] @ self.up) * self.up
        right /= np.linalg.norm(right)
        world = np.stack([right, np.cross(self.up, right), self.up])
        turned = [camera.R @ world.T for camera in rig]
        centers = (rig.centers - self.origin) @ world.T
        return Rig([replace(c, R=R, t=-R @ x) for c, R, x in zip(rig, turned, centers, strict=True)])


def floor_of(bodies: Bodies) -> FloorPlane | None:
    """Return the floor, or None where people do not show which way is up.

    Args:
        bodies: people in frames a fifth of a second apart, metres.
    """
    trunks = bodies.upright
    if not len(trunks) or np.linalg.norm(trunks.mean(axis=0)) < _ALIGNED:
        return None
    along = trunks.mean(axis=0) / np.linalg.norm(trunks.mean(axis=0))
    frame = Rotation.align_vectors([[0.0, 0.0, 1.0]], along[None])[0].as_matrix()
    hips = bodies.middle("hip") @ frame.T
    middle = np.nanmedian(hips, axis=0)
    holds = _footholds(bodies, frame)
    if len(holds) < _FEWEST:
        sole = middle - [0.0, 0.0, _HIP]
        return FloorPlane(along, frame.T @ sole, 0)

    def residuals(plane: Floats) -> Floats:
        height = (holds[:, 2] - ANKLE - plane[2] - (holds[:, :2] - middle[:2]) @ plane[:2]) / _SCATTER
        return np.append(np.sign(height) * np.sqrt(np.log1p(height**2)), plane[:2] / _LEAN)  # Cauchy's weights

    start = np.array([0.0, 0.0, np.median(holds[:, 2]) - ANKLE])
    a, b, c = least_squares(residuals, start).x
    up = np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)
    return FloorPlane(frame.T @ up, frame.T @ np.array([*middle[:2], c]), len(holds))


def _footholds(bodies: Bodies, frame: Floats) -> Floats:
    """Return the median places of lower ankles over a second of a person each, (m, 3), in axes with z about up."""
    ankles = np.stack([bodies.joint(f"{side}_ankle") @ frame.T for side in ("left", "right")])
    both = np.isfinite(ankles[..., 2]).all(axis=0)
    lower = np.where(ankles[0, :, 2] < ankles[1, :, 2], 0, 1)
    holds = ankles[lower, np.arange(len(lower))]
    result = []
    for person in np.unique(bodies.person):
        own = holds[both & (bodies.person == person)]
        parts = np.array_split(own, -(-len(own) // _TOGETHER)) if len(own) else []
        result += [np.median(each, axis=0) for each in parts]
    return np.array(result).reshape(-1, 3)
