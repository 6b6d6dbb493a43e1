"""Files of a recording with truth, and their description."""

import json

import numpy as np

from mvpose import COCO17, SHELF14
from mvpose.formats.calibration.voxelpose import write_calibration
from simharness.scenario.toml_files import dumps_keys


def describe(recording, folder, *, name):
    """Write a recording into a folder, with COCO results as detections; return its description, NAME.toml."""
    write_calibration(folder / f"{name}_cameras.json", recording.rig)
    (folder / f"{name}_detections").mkdir()
    for view, camera in enumerate(recording.rig):
        results = [
            {"image_id": int(frame), "category_id": 1, "score": 0.9, "keypoints": points.ravel().tolist()}
            for frame, found in zip(recording.frames, recording.detections, strict=True)
            for points in np.dstack([found.keypoints, found.scores])[found.view == view]
        ]
        (folder / f"{name}_detections" / f"{camera.name}.json").write_text(json.dumps(results))
    truth, joints = folder / f"{name}_truth.npz", np.array(SHELF14.joints)
    np.savez(truth, joints=recording.truth, names=joints, frames=recording.frames)
    detections = {"format": "coco", "path": f"{name}_detections", "skeleton": COCO17.name, "kind": "bottom-up"}
    keys = {
        "name": name,
        "rate": recording.rate,
        "frames": [[0, len(recording) - 1]],
        "calibration": {"file": f"{name}_cameras.json", "size": [1032, 776]},
        "detections": detections,
        "truth": {"format": "npz", "file": truth.name},
    }
    (folder / f"{name}.toml").write_text(dumps_keys(keys))
    return folder / f"{name}.toml"
