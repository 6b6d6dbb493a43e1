"""People in the layout of CMU Panoptic: ``hdPose3d/body3DScene_FRAME.json`` for each frame.

Centimetres, y down: (X, Y, Z) = 100 (x, -z, y) of our metres, z up. ``joints19`` (or another number of joints, in the
order of the skeleton) has x, y, z and the score of each joint; 0 0 0 -1 is the data set's mark of an undefined joint.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.people.people_files import Export

_VERSION = 0.7  # of the dataset's files
_DECIMALS = 4  # of centimetres: micrometres
_AXES = 100.0 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each frame; the rate of the recording is in ``fpsType``."""
    people = export.people
    values = np.zeros((*people.scores.shape, 4))
    values[..., :3] = np.nan_to_num(np.round(people.joints @ _AXES.T, _DECIMALS)) + 0.0  # without -0.0
    values[..., 3] = np.where(people.present, np.round(people.scores, _DECIMALS), -1.0)
    for frame, time in enumerate(people.times.tolist()):
        columns = np.flatnonzero(people.present[frame].any(axis=-1))
        scene = {
            "version": _VERSION,
            "univTime": round(1000.0 * time, 3),  # milliseconds
            "fpsType": f"{people.rate:g}",
            "bodies": [_body(int(people.ids[column]), values[frame, column]) for column in columns],
        }
        yield f"hdPose3d/body3DScene_{frame:08d}.json", json.dumps(scene).encode()


def _body(identity: int, joints: Floats) -> dict[str, object]:
    return {"id": identity, f"joints{len(joints)}": joints.ravel().tolist()}
