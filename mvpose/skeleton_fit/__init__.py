"""Bone lengths and joint rotations of people: inverse kinematics over their joints through time."""

from mvpose.skeleton_fit.fit import FittedBody, fit_bodies

__all__ = ["FittedBody", "fit_bodies"]
