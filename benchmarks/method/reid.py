"""Milliseconds of the re-identification network, which looks take and geometry does without."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from benchmarks.method.measure import interleaved
from benchmarks.method.published import SIZES
from benchmarks.method.report import caption, figure, table
from benchmarks.method.scenes import SIZE, frames
from benchmarks.method.tasks import Task, prepare


@dataclass(frozen=True)
class Crops:
    """One size.

    Attributes:
        views: cameras.
        people: in the room.
        crops: of a frame, median: a detection is one.
        frame: milliseconds for those, median.
        crop: milliseconds for one of them.
    """

    views: int
    people: int
    crops: int
    frame: float
    crop: float


def measure(*, quick: bool = False) -> list[Crops]:
    """Time the network that comes with mvpose on one thread, on pictures of noise: what they show does not matter.

    Nothing is measured where onnxruntime is not installed.
    """
    if find_spec("onnxruntime") is None:
        return []
    return [_crops(views, people, quick) for views, people in (SIZES[:2] if quick else SIZES)]


def _crops(views: int, people: int, quick: bool) -> Crops:
    from mvpose.networks import ReId

    network = ReId()
    cases = prepare(frames(views, people, 2 if quick else 10))
    pictures = [np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)] * views
    reading = Task(
        lambda case: network.descriptors(pictures, case.scene.detections.view, case.scene.detections.boxes),
        lambda case, descriptors: {"crops": len(descriptors)},
    )
    sample = interleaved({"reid": reading}, cases, calls=3 if quick else 60, seconds=3.0)["reid"]
    crop = float(np.median(1e3 * sample.wall / sample.notes["crops"]))
    return Crops(views, people, int(np.median(sample.notes["crops"])), sample.quantile(0.5), crop)


def table_of(rows: list[Crops]) -> str:
    """The text."""
    if not rows:
        return "not measured: onnxruntime is not installed"
    text = [["ms, one core", "crops", "a frame", "a crop"]]
    for row in rows:
        text.append([f"{row.views}×{row.people}", str(row.crops), figure(row.frame), figure(row.crop)])
    return table(text, "<>>>") + caption(
        "views×people. Medians of ReId.descriptors: cutting the boxes out of the pictures and the network that comes "
        "with mvpose, on one thread of the CPU. Only presets that match by appearance need it."
    )
