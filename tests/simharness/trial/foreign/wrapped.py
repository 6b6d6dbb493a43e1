"""A method in another program as a user-defined estimator: ``foreign = "wrapped.py:Foreign"``."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from mvpose import Detections, Estimate, Rig

PROGRAM = [sys.executable, str(Path(__file__).with_name("program.py"))]


class Foreign:
    """Estimator that starts the program for every frame. No state: frames come in any order, in several processes."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        # One row for each detection, all cameras together; pixels without lens distortion.
        pixels = [rig[k].undistort(points) for k, points in zip(detections.view, detections.keypoints, strict=True)]
        request = {
            "P": rig.P.tolist(),  # (V, 3, 4), metres
            "view": detections.view.tolist(),  # (m,)
            "keypoints": np.nan_to_num(pixels).tolist(),  # (m, 17, 2)
            "scores": detections.scores.tolist(),  # (m, 17), 0 where a keypoint was not detected
        }
        done = subprocess.run(PROGRAM, input=json.dumps(request), capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"the program failed: {done.stderr.strip()}")
        answer = json.loads(done.stdout)
        # (n, 17, 3) in metres, null for a joint that could not be placed; labels may be left out.
        return Estimate.of_joints(answer["joints"], labels=answer["labels"])
