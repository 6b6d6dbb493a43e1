"""Registry of formats of 2D detections, by the name that ``detections.format`` of a recording has.

To add a format, write one module beside this one with a function ``read_detections(files) -> tuple[Detections, ...]``
(:mod:`.coco_results` is an example), and add it to :data:`FORMATS`. Readers convert to COCO17. Programs that use
mvpose as a library call :func:`register` instead.
"""

from __future__ import annotations

from mvpose.formats.detection_files import ReadDetections
from mvpose.formats.detections import coco_results, openpose

FORMATS: dict[str, ReadDetections] = {
    "openpose": openpose.read_detections,
    "coco": coco_results.read_detections,
}
"""Readers of the registered formats by name."""


def register(name: str, read: ReadDetections) -> None:
    """Register a format."""
    FORMATS[name] = read
