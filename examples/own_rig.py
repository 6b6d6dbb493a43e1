"""Put your own calibrated cameras into a scenario: a calibration file in place of the scenario's rig.

Any format that is read will do: VoxelPose, Panoptic, OpenCV, Pose2Sim, EasyMocap, COLMAP. Here it is made first.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import simharness
from mvpose import Camera, Rig
from mvpose.formats.calibration.opencv import write_calibration


def camera(name: str, position: tuple[float, float, float]) -> Camera:
    """Return a camera at a position (metres, z up) that looks at the middle of the room, 1 m above the floor."""
    forward = np.array([0.0, 0.0, 1.0]) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])  # OpenCV: x right, y down, z forward
    K = np.array([[600.0, 0.0, 399.5], [0.0, 600.0, 299.5], [0.0, 0.0, 1.0]])
    return Camera(K, R, -R @ position, size=(800, 600), name=name)


def main() -> None:
    """Simulate the quickstart scenario with three cameras of a calibration file."""
    positions = {"door": (3.2, 2.6, 2.3), "window": (-3.2, 2.6, 2.3), "shelf": (0.3, -2.7, 2.4)}
    rig = Rig([camera(name, position) for name, position in positions.items()])
    with TemporaryDirectory() as folder:
        calibration = Path(folder) / "my-cameras.yml"
        write_calibration(calibration, rig)
        overrides = [
            'cameras.layout="file"',
            f'cameras.file="{calibration}"',
            "duration=1.0",
            'rendering.renderer="rays"',
        ]
        result = simharness.run_trial(simharness.load_scenario("quickstart", overrides=overrides), variants=["full"])
    scores = result.results["full"].scores
    print(f"three cameras: PCP {scores['pcp']:.1f} %, recall {scores['recall']:.1f} %")


if __name__ == "__main__":
    main()
