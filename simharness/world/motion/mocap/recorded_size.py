"""Body shapes for re-enacted joint tracks."""

from __future__ import annotations

import numpy as np

from simharness.world.humans.body import make_body
from simharness.world.humans.body_size import body_lengths, resize
from simharness.world.humans.shape import Shape
from simharness.world.motion.mocap.joint_tracks import PeopleTracks
from simharness.world.motion.mocap.reenactment import follow
from simharness.world.motion.poses.kinematics import Kinematics

_POSES = 120  # most poses, spread over the recording, in which lengths are compared


def recorded_shape(shape: Shape, tracks: PeopleTracks, person: int) -> Shape:
    """Return the shape with the size of a recorded person, as far as any body has it.

    Distances between COCO-17 joints change with the pose: a bent trunk is shorter, and so is a thigh in a squat. So the
    lengths are compared while the body performs the recorded poses, and corrected once.

    Args:
        shape: drawn shape; parameters other than stature and limb lengths are kept.
        tracks: joint tracks of all people.
        person: index of the person in the tracks.
    """
    frames = np.unique(np.linspace(0, len(tracks.joints) - 1, _POSES).round().astype(int))
    joints = tracks.joints[:, person]
    recorded = body_lengths(joints)
    first = resize(shape, recorded)
    kinematics = Kinematics(make_body(first))
    performed = body_lengths(kinematics.joints(follow(joints[frames], kinematics, time=frames / tracks.rate)))
    wanted = body_lengths(joints[frames])
    return resize(shape, {name: recorded[name] * wanted[name] / performed[name] for name in recorded})
