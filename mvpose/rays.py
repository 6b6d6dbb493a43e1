"""Detections as viewing rays in the world: what every later stage works on.

A keypoint and its camera say that the joint lies on a half-line. Distances between such rays, and from a point to
a ray, are in metres whatever the resolution, focal length or lens, so one set of scales serves every rig.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from mvpose.detections import Detections

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rays:
    """The viewing rays of m detections of J joints.

    Attributes:
        view: camera of each detection, (m,).
        origins: optical centres, (m, 3), metres.
        directions: unit vectors, (m, J, 3); zeros where the keypoint is missing.
        weights: scores of the keypoints, (m, J); 0 where missing.
        pixel: angle that one pixel spans at the image centre, (m,), radians.
    """

    view: NDArray[np.int64]
    origins: Floats
    directions: Floats
    weights: Floats
    pixel: Floats

    def __len__(self) -> int:
        return len(self.view)

    def select(self, which: NDArray[np.bool_]) -> Rays:
        """Keep only some of the detections, (m,)."""
        return Rays(
            self.view[which],
            self.origins[which],
            self.directions[which],
            self.weights[which],
            self.pixel[which],
        )


def viewing_rays(rig: Rig, detections: Detections) -> Rays:
    """Turn keypoints into viewing rays, lens distortion undone.

    Raises:
        ValueError: a detection names a view that the rig does not have.
    """
    if len(detections) and detections.view.max() >= len(rig):
        raise ValueError(
            f"a detection names view {detections.view.max()}, but the rig has {len(rig)} cameras (0 to {len(rig) - 1})"
        )
    directions = np.zeros((*detections.keypoints.shape[:2], 3))
    origins, pixel = np.zeros((len(detections), 3)), np.zeros(len(detections))
    for index, camera in enumerate(rig):
        mine = detections.view == index
        if mine.any():
            directions[mine] = np.nan_to_num(camera.rays(detections.keypoints[mine]))
            origins[mine] = camera.center
            pixel[mine] = 1.0 / np.sqrt(camera.K[0, 0] * camera.K[1, 1])
    return Rays(detections.view, origins, directions, detections.scores, pixel)
