"""Person association of the package pose2sim 0.10.49, with its triangulation, at the defaults of its demonstration.

Pagnon, Domalain & Reveret, "Pose2Sim: An open-source Python package for multiview markerless kinematics", JOSS 2022.
Affinity from distances of viewing rays, matching by singular value thresholding under the circular constraint, and the
proposal of each person are functions of the package. Its loop over cameras that are left out until the reprojection
error is small reads and writes files, so it is written again here around the package's weighted triangulation.

Left out: the interpolation and filters over time, and the exchange of left and right. Install the package without its
requirements, of which few are needed: ``pip install --no-deps pose2sim==0.10.49 anytree rtoml tqdm``.
"""

from __future__ import annotations

import itertools
import logging
from typing import Any

import numpy as np

from benchmarks.methods.points import estimate_of
from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Floats, Integers

APART = 0.1
"""``reconstruction_error_threshold``: distance of rays at which the affinity is 0, metres."""

LEAST_AFFINITY = 0.2
"""``min_affinity``."""

LARGEST_ERROR = 15.0
"""``reproj_error_threshold_triangulation``, pixels."""

LEAST_SCORE = 0.3
"""``likelihood_threshold_triangulation``."""

FEWEST = 2
"""``min_cameras_for_triangulation``."""


class Pose2Sim:
    """Association and triangulation of Pose2Sim.

    Raises:
        ImportError: the package or one of its modules is not installed.
    """

    def __init__(self) -> None:
        before = logging.root.manager.disable
        logging.disable(logging.WARNING)  # that it has no window to open
        try:
            from Pose2Sim import common, personAssociation
        finally:
            logging.disable(before)
        self.common: Any = common
        self.association: Any = personAssociation

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        pixels = np.full(detections.keypoints.shape, np.nan)
        for view, camera in enumerate(rig):
            pixels[detections.view == view] = camera.undistort(detections.keypoints[detections.view == view])
        order = np.concatenate([np.flatnonzero(detections.view == view) for view in range(len(rig))]).astype(int)
        proposals = self._proposals(rig, detections, pixels)
        ends = np.cumsum([0, *(np.count_nonzero(detections.view == view) for view in range(len(rig)))])
        labels = np.full(len(detections), -1)
        joints = np.full((len(proposals), *detections.scores.shape[1:], 3), np.nan)
        scores = np.zeros(joints.shape[:2])
        for person, proposal in enumerate(proposals):
            members = np.array([order[ends[view] + int(k)] for view, k in enumerate(proposal) if np.isfinite(k)])
            labels[members] = person
            for j in range(joints.shape[1]):
                seen = members[detections.scores[members, j] >= LEAST_SCORE]
                joints[person, j] = self._triangulated(
                    rig, detections.view[seen], pixels[seen, j], detections.scores[seen, j]
                )
                scores[person, j] = detections.scores[seen, j].mean() if len(seen) else 0.0
        return estimate_of(joints, scores, labels, detections.skeleton)

    def _proposals(self, rig: Rig, detections: Detections, pixels: Floats) -> Floats:
        """Return the people: index of a detection among those of each view, NaN for none, (n, V)."""
        of_views: list[list[list[float]]] = []
        for view in range(len(rig)):
            rows = np.flatnonzero(detections.view == view)
            poses = np.concatenate([pixels[rows], detections.scores[rows, :, None]], axis=2)
            poses[~np.isfinite(poses).all(axis=2)] = [np.nan, np.nan, 0.0]
            of_views.append(poses.reshape(len(rows), 3 * pixels.shape[1]).tolist())
        ends = np.cumsum([0, *map(len, of_views)])
        if ends[-1] == 0:
            return np.zeros((0, len(rig)))
        calibration = {
            "inv_K": [np.linalg.inv(camera.K) for camera in rig],
            "R_mat": [camera.R for camera in rig],
            "T": [camera.t for camera in rig],
        }
        circular = self.association.circular_constraint(ends)
        affinity = self.association.compute_affinity(of_views, calibration, ends, reconstruction_error_threshold=APART)
        matched = self.association.matchSVT(
            affinity * circular, ends, circular, max_iter=20, w_rank=50, tol=1e-4, w_sparse=0.1
        )
        matched[matched < LEAST_AFFINITY] = 0
        proposals: Floats = np.asarray(self.association.person_index_per_cam(matched, ends, FEWEST), float)
        return proposals.reshape(-1, len(rig)) if proposals.size else np.zeros((0, len(rig)))

    def _triangulated(self, rig: Rig, view: Integers, pixels: Floats, scores: Floats) -> Floats:
        """Return a joint, (3,), from the most views (n,) that agree; NaN where no two do."""
        for left_out in range(len(view) - FEWEST + 1):
            best, least = np.full(3, np.nan), np.inf
            for chosen in itertools.combinations(range(len(view)), len(view) - left_out):
                rows = list(chosen)
                P = list(rig.P[view[rows]])
                point = self.common.weighted_triangulation(P, pixels[rows, 0], pixels[rows, 1], scores[rows])
                projected = np.stack(self.common.reprojection(P, point), axis=1)
                error = float(np.linalg.norm(projected - pixels[rows], axis=1).mean())
                if error < least:
                    best, least = np.asarray(point[:3], float), error
            if least <= LARGEST_ERROR:
                return best
        return np.full(3, np.nan)


estimator = Pose2Sim
