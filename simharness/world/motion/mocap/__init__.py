"""Motion capture: readers for AMC and BVH files, and retargeting to bodies of any shape."""

from simharness.world.motion.mocap.clip import Clip, load_clip

__all__ = ["Clip", "load_clip"]
