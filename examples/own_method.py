"""Compare your own method with a preset on the same simulated detections.

A method is any object with ``estimate(rig, detections) -> mvpose.Estimate``. This one takes the detections of the two
cameras that see most people, pairs them by the distance of their viewing rays, and triangulates.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

import simharness
from mvpose import Detections, Estimate, Rig, preset


class TwoViews:
    """Estimator that uses two views only."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Return the people of one frame."""
        count = np.bincount(detections.view, minlength=len(rig))
        first, second = np.sort(np.argsort(-count, kind="stable")[:2])
        one, two = (np.flatnonzero(detections.view == view) for view in (first, second))
        pairs = [[self._midpoints(rig, detections, i, j) for j in two] for i in one]
        cost = np.array([[np.nanmean(gap) if np.isfinite(gap).any() else 1e3 for _, gap in row] for row in pairs])
        cost = cost.reshape(len(one), len(two))
        rows, columns = linear_sum_assignment(cost)
        people = [pairs[i][j][0] for i, j in zip(rows, columns, strict=True) if cost[i, j] < 0.15]
        return Estimate.of_joints(np.array(people).reshape(-1, 17, 3))

    @staticmethod
    def _midpoints(rig: Rig, detections: Detections, i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the points halfway between the viewing rays of each joint, (17, 3), and the rays' distances (17,)."""
        cameras = [rig[int(detections.view[index])] for index in (i, j)]
        a, b = (camera.rays(detections.keypoints[index]) for camera, index in zip(cameras, (i, j), strict=True))
        a, b = (ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in (a, b))
        between = cameras[1].center - cameras[0].center
        cosine = (a * b).sum(axis=1)
        scale = np.maximum(1.0 - cosine**2, 1e-9)
        s = ((a @ between) - cosine * (b @ between)) / scale
        t = (cosine * (a @ between) - (b @ between)) / scale
        near, far = cameras[0].center + s[:, None] * a, cameras[1].center + t[:, None] * b
        return (near + far) / 2, np.linalg.norm(near - far, axis=1)


def main() -> None:
    """Print the scores of both methods."""
    scenario = simharness.load_scenario("quickstart", overrides=["duration=1.0", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    for name, method in {"two views": TwoViews(), "full": preset("full")}.items():
        estimates = [method.estimate(recording.rig, detections) for detections in recording.detections]
        scores = simharness.score(recording, estimates).scores
        print(f"{name:>9}: PCP {scores['pcp']:5.1f} %, recall {scores['recall']:5.1f} %, {scores['ghosts']:.2f} ghosts")


if __name__ == "__main__":
    main()
