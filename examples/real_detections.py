"""From real detections to people in 3D: OpenPose files and a calibration, with ``mvpose`` alone.

    python examples/real_detections.py shared/data/shelf

The folder is laid out as Shelf is: ``calibration_shelf.json`` (VoxelPose's format) and ``openpose/<camera>/*.json``.
Without a folder, the example writes simulated detections in these formats first and reads them back.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import simharness
from mvpose import preset
from mvpose.formats.calibration.voxelpose import read_calibration, write_calibration
from mvpose.formats.detections.openpose import people_file, read_frame


def people_of(folder: Path, *, size: tuple[int, int], frames: int) -> None:
    """Print how many people are in the first frames of a folder."""
    rig = read_calibration(folder / "calibration_shelf.json", size=size)
    views = [sorted((folder / "openpose" / camera.name).glob("*.json")) for camera in rig]
    pipeline = preset("full")
    for frame, files in enumerate(zip(*views, strict=True)):
        if frame == frames:
            break
        people = pipeline.estimate(rig, read_frame(list(files)))
        print(f"frame {frame}: {len(people)} people", people.joints.mean(axis=1).round(2).tolist())


def write_simulated(folder: Path) -> tuple[int, int]:
    """Write simulated detections of three frames as a recording in a folder; return the size of the pictures."""
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.3", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    write_calibration(folder / "calibration_shelf.json", recording.rig)
    for view, camera in enumerate(recording.rig):
        (folder / "openpose" / camera.name).mkdir(parents=True)
        for frame, detections in enumerate(recording.detections):
            rows = detections.view == view
            content = people_file(detections.keypoints[rows], detections.scores[rows])
            (folder / "openpose" / camera.name / f"{frame:012d}_keypoints.json").write_text(json.dumps(content))
    return recording.rig[0].size


def main() -> None:
    """Run on the folder of the command line, or on a simulated recording."""
    if len(sys.argv) > 1:
        people_of(Path(sys.argv[1]), size=(1032, 776), frames=5)
        return
    with TemporaryDirectory() as name:
        people_of(Path(name), size=write_simulated(Path(name)), frames=3)


if __name__ == "__main__":
    main()
