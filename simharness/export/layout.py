"""Where everything of an exported sequence is: the folders and file names of the CMU Panoptic toolbox.

    calibration_NAME.json, calibration_believed_NAME.json
    hdImgs/00_00/00_00_00000000.jpg
    hdPose3d_stage1_coco19/body3DScene_00000000.json
    openpose/00_00/00_00_00000000_keypoints.json
    manifest.json, scenario.toml

The believed calibration, ``openpose``, the manifest and the scenario are ours; the rest is as the toolbox has it
(https://github.com/CMU-Perceptual-Computing-Lab/panoptic-toolbox).
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

FORMAT = "simharness export"
"""What a manifest says by which an export is known."""

PICTURES = "hdImgs/{camera}/{camera}_{frame:08d}.jpg"
BODIES = "hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json"
PEOPLE = "openpose/{camera}/{camera}_{frame:08d}_keypoints.json"


@dataclass(frozen=True)
class Layout:
    """The paths of a sequence.

    Attributes:
        folder: the sequence's own.
        name: of the sequence, by which its calibrations are called, whatever the folder is.
    """

    folder: Path
    name: str

    @property
    def calibration(self) -> Path:
        """The cameras that take the pictures."""
        return self.folder / f"calibration_{self.name}.json"

    @property
    def believed(self) -> Path:
        """The cameras that a method is told of, where they differ from those."""
        return self.folder / f"calibration_believed_{self.name}.json"

    @property
    def manifest(self) -> Path:
        """What the sequence is."""
        return self.folder / "manifest.json"

    @property
    def scenario(self) -> Path:
        """What it was made from."""
        return self.folder / "scenario.toml"

    def picture(self, camera: str, frame: int) -> Path:
        """What a camera delivers in a frame."""
        return self.folder / PICTURES.format(camera=camera, frame=frame)

    def bodies(self, frame: int) -> Path:
        """Where everybody is in a frame."""
        return self.folder / BODIES.format(frame=frame)

    def people(self, camera: str, frame: int) -> Path:
        """What is detected in a picture."""
        return self.folder / PEOPLE.format(camera=camera, frame=frame)

    def make_folders(self, cameras: Iterable[str], *, pictures: bool) -> None:
        """Make the folders that its files go into."""
        self.bodies(0).parent.mkdir(parents=True)
        for camera in cameras:
            self.people(camera, 0).parent.mkdir(parents=True)
            if pictures:
                self.picture(camera, 0).parent.mkdir(parents=True)


def check_place(folder: Path) -> None:
    """Check that an export can take the place of ``folder``.

    Raises:
        ValueError: something else is there, or it cannot be made.
    """
    if folder.exists() and not _is_export(folder):
        raise ValueError(
            f"{folder}: is there and is no export of simharness, which would replace it; expected a free place or an "
            "earlier export: name another FOLDER, or move it away"
        )
    first = next(parent for parent in folder.absolute().parents if parent.exists())
    if not first.is_dir() or not os.access(first, os.W_OK):
        raise ValueError(f"{folder}: cannot make this folder: {first} is no folder that can be written to")


def _is_export(folder: Path) -> bool:
    try:
        said = json.loads((folder / "manifest.json").read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(said, dict) and said.get("format") == FORMAT
