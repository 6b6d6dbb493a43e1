"""Extrinsics that ``humancalib`` 0.5.4 (MIT) finds from the detections of one person.

It runs its whole pipeline but its networks, whose weights are not part of the package: it gets poses as if they had
been extracted before. Pixels are those that ``mvpose calibrate`` gets; depth is the true pose relative to the pelvis
with the error of a network that lifts poses, 47 mm on average (Pavllo et al., CVPR 2019, table 1), which changes over
half a second. Which detections are of this person is known from the truth.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from mvpose import Rig
from mvpose.arrays import Floats
from mvpose.formats.calibration import pose2sim
from mvpose.formats.detections.openpose import to_body25

RATE = 25.0
"""Frames a second of the recordings."""
_ERROR, _MEMORY = 0.047, 0.5  # metres, seconds
_RESULTS = ("linear_1_0_ba.json", "linear_1_0.json")  # the last step that has one


def peer_rig(program: Path, folder: Path, rig: Rig, keypoints: Floats, scores: Floats, joints: Floats) -> Rig | None:
    """Return the extrinsics that the program finds, without scale; None where it fails.

    Args:
        program: executable of humancalib.
        folder: empty folder for what it reads and writes.
        rig: true cameras.
        keypoints: one person's detections, (t, V, 17, 2) pixels.
        scores: their scores, (t, V, 17); 0 where the person is not detected.
        joints: the person's true joints, (t, 17, 3) metres.
    """
    videos = folder / "videos"
    videos.mkdir()
    names = [camera.name for camera in rig]
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    rng = np.random.default_rng(len(joints))
    for view, (camera, name) in enumerate(zip(rig, names, strict=True)):
        _black_film(videos / f"{name}.avi", camera.size, len(joints))
        depth = (joints - joints[:, 11:13].mean(1, keepdims=True)) @ camera.R.T
        noise = gaussian_filter1d(rng.standard_normal(depth.shape), _MEMORY * RATE, axis=0)
        depth += noise * (_ERROR / np.linalg.norm(noise, axis=-1).mean())
        write_poses(folder / "out" / "noise_1_0", "2d_joint", view, keypoints[:, view], scores[:, view])
        write_poses(folder / "out" / "noise_1_0", "3d_joint", view, depth, np.ones(depth.shape[:2]))
    command = [program, "run", videos, folder / "Calib.toml", folder / "out", "cpu", "--no_visualize"]
    command += ["--pose_engine", "metrabs", "--person_selection", "largest"]
    subprocess.run(list(map(str, command)), capture_output=True, check=False)
    for result in _RESULTS:
        if (folder / "out" / "results" / result).exists():
            found = json.loads((folder / "out" / "results" / result).read_text())
            poses = zip(rig, np.array(found["R_w2c"]), np.array(found["t_w2c"]), strict=True)
            return Rig([replace(camera, R=R, t=t.ravel()) for camera, R, t in poses])
    return None


def _black_film(file: Path, size: tuple[int, int], frames: int) -> None:
    """Write a film of which the program reads the size, the rate and the number of pictures."""
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), RATE, size)
    for _ in range(frames):
        writer.write(np.zeros((size[1], size[0], 3), np.uint8))
    writer.release()


def write_poses(folder: Path, kind: str, view: int, points: Floats, scores: Floats) -> None:
    """Write poses (t, 17, D) of COCO17 with scores (t, 17) as those of BODY_25; joints without a value have score 0."""
    shown, certain = to_body25(points, np.where(np.isfinite(points).all(axis=-1), scores, 0.0))
    frames = [
        {"frame_index": number, "skeleton": [{"pose": pose.ravel().tolist(), "score": score.tolist()}]}
        for number, (pose, score) in enumerate(zip(shown, certain, strict=True))
    ]
    (folder / kind).mkdir(parents=True, exist_ok=True)
    (folder / kind / f"A001_P001_G001_C{view + 1:03d}.json").write_text(json.dumps({"data": frames}))
