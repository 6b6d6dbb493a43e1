"""Pictures that arrive late, twice or never: what is detected goes by the picture, not by the frame."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from simharness.detector.detection_block import Found


def delivered(found: Found, source: NDArray[np.int64]) -> Found:
    """What is found in every picture, as views deliver the pictures.

    A detector finds the same in the same picture, and nothing in one that never arrives.

    Args:
        found: in the picture that each view takes in each frame.
        source: the frame whose picture is delivered, (T, V); -1 where none is.
    """
    if (source == np.arange(len(source))[:, None]).all():  # as it should be
        return found
    picture, view = np.maximum(source, 0), np.arange(source.shape[1])
    changed = {field.name: getattr(found, field.name)[picture, view] for field in fields(found)}
    changed["there"] = changed["there"] & (source >= 0)[..., None]
    return Found(**changed)
