"""Folders and file names of an exported sequence: the layout of the CMU Panoptic toolbox.

    calibration_NAME.json, calibration_believed_NAME.json
    hdImgs/00_00/00_00_00000000.jpg
    hdPose3d_stage1_coco19/body3DScene_00000000.json
    openpose/00_00/00_00_00000000_keypoints.json
    manifest.json, scenario.toml, recording.toml, truth.npz

The believed calibration, ``openpose`` and the files of the last line are additions of simharness; the rest is the
toolbox's layout (https://github.com/CMU-Perceptual-Computing-Lab/panoptic-toolbox).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

FORMAT = "simharness export"
"""Value of ``format`` in the manifest of an export."""

PICTURES = "hdImgs/{camera}/{camera}_{frame:08d}.jpg"
BODIES = "hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json"
PEOPLE = "openpose/{camera}/{camera}_{frame:08d}_keypoints.json"


@dataclass(frozen=True)
class Layout:
    """Paths of a sequence.

    Attributes:
        folder: folder of the sequence.
        name: name of the sequence, used in the names of calibration files; the folder may have another name.
    """

    folder: Path
    name: str

    @property
    def calibration(self) -> Path:
        """Calibration of the true rig."""
        return self.folder / f"calibration_{self.name}.json"

    @property
    def believed(self) -> Path:
        """Calibration of the believed rig; written only where it differs from the true rig."""
        return self.folder / f"calibration_believed_{self.name}.json"

    @property
    def manifest(self) -> Path:
        """Description of the sequence."""
        return self.folder / "manifest.json"

    @property
    def scenario(self) -> Path:
        """Resolved scenario of the sequence."""
        return self.folder / "scenario.toml"

    @property
    def recording(self) -> Path:
        """Description of the sequence as a recording."""
        return self.folder / "recording.toml"

    @property
    def truth(self) -> Path:
        """True joints of the recording."""
        return self.folder / "truth.npz"

    def picture(self, camera: str, frame: int) -> Path:
        """Return the path of the picture of a camera in a frame."""
        return self.folder / PICTURES.format(camera=camera, frame=frame)

    def bodies(self, frame: int) -> Path:
        """Return the path of the true poses of a frame."""
        return self.folder / BODIES.format(frame=frame)

    def people(self, camera: str, frame: int) -> Path:
        """Return the path of the detections in the picture of a camera."""
        return self.folder / PEOPLE.format(camera=camera, frame=frame)

    def make_folders(self, cameras: Iterable[str], *, pictures: bool) -> None:
        """Create the folders of the files."""
        self.bodies(0).parent.mkdir(parents=True)
        for camera in cameras:
            self.people(camera, 0).parent.mkdir(parents=True)
            if pictures:
                self.picture(camera, 0).parent.mkdir(parents=True)
