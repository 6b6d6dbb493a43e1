"""Recordings of the benchmark in one file: rigs, detections and truth as plain arrays.

What makes the recordings (the simulator, the readers of files) and what measures on them are apart, so that the
measurement runs on a machine that has mvpose and NumPy only.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose import Camera, Detections, Rig
from mvpose.arrays import Floats

_STEPS = {"view": 1.0, "keypoints": 1 / 32, "scores": 1 / 512, "boxes": 1 / 4, "box_scores": 1 / 512}
"""Rounding of the columns in the file, which makes it half as large: pixels, and scores of 0 to 1."""

_COLUMNS = tuple(_STEPS)


@dataclass(frozen=True)
class BenchRecording:
    """Detections of F frames by V cameras, and what is true.

    Attributes:
        name: name of the recording.
        rig: true calibration; of a real recording, the published one.
        frames: detections, F.
        truth: joints on SHELF14, (F, P, 14, 3), metres; NaN where unknown.
        offsets: true time minus given time of each camera's pictures, (V,), seconds.
        period: time between frames, seconds.
    """

    name: str
    rig: Rig
    frames: tuple[Detections, ...]
    truth: Floats
    offsets: Floats
    period: float

    def during(self, frames: slice) -> BenchRecording:
        """Return some frames."""
        return replace(self, frames=self.frames[frames], truth=self.truth[frames])


def write(path: Path, recordings: Iterable[BenchRecording]) -> None:
    """Write recordings to an NPZ file, each under its name."""
    arrays: dict[str, Any] = {}
    for each in recordings:
        arrays |= {f"{each.name}/{key}": value for key, value in _arrays(each).items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **arrays)


class Recordings(Mapping[str, BenchRecording]):
    """Recordings of a file by name; each is read when it is first needed.

    Raises:
        ValueError: no such file.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise ValueError(f"{path}: no such file; python -m benchmarks.doctor --prepare {path} makes it")
        self.path = path
        self._arrays = np.load(path)
        self._names = list(dict.fromkeys(key.partition("/")[0] for key in self._arrays.files))
        self._read: dict[str, BenchRecording] = {}

    def __getitem__(self, name: str) -> BenchRecording:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._read:
            self._read[name] = self._recording(name)
        return self._read[name]

    def __iter__(self) -> Any:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def _recording(self, name: str) -> BenchRecording:
        part = {key.partition("/")[2]: self._arrays[key] for key in self._arrays.files if key.partition("/")[0] == name}
        cameras = [
            Camera(
                part["K"][v], part["R"][v], part["t"][v], part["distortion"][v], tuple(part["size"][v].tolist()), str(n)
            )
            for v, n in enumerate(part["names"])
        ]
        bounds = np.searchsorted(part["frame"], np.arange(len(part["truth"]) + 1))
        frames = tuple(
            Detections(*(part[key][start:stop] for key in _COLUMNS)) for start, stop in itertools.pairwise(bounds)
        )
        return BenchRecording(
            name, Rig(cameras), frames, part["truth"].astype(float), part["offsets"], float(part["period"])
        )


def _arrays(recording: BenchRecording) -> dict[str, Any]:
    rig, frames = recording.rig, recording.frames
    columns = {key: np.concatenate([getattr(each, key) for each in frames]) for key in _COLUMNS}
    small = {key: _rounded(value, _STEPS[key]) for key, value in columns.items()}
    return {
        **{key: np.stack([getattr(camera, key) for camera in rig]) for key in ("K", "R", "t", "distortion")},
        "size": np.array([camera.size for camera in rig]),
        "names": np.array([camera.name for camera in rig]),
        "frame": np.repeat(np.arange(len(frames)), [len(each) for each in frames]),
        **small,
        "truth": recording.truth.astype(np.float32),
        "offsets": recording.offsets,
        "period": recording.period,
    }


def _rounded(values: Floats, step: float) -> NDArray:
    if values.dtype.kind == "i":
        return values.astype(np.int16)
    return (np.round(values / step) * step).astype(np.float32)
