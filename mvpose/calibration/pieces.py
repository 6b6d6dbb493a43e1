"""Tracklets cut into windows of time, which are matched between views as a whole.

Single poses of different people often fit each other by chance, those of two people who move for seconds rarely do.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.tracklets import Tracklets, chosen_frames, frame_times

_SPACING = 0.2  # seconds between frames that are compared; errors of detectors last longer
_WINDOW = 2.0  # seconds over which tracklets are matched as a whole; in it a walking person takes four steps


@dataclass(frozen=True)
class Pieces:
    """Tracklets cut into windows of time: what is matched between views."""

    keypoints: Floats
    """Pixels as detected, (n, J, 2); NaN where missing."""
    sigma: Floats
    """Standard deviation of each keypoint, pixels, (n, J); infinite where missing."""
    view: Integers
    """View of each detection, (n,)."""
    frame: Integers
    """Frame of each detection, (n,)."""
    tracklet: Integers
    """Tracklet of each detection, (n,)."""
    piece: Integers
    """Piece of each detection, (n,), counted within its view and window."""
    start: Integers
    """First detection of each view and window, (V, W); detections are sorted by view, window, frame."""
    stop: Integers
    """One past the last one, (V, W)."""
    count: Integers
    """Number of pieces of each view and window, (V, W)."""
    mirror: Integers
    """Left-right counterpart of each joint, (J,)."""

    @property
    def windows(self) -> int:
        """Number of windows, W."""
        return self.start.shape[1]


def cut_into_windows(tracklets: Tracklets, *, spacing: float = _SPACING, window: float = _WINDOW) -> Pieces:
    """Return the detections of frames about ``spacing`` seconds apart, in windows of ``window`` seconds."""
    views = tracklets.times.shape[1]
    chosen = chosen_frames(tracklets, spacing=spacing)
    when = frame_times(tracklets.times)
    kept = chosen[tracklets.frame]
    frame, view, tracklet = tracklets.frame[kept], tracklets.view[kept], tracklets.tracklet[kept]
    number = np.floor((when[frame] - when[chosen].min(initial=np.inf)) / window + 1e-9).astype(np.int64)
    _, number = np.unique(number, return_inverse=True)  # windows without detections do not count
    windows = int(number.max(initial=-1)) + 1
    order = np.lexsort((tracklet, frame, number, view))
    frame, view, tracklet, number = frame[order], view[order], tracklet[order], number[order]
    cell = view * windows + number
    start = np.searchsorted(cell, np.arange(views * windows)).reshape(views, windows)
    stop = np.searchsorted(cell, np.arange(views * windows), side="right").reshape(views, windows)
    piece, count = np.zeros(len(cell), np.int64), np.zeros((views, windows), np.int64)
    for v in range(views):
        for w in range(windows):
            names, piece[start[v, w] : stop[v, w]] = np.unique(tracklet[start[v, w] : stop[v, w]], return_inverse=True)
            count[v, w] = len(names)
    return Pieces(
        tracklets.keypoints[kept][order],
        tracklets.sigma[kept][order],
        view,
        frame,
        tracklet,
        piece,
        start,
        stop,
        count,
        np.array(tracklets.skeleton.mirror, np.int64),
    )
