"""Time of the re-ID network, which only presets that match by appearance need."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from benchmarks.method.measure import interleaved
from benchmarks.method.published import SIZES
from benchmarks.method.report import caption, figure, table
from benchmarks.method.scenes import SIZE, Task, frames, prepare


@dataclass(frozen=True)
class Crops:
    """Times of the re-ID network at one size.

    Attributes:
        views: number of cameras.
        people: number of people.
        crops: median number of crops per frame, one per detection.
        frame: median milliseconds per frame.
        crop: median milliseconds per crop.
    """

    views: int
    people: int
    crops: int
    frame: float
    crop: float


def measure(*, quick: bool = False) -> list[Crops]:
    """Time the re-ID network of mvpose on one thread, on pictures of noise, because the content does not matter.

    The result is empty if onnxruntime is not installed.
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
    """Format the rows as text."""
    if not rows:
        return "not measured: onnxruntime is not installed"
    text = [["ms, one core", "crops", "per frame", "per crop"]]
    for row in rows:
        text.append([f"{row.views}×{row.people}", str(row.crops), figure(row.frame), figure(row.crop)])
    return table(text, "<>>>") + caption(
        "views×people. Medians of ReId.descriptors: cutting crops out of the pictures and running the network of "
        "mvpose, on one thread of the CPU. Only presets that match by appearance need it."
    )
