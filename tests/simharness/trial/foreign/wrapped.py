"""A method in another program as a user-defined estimator: ``foreign = "wrapped.py:Foreign"``."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from mvpose import Detections, Estimate, Rig

PROGRAM = [sys.executable, str(Path(__file__).with_name("program.py"))]


class Foreign:
    """Estimator that starts the program for every frame. It keeps no state."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        # One row for each detection of all cameras; pixels without lens distortion.
        rows = zip(detections.view, detections.keypoints, strict=True)
        pixels = [rig[view].undistort(points) for view, points in rows]
        request = {
            "P": rig.P.tolist(),  # (V, 3, 4), metres
            "view": detections.view.tolist(),  # (m,)
            "keypoints": np.nan_to_num(pixels).tolist(),  # (m, 17, 2)
            "scores": detections.scores.tolist(),  # (m, 17), 0: not detected
        }
        text = json.dumps(request)
        done = subprocess.run(PROGRAM, input=text, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"the program failed: {done.stderr.strip()}")
        people = json.loads(done.stdout)
        # (n, 17, 3) in metres, null for a joint that was not placed; labels are optional.
        return Estimate.of_joints(people["joints"], labels=people["labels"])
