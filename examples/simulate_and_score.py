"""Simulate a scenario, estimate its people with a preset, and score the estimates."""

import simharness
from mvpose import preset


def main() -> None:
    """Print the scores of one preset."""
    scenario = simharness.load_scenario("quickstart", overrides=["duration=1.0", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)  # detections and truth of each frame, and the cameras
    pipeline = preset("full")
    estimates = [pipeline.estimate(recording.rig, detections) for detections in recording.detections]
    scores = simharness.score(recording, estimates).scores
    print(f"{len(recording)} frames of {recording.people} people before {len(recording.rig)} cameras")
    print(f"PCP {scores['pcp']:.1f} %, MPJPE {scores['mpjpe_mm']:.1f} mm, {scores['ghosts']:.2f} ghosts a frame")


if __name__ == "__main__":
    main()
