"""Pictures that arrive late, twice or never: what is detected goes by the picture, not by the frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections


def delivered(values: NDArray[Any], source: NDArray[np.int64]) -> NDArray[Any]:
    """What is known of every picture (T, V, ...), as views deliver the pictures.

    Args:
        values: of the picture that each view takes in each frame.
        source: the frame whose picture is delivered, (T, V); what stands where there is none (-1) means nothing.
    """
    return values[np.maximum(source, 0), np.arange(source.shape[1])]


def arriving(frames: Sequence[Detections], source: NDArray[np.int64]) -> Detections:
    """The detections of one frame, of which each view's are those of the frame that it delivers.

    Args:
        frames: detections in the pictures of every frame, sorted by view.
        source: the frame whose picture each view delivers, (V,); -1 where none arrives.
    """
    if source[0] >= 0 and (source == source[0]).all():  # one frame, as it should be
        return frames[source[0]]
    views = [(frames[frame], view) for view, frame in enumerate(source) if frame >= 0]
    if not views:
        return Detections.empty(frames[0].skeleton)
    fields = ("view", "keypoints", "scores", "boxes", "box_scores")
    chosen: dict[str, Any] = {
        field: np.concatenate([getattr(found, field)[found.view == view] for found, view in views]) for field in fields
    }
    return Detections(**chosen, skeleton=frames[0].skeleton)
