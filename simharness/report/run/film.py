"""Film of a run: the pictures of all cameras as one animation that a browser plays."""

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

_MAX_FRAMES = 60  # more would be larger than the rest of the page
_MAX_VIEWS = 9
_QUALITY = 60


@dataclass(frozen=True)
class Animation:
    """Animated picture.

    Attributes:
        caption: description for the page.
        webp: contents of the WebP file.
    """

    caption: str
    webp: bytes

    @property
    def uri(self) -> str:
        """The file as a data URI for a page."""
        return "data:image/webp;base64," + base64.b64encode(self.webp).decode()


def animated_frames(count: int) -> list[int]:
    """Return the frames of ``count`` that a film shows: all where there are few, else evenly spaced ones."""
    return list(range(0, count, -(-count // _MAX_FRAMES)))


def animate(previews: Mapping[int, Sequence[NDArray[np.uint8]]], record: Record) -> Animation:
    """Make a film with the mosaic of all views of each frame, played in real time.

    Args:
        previews: colour pictures by frame index, one (h, w, 3) for each view; at least one frame.
        record: the run, for the names of the cameras and the times of the frames.
    """
    frames = sorted(previews)
    shown = min(len(record.rig), _MAX_VIEWS)
    titles = [camera.name for camera in record.rig][:shown]
    sheets = [Image.fromarray(mosaic(list(previews[frame][:shown]), titles)) for frame in frames]
    step = float(record.time[frames[1]] - record.time[frames[0]]) if len(frames) > 1 else 1.0
    buffer = io.BytesIO()
    sheets[0].save(
        buffer, "WEBP", save_all=True, append_images=sheets[1:], duration=round(1000 * step), loop=0, quality=_QUALITY
    )
    caption = f"{len(frames)} of {len(record.time)} frames in real time, {shown} of {len(record.rig)} cameras."
    return Animation(caption, buffer.getvalue())
