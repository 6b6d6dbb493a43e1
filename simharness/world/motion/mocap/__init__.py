"""Motion capture: AMC and BVH files retargeted to bodies of any shape, and joint tracks re-enacted by people."""

from simharness.world.motion.mocap.clip import Clip, load_clip
from simharness.world.motion.mocap.joint_tracks import PeopleTracks, load_tracks, tracks_file
from simharness.world.motion.mocap.recorded_size import recorded_shape
from simharness.world.motion.mocap.reenactment import reenact

__all__ = ["Clip", "PeopleTracks", "load_clip", "load_tracks", "recorded_shape", "reenact", "tracks_file"]
