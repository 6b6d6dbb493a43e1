"""Times of the pictures of a frame."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.detections import Detections


def picture_times(
    detections: Detections, cameras: int, previous: float | None, period: float
) -> tuple[float, Floats, Bools]:
    """Return the time of a frame, and for each camera how far its picture is from it and whether there is one.

    The time of a frame is that of its latest picture. Detections without times are ``period`` after the previous frame,
    and all cameras are taken to have delivered a picture.

    Args:
        detections: detections of the frame.
        cameras: number of cameras, V.
        previous: time of the previous frame, seconds; None before the first.
        period: time between frames without times, seconds.

    Returns:
        Time of the frame, seconds; time from the frame to the picture of each camera, (V,), at most 0 seconds, 0
        without a picture; and whether each camera gave a picture, (V,).

    Raises:
        ValueError: times of another number of cameras, no picture at all, a detection of a camera without a picture,
            or a frame before the previous one.
    """
    if detections.time is None:
        now = 0.0 if previous is None else previous + period
        return now, np.zeros(cameras), np.ones(cameras, np.bool_)
    if len(detections.time) != cameras:
        raise ValueError(f"time must be ({cameras},), the time of each camera's picture, got ({len(detections.time)},)")
    pictures = np.isfinite(detections.time)
    if not pictures.any():
        if previous is None:
            raise ValueError("the first frame must have at least one picture with a time, got NaN for all cameras")
        return previous + period, np.zeros(cameras), pictures
    silent = detections.view[~pictures[detections.view]]
    if len(silent):
        raise ValueError(f"camera {silent[0]} has detections, but the time of its picture is NaN (no picture)")
    now = float(detections.time[pictures].max())
    if previous is not None and now < previous:
        raise ValueError(
            f"frames must come in the order of their times, got {now:.6g} s after {previous:.6g} s: sort them, or "
            "start another tracker"
        )
    return now, np.where(pictures, detections.time - now, 0.0), pictures
