"""Registry of formats of 2D detections: of ``mvpose estimate``, and of recordings (``detections.format``).

To add a format, write one module beside this one with a constant ``FORMAT``, a
:class:`~mvpose.formats.detections.detection_file.DetectionFormat` (:mod:`.coco_results` is an example), and add it to
:data:`FORMATS`. Programs that use mvpose as a library call :func:`register` instead.
"""

from pathlib import Path

from mvpose.formats.detections import coco_results, mmpose, openpose, rtmlib
from mvpose.formats.detections.detection_file import WHAT, DetectionFile, DetectionFormat, summary

FORMATS: dict[str, DetectionFormat] = {
    "openpose": openpose.FORMAT,
    "coco": coco_results.FORMAT,
    "mmpose": mmpose.FORMAT,
    "rtmlib": rtmlib.FORMAT,
}
"""Registered formats by name; the first that recognises a file reads it."""


def register(name: str, added: DetectionFormat) -> None:
    """Register a format."""
    FORMATS[name] = added


def suffixes() -> tuple[str, ...]:
    """Return the endings of files of detections."""
    return tuple(dict.fromkeys(suffix for each in FORMATS.values() for suffix in each.suffixes))


def formats_for(path: Path) -> list[DetectionFormat]:
    """Return the formats whose files have the ending of a file."""
    return [each for each in FORMATS.values() if path.suffix.lower() in each.suffixes]


def format_of(file: DetectionFile) -> DetectionFormat:
    """Return the format of a file.

    Raises:
        ValueError: no registered format recognises it.
    """
    for each in formats_for(file.path):
        if each.recognises(file):
            return each
    if "annotations" in file.object:
        raise ValueError(
            f"{file.path}: COCO annotations; expected COCO results, a list of {{image_id, keypoints, score}}"
        )
    got = sorted(file.arrays) if file.json is None else summary(file.json)
    raise ValueError(f"{file.path}: expected {WHAT}; got {got}")
