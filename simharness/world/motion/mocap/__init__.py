"""Motion capture: AMC and BVH files retargeted to bodies of any shape, and recorded people who are re-enacted."""

from simharness.world.motion.mocap.clip import Clip, load_clip
from simharness.world.motion.mocap.recorded_people import load_people, recorded_shape
from simharness.world.motion.mocap.reenactment import reenact

__all__ = ["Clip", "load_clip", "load_people", "recorded_shape", "reenact"]
