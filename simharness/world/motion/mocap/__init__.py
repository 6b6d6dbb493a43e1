"""Recorded motion: reading AMC and BVH files, and giving what they recorded to bodies of any shape."""

from simharness.world.motion.mocap.clip import Clip, load_clip

__all__ = ["Clip", "load_clip"]
