"""Description of an exported sequence as a recording, for ``simharness evaluate`` and other commands on recordings."""

from __future__ import annotations

from typing import Any

from mvpose import SHELF14, Rig
from simharness.formats.npz_joints import write_tracks
from simharness.outputs.benchmark.layout import Layout
from simharness.reality.annotation_errors import annotate_simulation
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps_keys
from simharness.types.sequence import Sequence

_HEAD = (
    "# The detections and the truth of this sequence as a recording: simharness evaluate FOLDER\n"
    "# Frames are counted as they were written: frame k is the k-th file of each camera.\n"
)


def write_description(
    layout: Layout, scenario: Scenario, sequence: Sequence, rig: Rig, *, frames: range, believed: bool
) -> None:
    """Write ``recording.toml`` and the truth that it names.

    Args:
        layout: paths of the sequence.
        scenario: the scenario.
        sequence: joints of all people over time.
        rig: the cameras of the recording.
        frames: exported frames.
        believed: whether the layout has a believed calibration, which is then the calibration of the recording.
    """
    numbers = list(range(len(frames)))
    write_tracks(
        layout.truth, annotate_simulation(scenario, sequence, rig)[list(frames)], names=SHELF14.joints, frames=numbers
    )
    keys: dict[str, Any] = {
        "name": scenario.name,
        "rate": scenario.rate / frames.step,
        "frames": [[0, len(frames) - 1]],
        "calibration": {"file": (layout.believed if believed else layout.calibration).name},
        "detections": {
            "format": "openpose",
            "path": "openpose",
            "first": 0,
            "skeleton": "body25",
            "kind": scenario.detector.kind,
        },
        "truth": {"format": "npz", "file": layout.truth.name, "skeleton": "shelf14"},
    }
    layout.recording.write_text(f"{_HEAD}{dumps_keys(keys)}", encoding="utf-8")
