"""Appearance descriptors of people from a person re-identification (re-ID) network."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.detections import Detections
from mvpose.networks.crops import Images, check_images, crop_images, in_view, stretched
from mvpose.networks.session import Session, as_session

DEFAULT = Path(__file__).parent / "data" / "reid.onnx"
"""Re-ID network that is part of mvpose."""

_LEAST = 0.3
"""Least fraction of a crop's pixels that must be inside the image for a descriptor.

With a smaller fraction the descriptor depends more on the fill colour than on the person. Measured on 240 rendered
crops that the fill covers from one side (first figure: from the left or right, second: from below). Pairs of covered
crops of two different people that the default network takes for one person (distance below its midpoint): 96 % and
88 % if 0.1 of the crop is left, 22 % and 50 % at 0.2, 7 % and 17 % at 0.3, and 1 % for whole crops. Pairs of a covered
and a whole crop of the same person that it takes for one: 30 % and 11 % at 0.2, 60 % and 45 % at 0.3.
"""


class ReId:
    """Re-ID network that computes unit descriptors of boxes, which are similar for one person in all views.

    The ONNX file must have one descriptor per crop as output, (n, D), or (n, D, 1, 1) after pooling. Exports of OSNet,
    ResNet and CamStyle work unchanged.

    Args:
        model: ONNX file, or its session.

    Attributes:
        session: session of the network.
        dimensions: number of dimensions D of a descriptor.

    Raises:
        ValueError: as for :class:`Session`, or a network whose output is not a descriptor.
    """

    def __init__(self, model: str | Path | Session = DEFAULT) -> None:
        self.session = as_session(model)
        shapes = self.session.shapes
        if len(shapes) != 1:
            names = ", ".join(map(repr, self.session.outputs))
            raise ValueError(
                f"network {self.session.path}: re-ID reads one output, but the file has {len(shapes)}: {names}; "
                "choose one with Card(outputs=(name,))"
            )
        self.dimensions = shapes[0][0]
        if self.dimensions < 2 or shapes[0][1:] != (1,) * len(shapes[0][1:]):
            shape = ", ".join(map(str, shapes[0]))
            raise ValueError(
                f"network {self.session.path}: output {self.session.outputs[0]!r} must be descriptors (n, D) with D "
                f"of 2 or more, got (n, {shape}); pass a re-ID network"
            )

    @property
    def affinity(self) -> AppearanceAffinity:
        """Affinity with the scale on the card of the network, or with the general scale if the card has none."""
        card = self.session.card
        if card.midpoint is None or card.slope is None:
            return AppearanceAffinity()
        return AppearanceAffinity(midpoint=card.midpoint, slope=card.slope)

    def describe(self, detections: Detections, images: Images) -> Detections:
        """Add the descriptors of their boxes to detections; see :meth:`descriptors`."""
        return replace(detections, descriptors=self.descriptors(images, detections.view, detections.boxes))

    def descriptors(self, images: Images, view: ArrayLike, boxes: ArrayLike) -> Floats:
        """Compute the descriptors of boxes, for all views at once.

        Where a box extends beyond its image, the crop has the colour that normalisation maps to 0. A box that is
        mostly outside has no descriptor, because the descriptor would be that of the colour, and different people
        would match.

        Args:
            images: picture of each view, (h, w, 3) uint8, red green blue, or None.
            view: view of each box, (m,).
            boxes: x, y, width, height in pixels, (m, 4).

        Returns:
            Unit vectors, (m, D); NaN for a box without area or without an image, for a box with less than 0.3 of its
            crop pixels inside the image, and where the output of the network is zero.

        Raises:
            ValueError: a wrong shape, boxes that are not finite, a view beyond the list of images, or an invalid
                image.
        """
        view = as_array(view, ("m",), "view", np.int64)
        boxes = as_array(boxes, (len(view), 4), "boxes")
        check_images(images, view, boxes)
        whole = stretched(boxes, self.session.size)
        seen = in_view(images, view, whole, self.session.size, least=_LEAST)
        red, green, blue = (round(255 * min(max(mean, 0.0), 1.0)) for mean in self.session.card.mean)
        placement = whole.select(seen)
        crops = crop_images(images, view[seen], placement, self.session.size, fill=(red, green, blue))
        result = np.full((len(view), self.dimensions), np.nan)
        (raw,) = self.session(crops)
        raw = raw.reshape(len(crops), self.dimensions).astype(np.float64)
        length = np.linalg.norm(raw, axis=1, keepdims=True)
        result[seen] = raw / np.where(length > 0, length, np.nan)
        return result
