"""Bone lengths and joint rotations of people: inverse kinematics over their joints through time, and angles."""

from mvpose.skeleton_fit.fit import FittedBody, fit_bodies
from mvpose.skeleton_fit.joint_angles import joint_angles

__all__ = ["FittedBody", "fit_bodies", "joint_angles"]
