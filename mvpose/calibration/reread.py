"""Rig and tracklets under another reading of their files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose.calibration.consistency import Reading
from mvpose.calibration.tracklets import Tracklets
from mvpose.camera import Camera, Rig


def reread_rig(rig: Rig, reading: Reading) -> Rig | None:
    """Return the rig as a reading has it; None if it is no rig."""
    cameras = []
    try:
        for camera, row in zip(rig, reading.cameras, strict=True):
            fx, skew, cx, fy, cy = row[:5]
            R = row[5:14].reshape(3, 3)
            K = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
            cameras.append(Camera(K, R, -R @ row[14:17], row[17:22], camera.size, camera.name, camera.readout))
        return Rig(cameras)
    except ValueError:
        return None


def reread_tracklets(tracklets: Tracklets, reading: Reading) -> Tracklets:
    """Return tracklets in the pixels and with the joint names of a reading."""
    keypoints, sigma, velocity = tracklets.keypoints.copy(), tracklets.sigma.copy(), tracklets.velocity.copy()
    mirror = list(tracklets.skeleton.mirror)
    for view, (matrix, exchanged) in enumerate(zip(reading.pixels, reading.exchanged, strict=True)):
        rows = np.flatnonzero(tracklets.view == view)
        keypoints[rows] = keypoints[rows] @ matrix[:, :2].T + matrix[:, 2]
        velocity[rows] = velocity[rows] @ matrix[:, :2].T
        sigma[rows] *= np.sqrt(abs(np.linalg.det(matrix[:, :2])))
        if exchanged:
            for array in (keypoints, sigma, velocity):
                array[rows] = array[rows][:, mirror]
    return replace(tracklets, keypoints=keypoints, sigma=sigma, velocity=velocity)
