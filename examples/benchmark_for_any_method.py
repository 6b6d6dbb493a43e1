"""For authors of benchmarks: a simulated sequence as files, a method that reads these files alone, and its scores.

The files are in the layout of CMU Panoptic with detections as OpenPose writes them, so the method may be any program in
any language. Here it is mvpose's tracker. ``ExportPlan(..., pictures=True)`` writes the pictures, too.
"""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import simharness
from mvpose import Detections
from mvpose.formats.calibration.panoptic import read_calibration
from mvpose.formats.detections.openpose import read_frame
from mvpose.recording import People
from mvpose.tracking import Tracker, TrackingModel, track
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.reality.evaluation import evaluate_people
from simharness.reality.recording_file import read_recording

PERIOD = 0.1  # seconds between frames


def estimate(folder: Path, name: str) -> People:
    """Return tracked people from the calibration and the detections in a folder; the truth beside them is not read."""
    rig = read_calibration(folder / f"calibration_{name}.json")  # believed_{name} where the rig has faults
    views = [sorted((folder / "openpose" / camera.name).glob("*.json")) for camera in rig]

    def frames() -> Iterator[Detections]:
        for files in zip(*views, strict=True):
            yield read_frame(list(files))

    tracker = Tracker(model=TrackingModel(period=PERIOD))
    return People.of_estimates(track(tracker, rig, frames(), lag=0.5), period=PERIOD)


def main() -> None:
    """Write two seconds of a scene, estimate from the files, and score against the truth of the export."""
    overrides = ["duration=2.0", f"rate={1 / PERIOD}", 'rendering.renderer="rays"']
    scenario = simharness.load_scenario("quickstart", overrides=overrides, seed=7)
    with TemporaryDirectory() as parent:
        folder = export_sequence(scenario, ExportPlan(Path(parent) / scenario.name, pictures=False))
        print("written:", *sorted(path.name for path in folder.iterdir()))
        people = estimate(folder, scenario.name)
        evaluation = evaluate_people(read_recording(folder), people)
    scores = evaluation.summary()["variants"]["files"]
    print(f"{len(people)} people followed, MPJPE {scores['mpjpe_mm']['mean']:.0f} mm, PCP {scores['pcp']:.1f} %")


if __name__ == "__main__":
    main()
