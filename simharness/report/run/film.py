"""The film of a run: what every camera recorded, as one moving picture that a browser plays."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from simharness.report.figures.mosaic import mosaic
from simharness.trial.run_folder import Record

_MOST_FRAMES = 60  # of a film: more would outweigh the rest of the page
_MOST_VIEWS = 9
_QUALITY = 60


@dataclass(frozen=True)
class Animation:
    """A moving picture.

    Attributes:
        caption: what to see in it.
        webp: the file.
    """

    caption: str
    webp: bytes

    @property
    def uri(self) -> str:
        """The file as a data URI for a page."""
        return "data:image/webp;base64," + base64.b64encode(self.webp).decode()


def animated_frames(count: int) -> list[int]:
    """Which of ``count`` frames a film shows: evenly spaced, all where there are few."""
    return list(range(0, count, -(-count // _MOST_FRAMES)))


def animate(previews: Mapping[int, Sequence[NDArray[np.uint8]]], record: Record) -> Animation:
    """Lay out the views of each frame as one picture and join them at the speed of life.

    Args:
        previews: colour pictures by frame, one (h, w, 3) of each view, at least one frame.
        record: names the cameras and knows when each frame was.
    """
    frames = sorted(previews)
    shown = min(len(record.rig), _MOST_VIEWS)
    titles = [camera.name for camera in record.rig][:shown]
    sheets = [Image.fromarray(mosaic(list(previews[frame][:shown]), titles)) for frame in frames]
    step = float(record.time[frames[1]] - record.time[frames[0]]) if len(frames) > 1 else 1.0
    buffer = io.BytesIO()
    sheets[0].save(
        buffer, "WEBP", save_all=True, append_images=sheets[1:], duration=round(1000 * step), loop=0, quality=_QUALITY
    )
    caption = f"{len(frames)} of {len(record.time)} frames in real time, {shown} of {len(record.rig)} cameras."
    return Animation(caption, buffer.getvalue())
