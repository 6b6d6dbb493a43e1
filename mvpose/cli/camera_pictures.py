"""Videos and folders of pictures of a recording: opened, of one rate and of the calibrated size, each of its camera."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

from mvpose.camera import Camera
from mvpose.files.message_text import listed
from mvpose.formats.pictures import PictureSource, of_cameras, open_pictures
from mvpose.formats.views.assignment import assign
from mvpose.formats.views.plausibility import UNKNOWN_SIZE
from mvpose.formats.views.sources import Source


def open_videos(paths: Sequence[Path]) -> list[PictureSource]:
    """Open all videos.

    Raises:
        ValueError: a video that cannot be read, or two of one name, whose detections would share a file.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # no lines of the decoder beside our message
    sources = [open_pictures(path) for path in of_cameras(paths)]
    names = [each.name for each in sources]
    for source in sources:
        if names.count(source.name) > 1:
            raise ValueError(f"two videos are called {source.name}; rename one: detections are named as the videos")
    return sources


def common_rate(sources: Sequence[PictureSource]) -> float | None:
    """Return the frames per second of videos; None where none states it.

    Raises:
        ValueError: different rates.
    """
    rates = {source.name: source.fps for source in sources if math.isfinite(source.fps)}
    if rates and max(rates.values()) > 1.001 * min(rates.values()):
        text = ", ".join(f"{name} {rate:.6g}" for name, rate in rates.items())
        raise ValueError(
            f"the videos have different rates: {text} frames per second; convert them to one rate, so that "
            "frame k of all is of one moment"
        )
    return next(iter(rates.values()), None)


def assigned(cameras: Sequence[Camera], sources: Sequence[PictureSource]) -> list[PictureSource]:
    """Return the pictures of each camera, found by the names of the cameras.

    Raises:
        ValueError: as :func:`mvpose.formats.views.assignment.assign`.
    """
    by_path = {source.path: source for source in sources}
    named = [Source(source.name, source.path) for source in sources]
    found = assign([camera.name for camera in cameras], named, what="pictures")
    return [by_path[source.path] for source in found.sources]


def check_sizes(cameras: Sequence[Camera], pictures: Sequence[PictureSource]) -> None:
    """Check that pictures have the size for which their cameras are calibrated, where the calibration states it.

    Raises:
        ValueError: another size.
    """
    wrong = [
        f"{camera.name} {_text(source.size)} instead of {_text(camera.size)}"
        for camera, source in zip(cameras, pictures, strict=True)
        if camera.size not in (UNKNOWN_SIZE, source.size)
    ]
    if wrong:
        raise ValueError(
            f"pictures are not of the calibrated size: {listed(wrong)} pixels; convert them to that size, or scale the "
            "intrinsics of the calibration to theirs"
        )


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
