"""Triangulation of the package aniposelib 0.5.1, after the association of the plain baseline.

Karashchuk et al., "Anipose: A toolkit for robust markerless 3D pose estimation", Cell Reports 2021. The package
triangulates one animal whose keypoints are known in each view, so people are joined over views as in
:mod:`benchmarks.methods.ransac`. ``CameraGroup.triangulate``, its default, takes all views of a joint alike. Its
``triangulate_ransac`` tries all subsets of views in Python, 13 s for a frame of four people and five cameras: it is not
measured. Joints of fewer than two views, on which the package fails, are not given to it.

Install the package without its requirements, of which ``opencv-contrib-python`` would replace OpenCV:
``pip install --no-deps aniposelib==0.5.1 toml tqdm``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.methods.points import estimate_of
from benchmarks.methods.ransac import associate
from mvpose import Detections, Estimate, Rig
from mvpose.rays import viewing_rays


class Anipose:
    """Plain association, and the triangulation of Anipose.

    Raises:
        ImportError: the package or one of its modules is not installed.
    """

    def __init__(self) -> None:
        from aniposelib import cameras

        self.cameras: Any = cameras

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        labels = associate(viewing_rays(rig, detections), len(rig))
        group = self.cameras.CameraGroup(
            [
                self.cameras.Camera(
                    matrix=camera.K,
                    dist=camera.distortion,
                    size=camera.size,
                    rvec=Rotation.from_matrix(camera.R).as_rotvec(),
                    tvec=camera.t,
                    name=camera.name,
                )
                for camera in rig
            ]
        )
        people = int(labels.max(initial=-1)) + 1
        joints = np.full((people, len(detections.skeleton), 3), np.nan)
        scores = np.zeros(joints.shape[:2])
        for person in range(people):
            members = np.flatnonzero(labels == person)
            pixels = np.full((len(rig), len(detections.skeleton), 2), np.nan)
            pixels[detections.view[members]] = detections.keypoints[members]
            seen = np.isfinite(pixels[..., 0]).sum(axis=0) >= 2
            if seen.any():
                joints[person, seen] = group.triangulate(pixels[:, seen])
                scores[person] = detections.scores[members].sum(axis=0) / np.maximum(
                    detections.detected[members].sum(axis=0), 1
                )
        return estimate_of(joints, scores, labels, detections.skeleton)


estimator = Anipose
