"""Make ``simharness/detector/data/poses_in_pictures.npz``: ``python -m tools.poses``; a minute, no download.

The file holds the mean and covariance of people's joints in pictures for each bearing of the camera from the trunk,
from all activities of the motion library, each performed by :data:`BODIES` bodies. Equal code gives equal values.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.detector.reported import DATA, POSE_BEARINGS
from tools.poses.sample import PosesInPictures, sample_joints, see

SEED = 0
BODIES = 30
FRAMES = 20
"""Poses of each performer in each motion."""


def moments(poses: PosesInPictures) -> tuple[Floats, Floats]:
    """Return means (BEARINGS, 34) and covariances (BEARINGS, 34, 34) of the poses about each bearing, metres."""
    place = np.rint(poses.bearing * (POSE_BEARINGS / (2 * np.pi))).astype(int) % POSE_BEARINGS
    groups = [poses.places[place == number].reshape(-1, 34) for number in range(POSE_BEARINGS)]
    return np.stack([group.mean(axis=0) for group in groups]), np.stack([np.cov(group.T) for group in groups])


def main() -> None:
    """Sample the poses and write the file."""
    poses = see(sample_joints(SEED, bodies=BODIES, frames=FRAMES), SEED, bearings=POSE_BEARINGS)
    mean, covariance = moments(poses)
    DATA.parent.mkdir(exist_ok=True)
    np.savez_compressed(DATA, mean=mean.astype(np.float32), covariance=covariance.astype(np.float32))
    print(f"{DATA}: {len(poses.bearing)} poses in pictures, {DATA.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
