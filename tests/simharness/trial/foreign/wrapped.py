"""A method in another program, made an estimator: simharness asks it by ``foreign = "wrapped.py:Foreign"``."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from mvpose import Detections, Estimate, Rig

PROGRAM = [sys.executable, str(Path(__file__).with_name("program.py"))]


class Foreign:
    """Starts the program for every frame. It keeps nothing: frames come in any order, in several processes."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        # One detection a row, all cameras together; pixels as a camera without a lens would see them.
        pixels = [rig[k].undistort(seen) for k, seen in zip(detections.view, detections.keypoints, strict=True)]
        question = {
            "P": rig.P.tolist(),  # (V, 3, 4), metres
            "view": detections.view.tolist(),  # (m,)
            "keypoints": np.nan_to_num(pixels).tolist(),  # (m, 17, 2)
            "scores": detections.scores.tolist(),  # (m, 17), 0 where a keypoint was not detected
        }
        done = subprocess.run(PROGRAM, input=json.dumps(question), capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"the program failed: {done.stderr.strip()}")
        answer = json.loads(done.stdout)
        # (n, 17, 3) in metres, null for a joint that could not be placed; labels may be left out.
        return Estimate.of_joints(answer["joints"], labels=answer["labels"])
