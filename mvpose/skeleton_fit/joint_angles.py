"""Angles of the joints of a fitted body, named and measured as in the models of OpenSim.

The coordinates are those of Rajagopal et al., "Full-Body Musculoskeletal Model for Muscle-Driven Simulation of Human
Gait", IEEE Transactions on Biomedical Engineering 63(10), 2016: rotations about z, x, y of the moved body, whose x
points forward, y up and z to the right while the person stands with hanging arms. Angles of left limbs have the signs
of their right ones.
"""

import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.skeleton_fit.fit import FittedBody
from mvpose.skeleton_fit.rotations import to_matrices, to_vectors

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from the axes of our segments (forward, left, up) to those of OpenSim's bodies (forward, up, right)."""


def joint_angles(fit: FittedBody, world: Floats) -> dict[str, Floats]:
    """Return the angle of each coordinate, (T,), degrees, without jumps of whole turns.

    Joints whose motion the skeleton of the recording does not show are left out: the hands, and feet with fewer than
    two joints.

    Args:
        fit: the body.
        world: rotation from our world to that in which the pelvis turns, whose y points up, (3, 3).
    """
    body, rotations = fit.body, fit.pose.rotations
    local = {each.name: rotations[:, k] for k, each in enumerate(body.segments)}
    axes = {each.name: np.reshape(each.axes, (-1, 3)) for each in body.segments}
    pelvis = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
    found = dict(zip(pelvis, _euler(world @ local["Hips"] @ AXES.T), strict=True))

    def ball(names: tuple[str, str, str], turned: Floats, *, side: float = 1.0) -> None:
        found.update(zip(names, _euler(AXES @ turned @ AXES.T, np.array([1.0, side, side])), strict=True))

    for name, side in (("Right", 1.0), ("Left", -1.0)):
        end = name[0].lower()
        hanging = to_matrices(np.array([side * np.pi / 2, 0.0, 0.0]))  # from the T-pose
        ball((f"hip_flexion_{end}", f"hip_adduction_{end}", f"hip_rotation_{end}"), local[f"{name}UpLeg"], side=side)
        found[f"knee_angle_{end}"] = np.degrees(to_vectors(local[f"{name}Leg"]) @ axes[f"{name}Leg"][0])
        if len(axes[f"{name}Foot"]):
            found[f"ankle_angle_{end}"] = _euler(AXES @ local[f"{name}Foot"] @ AXES.T)[0]
        arm = local[f"{name}Shoulder"] @ local[f"{name}Arm"] @ hanging.T
        ball((f"arm_flex_{end}", f"arm_add_{end}", f"arm_rot_{end}"), arm, side=side)
        found[f"elbow_flex_{end}"] = np.degrees(to_vectors(local[f"{name}ForeArm"]) @ axes[f"{name}ForeArm"][0])
    ball(("lumbar_extension", "lumbar_bending", "lumbar_rotation"), local["Spine"])
    return found


def _euler(turned: Floats, signs: Floats | None = None) -> Floats:
    """Return the angles about z, x, y of the moved body, (3, T), degrees.

    Each rotation has two such triples; the one that changes less is taken. At a quarter turn about x, as of an arm that
    is stretched to the side, only the sum of the other two is determined.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that only a sum is determined
        angles = np.array(Rotation.from_matrix(turned).as_euler("ZXY", degrees=True))
    other = np.stack([angles[:, 0] + 180.0, 180.0 - angles[:, 1], angles[:, 2] + 180.0], axis=1)
    for row in range(1, len(angles)):
        pair = np.stack([angles[row], other[row]])
        pair = pair - 360.0 * np.round((pair - angles[row - 1]) / 360.0)
        angles[row] = pair[np.abs(pair - angles[row - 1]).sum(axis=1).argmin()]
    return np.asarray((angles if signs is None else angles * signs).T)
