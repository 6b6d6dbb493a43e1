"""Arrays of RTMLib, frame by frame: JSON ``[{"keypoints": (n, J, 2), "scores": (n, J)}]``, or npz with these names.

Arrays of npz files are ``keypoints`` (T, n, J, 2) or (T, J, 2) and ``scores``.
"""

from mvpose.formats.detections.detection_file import DetectionFile, DetectionFormat, PicturePeople, picture_people
from mvpose.formats.joint_names import JointNames


def _read(file: DetectionFile, skeleton: JointNames | None) -> dict[int, PicturePeople]:
    path = file.path
    if file.json is not None:
        frames = [(each.get("keypoints"), each.get("scores")) for each in file.entries]
        return {k: picture_people(f"{path}: frame {k}", *each, skeleton) for k, each in enumerate(frames, file.first)}
    keypoints, scores = file.arrays.get("keypoints"), file.arrays.get("scores")
    if keypoints is None or scores is None or keypoints.ndim not in (3, 4) or keypoints.shape[:-1] != scores.shape:
        raise ValueError(
            f"{path}: expected arrays keypoints (T, n, J, 2) and scores (T, n, J), got {sorted(file.arrays)}"
        )
    if keypoints.ndim == 3:
        keypoints, scores = keypoints[:, None], scores[:, None]
    return {k: picture_people(f"{path}: frame {k}", keypoints[k], scores[k], skeleton) for k in range(len(keypoints))}


FORMAT = DetectionFormat(
    "RTMLib",
    lambda file: file.json is None or bool(file.entries and {"keypoints", "scores"} <= file.entries[0].keys()),
    _read,
    suffixes=(".json", ".npz"),
)
