"""True keypoints in the pictures of each camera as a COCO keypoints file, for detectors to be trained or scored on."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mvpose import Rig
from mvpose.skeleton import COCO17
from simharness.outputs.benchmark.layout import Layout, write_json
from simharness.types.truth import Truth
from simharness.types.views import Visibility

COCO = "coco"
"""Name of these files among what is written beside the pictures."""

_CATEGORY = {"id": 1, "name": "person", "keypoints": list(COCO17.joints)}
_LEAST = 1.0  # square pixels of the box of somebody who counts as in the picture


def write_coco(layout: Layout, rig: Rig, truth: Mapping[int, Truth], people: Sequence[int]) -> None:
    """Write ``coco/CAMERA.json`` for each camera: images, annotations with 17 keypoints, boxes and a ``track_id``.

    A keypoint has visibility 2 where it is seen, 1 where something hides it, and 0 (with x = y = 0) outside of the
    picture. Integers are the centres of pixels. People outside of the picture have no annotation.

    Args:
        layout: paths of the sequence.
        rig: cameras, with their names in the files.
        truth: truth by frame.
        people: identities of the people in the truth.
    """
    for view, camera in enumerate(rig):
        width, height = camera.size
        images: list[dict[str, Any]] = []
        annotations: list[dict[str, Any]] = []
        for frame, true in truth.items():
            file = layout.path("pictures", camera=camera.name, frame=frame).relative_to(layout.folder).as_posix()
            images.append({"id": frame, "file_name": file, "width": width, "height": height})
            area = true.boxes[view, :, 2] * true.boxes[view, :, 3]
            for person in np.flatnonzero(area >= _LEAST).tolist():
                seen = true.visibility[view, person]
                flag = np.where(seen == Visibility.VISIBLE, 2, np.where(seen == Visibility.OUTSIDE, 0, 1))
                places = np.where(flag[:, None] > 0, true.pixels[view, person], 0.0).round(2)
                keypoints = np.column_stack([places, flag]).ravel().tolist()
                box = {"bbox": true.boxes[view, person].round(2).tolist(), "area": round(float(area[person]), 2)}
                who = {"id": len(annotations) + 1, "image_id": frame, "category_id": 1, "track_id": int(people[person])}
                joints = {"keypoints": keypoints, "num_keypoints": int((flag > 0).sum()), "iscrowd": 0}
                annotations.append(who | joints | box)
        content = {"images": images, "annotations": annotations, "categories": [_CATEGORY]}
        write_json(layout.folder / COCO / f"{camera.name}.json", content)
