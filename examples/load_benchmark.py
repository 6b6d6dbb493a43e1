"""For authors of methods that learn: a benchmark of several sequences, and the loops that read it.

The benchmark here is tiny and has no pictures; ``simharness export SCENARIO FOLDER --sequences 100`` writes more.
"""

import json
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import simharness
from mvpose import Detections, Rig
from mvpose.arrays import Floats
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan
from simharness.outputs.benchmark.sequences import export_benchmark
from simharness.reality.recording_file import read_recording


def samples(benchmark: Path, split: str) -> Iterator[tuple[Rig, Detections, Floats]]:
    """Yield cameras, detections, and the 14 joints of Shelf (P, 14, 3), metres, of every frame of a split."""
    for sequence in json.loads((benchmark / "benchmark.json").read_text())["sequences"]:
        if sequence["split"] == split:
            recording = read_recording(benchmark / sequence["name"])
            for detections, truth in zip(recording.detections, recording.truth, strict=True):
                yield recording.rig, detections, truth


def targets(sequence: Path) -> Iterator[tuple[Floats, Floats]]:
    """Yield what a network learns from a picture: heat maps (17, h, w), 0 to 1, and visible joints (P, 17)."""
    with np.load(sequence / "visibility.npz") as truth:
        visible = truth["visibility"] == truth["states"].tolist().index("visible")
        for row, frame in enumerate(truth["frames"]):
            for view, camera in enumerate(truth["cameras"]):
                with np.load(sequence / "heatmaps" / camera / f"{camera}_{frame:08d}.npz") as maps:
                    yield maps["values"] / 255.0, visible[row, view]


def main() -> None:
    """Write two sequences, count what each split holds, and how many joints the pictures show."""
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.5", 'rendering.renderer="rays"'], seed=7)
    with TemporaryDirectory() as parent:
        benchmark = Path(parent) / scenario.name
        also = frozenset({"visibility", "heatmaps"})
        export_benchmark(scenario, benchmark, partial(ExportPlan, pictures=False, also=also), sequences=2)
        for split in ("train", "val", "test"):
            frames = list(samples(benchmark, split))
            people = sum(len(truth) for _, _, truth in frames)
            found = sum(len(detections) for _, detections, _ in frames)
            print(f"{split}: {len(frames)} frames, {people} people, {found} detections")
        for maps, visible in islice(targets(benchmark / f"{scenario.name}_0007"), 3):
            print(f"{(maps.max(axis=(1, 2)) > 0.5).sum()} of 17 maps with a peak, {visible.sum()} visible joints")


if __name__ == "__main__":
    main()
