"""Descriptors of what people look like, from a person re-identification network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.detections import Detections
from mvpose.networks.crops import Images, check_images, cut, in_view, stretched
from mvpose.networks.session import Session, as_session

DEFAULT = Path(__file__).parent / "data" / "reid.onnx"
"""The network that comes with mvpose."""

_LEAST = 0.3
"""Share of a crop's pixels that must be inside the image for a descriptor.

With less a descriptor is more the fill's than the person's. Measured on 240 rendered crops covered from one side by the
fill, by the share of pairs of cut crops of two people whom the shipped network takes for one (distance below its
midpoint), covered sideways and from below: at 0.1 of the crop left 96 % and 88 %, at 0.2 22 % and 50 %, at 0.3 7 % and
17 %, of whole crops 1 %. One person's cut and whole crop are taken for one at 0.2 in 30 % and 11 %, at 0.3 in 60 % and
45 %.
"""


class ReId:
    """Boxes of images to unit descriptors: one person's lie close together in every view.

    Any ONNX file with one descriptor for each crop will do: (n, D), or (n, D, 1, 1) as pooling leaves it. Exports of
    OSNet, ResNet and CamStyle work as they are.

    Args:
        model: the ONNX file, or a session of it.

    Attributes:
        session: the network.
        dimensions: D.

    Raises:
        ValueError: as :class:`Session`, or a network whose output is no descriptor.
    """

    def __init__(self, model: str | Path | Session = DEFAULT) -> None:
        self.session = as_session(model)
        shapes = self.session.shapes
        if len(shapes) != 1:
            names = ", ".join(map(repr, self.session.outputs))
            raise ValueError(
                f"network {self.session.path}: re-ID reads one output, the file has {len(shapes)}: {names}; "
                "choose with Card(outputs=(name,))"
            )
        self.dimensions = shapes[0][0]
        if self.dimensions < 2 or shapes[0][1:] != (1,) * len(shapes[0][1:]):
            shape = ", ".join(map(str, shapes[0]))
            raise ValueError(
                f"network {self.session.path}: output {self.session.outputs[0]!r} must be descriptors (n, D) with D "
                f"of 2 or more, got (n, {shape}): is it a re-ID network?"
            )

    @property
    def affinity(self) -> AppearanceAffinity:
        """What the network's distances mean: the scale on its card, or the general one where it states none."""
        card = self.session.card
        if card.midpoint is None or card.slope is None:
            return AppearanceAffinity()
        return AppearanceAffinity(midpoint=card.midpoint, slope=card.slope)

    def describe(self, detections: Detections, images: Images) -> Detections:
        """Detections with the descriptors of their boxes; see :meth:`descriptors`."""
        return replace(detections, descriptors=self.descriptors(images, detections.view, detections.boxes))

    def descriptors(self, images: Images, view: ArrayLike, boxes: ArrayLike) -> Floats:
        """Descriptors of boxes, all views at once.

        Where a box reaches beyond its image, the crop is of the colour that normalisation makes 0. A box that lies
        almost all there has no descriptor: it would be that of the colour, and strangers would match.

        Args:
            images: for each view a picture (h, w, 3) uint8, red green blue, or None where there is none.
            view: whose picture each box is in, (m,).
            boxes: x, y, width, height in pixels, (m, 4).

        Returns:
            Unit vectors, (m, D); NaN for a box without area or without an image, for one of which less than 0.3 is
            inside its image (counted in pixels of the crop), and where the network answers with zeros.

        Raises:
            ValueError: a wrong shape, boxes that are not finite, a view without an image, an image that is none.
        """
        view = as_array(view, ("m",), "view", np.int64)
        boxes = as_array(boxes, (len(view), 4), "boxes")
        check_images(images, view, boxes)
        whole = stretched(boxes, self.session.size)
        seen = in_view(images, view, whole, self.session.size, least=_LEAST)
        red, green, blue = (round(255 * min(max(mean, 0.0), 1.0)) for mean in self.session.card.mean)
        placement = whole.of(seen)
        crops = cut(images, view[seen], placement, self.session.size, fill=(red, green, blue))
        result = np.full((len(view), self.dimensions), np.nan)
        (raw,) = self.session(crops)
        raw = raw.reshape(len(crops), self.dimensions).astype(np.float64)
        length = np.linalg.norm(raw, axis=1, keepdims=True)
        result[seen] = raw / np.where(length > 0, length, np.nan)
        return result
