"""For authors of methods that learn: a benchmark of several sequences, and the loop that reads it.

The benchmark here is tiny and has no pictures; ``simharness export SCENARIO FOLDER --sequences 100`` writes more.
"""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import simharness
from mvpose import Detections, Rig
from mvpose.arrays import Floats
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan
from simharness.outputs.benchmark.sequences import export_benchmark
from simharness.reality.recording_file import read_recording


def samples(benchmark: Path, split: str) -> Iterator[tuple[Rig, Detections, Floats]]:
    """Yield cameras, detections, and true joints (P, 14, 3), metres, of every frame of a split."""
    for sequence in json.loads((benchmark / "benchmark.json").read_text())["sequences"]:
        if sequence["split"] == split:
            recording = read_recording(benchmark / sequence["name"])
            for detections, truth in zip(recording.detections, recording.truth, strict=True):
                yield recording.rig, detections, truth


def main() -> None:
    """Write two sequences, and count what each split holds."""
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.5", 'rendering.renderer="rays"'], seed=7)
    with TemporaryDirectory() as parent:
        benchmark = Path(parent) / scenario.name
        export_benchmark(scenario, benchmark, partial(ExportPlan, pictures=False), sequences=2)
        for split in ("train", "val", "test"):
            frames = list(samples(benchmark, split))
            people = sum(len(truth) for _, _, truth in frames)
            found = sum(len(detections) for _, detections, _ in frames)
            print(f"{split}: {len(frames)} frames, {people} people, {found} detections")


if __name__ == "__main__":
    main()
