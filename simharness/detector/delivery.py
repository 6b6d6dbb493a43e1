"""Delivery of pictures: late, repeated or lost pictures give the detections of the picture, not of the frame."""

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from simharness.detector.detection_block import DetectionBlock
from simharness.detector.steps import Context, StepStage, step


@step("delivery", stage=StepStage.DELIVERY)
def deliver_pictures(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Arrange the detections as the pictures arrive."""
    return rearrange_by_source(block, context.views.source)


def rearrange_by_source(block: DetectionBlock, source: NDArray[np.int64]) -> DetectionBlock:
    """Return the detections of the delivered pictures: the same ones for the same picture, none where none arrives.

    Args:
        block: detections in the picture that each view takes in each frame.
        source: frame whose picture is delivered, (T, V); -1 where none is.
    """
    if (source == np.arange(len(source))[:, None]).all():  # every picture arrives in time
        return block
    picture, view = np.maximum(source, 0), np.arange(source.shape[1])
    changed = {field.name: getattr(block, field.name)[picture, view] for field in fields(block)}
    changed["present"] = changed["present"] & (source >= 0)[..., None]
    return DetectionBlock(**changed)
