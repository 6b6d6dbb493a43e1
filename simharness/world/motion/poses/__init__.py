"""Poses of one body: forward and inverse kinematics, foot placement, posture curves and timing."""
