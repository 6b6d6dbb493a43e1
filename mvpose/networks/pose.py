"""Top-down pose estimation: keypoints of the person in each box, or of all people whom a detector finds in a picture.

Heads are trained with one of three conventions for the input pixel of an output cell; see ``cells`` of
:class:`mvpose.networks.card.Card`. The wrong convention causes errors of up to 2 pixels of the input.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array
from mvpose.detections import Detections
from mvpose.heatmaps import Heatmaps
from mvpose.networks.crops import Images, Placement, check_images, crop_images, in_view, padded, stretched
from mvpose.networks.session import Session, as_session
from mvpose.skeleton import COCO17, Skeleton

_HIGHEST = 2.0  # heat maps above this have another scale
_BLACK = (0, 0, 0)  # fill outside the image, as in the training of all heads named below


Values = NDArray[np.float32]

_SPACING = 2.0  # input pixels between cells of an outer product; Gaussians of SimCC are at least twice as wide


class PoseHead:
    """Top-down pose head in an ONNX file, which estimates the keypoints of boxes.

    The outputs of the file determine the kind of head. One output (n, J, h, w) or (n, h, w, J) is heat maps (CPN,
    HRNet, SimpleBaseline, ViTPose). Two outputs (n, J, Wx) and (n, J, Wy) are SimCC vectors (RTMPose), whose split
    ratio is Wx over the width of the input. Softmax and sigmoid must be part of the file; heights are scaled by
    ``Card(peak=...)``.

    Args:
        model: ONNX file, or its session. The card gives padding, height of a confident peak, and cell convention.
        skeleton: the J joints, in the order of the outputs.
        flip: whether to average the crop and its mirror image (flip test), at twice the cost.
        likelihoods: whether detections carry heat maps for the pictorial structure; those of a SimCC head are outer
            products.

    Attributes:
        session: session of the network.
        simcc: whether it is a SimCC head.

    Raises:
        ValueError: as for :class:`Session`, or a network with outputs of neither kind or with other joints.
    """

    def __init__(
        self, model: str | Path | Session, *, skeleton: Skeleton = COCO17, flip: bool = False, likelihoods: bool = True
    ) -> None:
        self.session = as_session(model)
        self.skeleton, self.flip, self.likelihoods = skeleton, flip, likelihoods
        self._read_outputs()

    def detect(
        self, images: Images, view: ArrayLike, boxes: ArrayLike, *, box_scores: ArrayLike | None = None
    ) -> Detections:
        """Estimate the pose in every box, for all views at once.

        Args:
            images: picture of each view, (h, w, 3) uint8, red green blue, or None.
            view: view of each box, (m,).
            boxes: x, y, width, height in pixels, (m, 4).
            box_scores: confidence of each box, 0 to 1, (m,); by default the mean score of its keypoints.

        Returns:
            Detections, one for each box in the given order. A box without area, without an image, or with no pixel of
            its crop inside the image, has no keypoint. Scores are heights of peaks, at most 1. Unlike for a
            descriptor, one pixel inside the image is enough, because the head expresses low confidence by its heights.

        Raises:
            ValueError: a wrong shape, boxes that are not finite, a view beyond the list of images, an invalid image,
                or heat maps far above 1.
        """
        view = as_array(view, ("m",), "view", np.int64)
        boxes = as_array(boxes, (len(view), 4), "boxes")
        check_images(images, view, boxes)
        size = self.session.size
        whole = padded(boxes, size, self.session.card.padding)
        # If only the padding overlaps the image, no part of the person is visible.
        seen = in_view(images, view, stretched(boxes, size), size) & in_view(images, view, whole, size)
        placement = whole.select(seen)
        outputs = self._outputs(images, view[seen], placement)
        found = self._decoded(outputs, view[seen], boxes[seen], placement)
        detections = _with_empty(found, seen, view, boxes)
        if box_scores is None:
            return detections
        return replace(detections, box_scores=as_array(box_scores, (len(view),), "box_scores"))

    def _read_outputs(self) -> None:
        """Determine the kind of head, and the positions of its cells in a crop."""
        shapes, joints, (width, height) = self.session.shapes, len(self.skeleton), self.session.size
        self.simcc = len(shapes) == 2 and all(len(shape) == 2 for shape in shapes)
        if not self.simcc and not (len(shapes) == 1 and len(shapes[0]) == 3):
            named = zip(self.session.outputs, shapes, strict=True)
            got = " and ".join(f"{name!r} (n, {', '.join(map(str, shape))})" for name, shape in named)
            self._refuse(
                f"outputs of a pose head must be heat maps (n, {joints}, h, w), or SimCC vectors (n, {joints}, Wx) and "
                f"(n, {joints}, Wy), got {got}; choose outputs with Card(outputs=...)"
            )
        self._joints_last = not self.simcc and shapes[0][0] != joints and shapes[0][2] == joints
        found = shapes[0][2] if self._joints_last else shapes[0][0]
        if found != joints or (self.simcc and shapes[1][0] != joints):
            self._refuse(
                f"has {found} joints, but skeleton {self.skeleton.name!r} has {joints}; pass the skeleton of the head"
            )
        if self.simcc:
            w, h = shapes[0][1], shapes[1][1]
        else:
            h, w = shapes[0][:2] if self._joints_last else shapes[0][1:]
        if w * height != h * width:
            self._refuse(
                f"outputs are {w} wide and {h} high, which is not the aspect of the input, {width} x {height}: "
                "if x and y are exchanged, order the SimCC vectors by Card(outputs=...)"
            )
        convention = self.session.card.cells
        self._columns, self._rows = (
            Cells.from_convention(convention, w, width),
            Cells.from_convention(convention, h, height),
        )

    def _outputs(self, images: Images, view: Integers, placement: Placement) -> list[Values]:
        """Return heat maps (m, J, h, w), or SimCC vectors (m, J, Wx) and (m, J, Wy), with confident peaks of 1."""
        outputs = self._run(images, view, placement)
        if self.flip:
            mirrored = self._run(images, view, placement.mirrored(self._columns.middle))
            back = [values[:, list(self.skeleton.mirror)] for values in mirrored]
            back[0] = back[0][..., ::-1]  # x runs along the last axis of heat maps and of the first SimCC vector
            outputs = [0.5 * (one + other) for one, other in zip(outputs, back, strict=True)]
        highest = max(values.max(initial=0.0) for values in outputs)
        if highest > _HIGHEST:
            self._refuse(
                f"heights reach {highest:.3g}, expected about 1 at a confident peak; give the peak height of the head "
                "as Card(peak=...), or export the head with its softmax or sigmoid"
            )
        return outputs

    def _run(self, images: Images, view: Integers, placement: Placement) -> list[Values]:
        outputs = self.session(crop_images(images, view, placement, self.session.size, fill=_BLACK))
        if self._joints_last:
            outputs = [np.moveaxis(values, -1, 1) for values in outputs]
        return [values / np.float32(self.session.card.peak) for values in outputs]

    def _decoded(self, outputs: list[Values], view: Integers, boxes: Floats, placement: Placement) -> Detections:
        if not self.simcc:
            heatmaps = placed_heatmaps(outputs[0], placement, self._columns, self._rows)
            found = Detections.from_heatmaps(view, heatmaps, boxes=boxes, skeleton=self.skeleton)
            return found if self.likelihoods else replace(found, likelihoods=None)
        x, y = outputs
        keypoints, heights = simcc_modes(x, y, placement, self._columns, self._rows)
        found = Detections.from_keypoints(view, keypoints, np.minimum(heights, 1.0), skeleton=self.skeleton)
        maps = outer_product(x, y, placement, self._columns, self._rows) if self.likelihoods else None
        return replace(found, boxes=boxes, likelihoods=maps)

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"network {self.session.path}: {what}")


def _with_empty(found: Detections, seen: Bools, view: Integers, boxes: Floats) -> Detections:
    """Merge the detections of the boxes in view with empty detections for the other boxes."""
    if seen.all():
        return found
    count = len(view)

    def spread(values: NDArray, blank: float) -> NDArray:
        result = np.full((count, *values.shape[1:]), blank, values.dtype)
        result[seen] = values
        return result

    maps = found.likelihoods
    if maps is not None:
        maps = Heatmaps(spread(maps.values, 0.0), spread(maps.origin, 0.0), spread(maps.stride, 1.0))
    return Detections(
        view,
        spread(found.keypoints, np.nan),
        spread(found.scores, 0.0),
        boxes,
        spread(found.box_scores, 0.0),
        found.skeleton,
        likelihoods=maps,
    )


@dataclass(frozen=True)
class Cells:
    """Crop pixels of the cells of an output along one axis: cell k is at pixel ``first + step * k``."""

    first: float
    step: float
    count: int

    @classmethod
    def from_convention(cls, convention: str, count: int, extent: int) -> "Cells":
        """Create the cells of an axis of ``extent`` pixels by a convention of ``Card.cells``."""
        if convention == "span":
            return cls(0.0, (extent - 1) / max(count - 1, 1), count)
        step = extent / count
        return cls(0.5 * (step - 1.0) if convention == "area" else 0.0, step, count)

    @property
    def middle(self) -> float:
        """Pixel halfway between the first and the last cell, the mirror axis of the flip test."""
        return self.first + 0.5 * self.step * (self.count - 1)


def placed_heatmaps(values: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """Place heat maps of crops, (m, J, h, w) with confident peaks of 1, in the images; negative values become 0."""
    first, step = np.array([columns.first, rows.first]), np.array([columns.step, rows.step])
    return Heatmaps(np.maximum(values, 0.0), placement.origin + placement.stride * first, placement.stride * step)


def simcc_modes(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> tuple[Floats, Floats]:
    """Return keypoints, (m, J, 2), and heights, (m, J), from SimCC vectors (m, J, Wx) and (m, J, Wy).

    The peak of each vector is found at sub-bin accuracy, as that of a heat map one cell wide. The height is the lower
    of the two peaks, as in the code of RTMPose.
    """
    across, height_x = placed_heatmaps(x[:, :, None, :], placement, columns, Cells(0.0, 1.0, 1)).modes(1)
    down, height_y = placed_heatmaps(y[:, :, :, None], placement, Cells(0.0, 1.0, 1), rows).modes(1)
    keypoints = np.stack([across[:, :, 0, 0], down[:, :, 0, 1]], axis=2)
    return keypoints, np.minimum(height_x, height_y)[:, :, 0]


def outer_product(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """Convert SimCC vectors to heat maps with cells about two input pixels apart.

    The product of two vectors has the height of the lower of the two peaks at their position. A pair of vectors does
    not determine which of two peaks in x belongs to which in y, so two candidates give four peaks in the product.
    """
    x, y = np.maximum(x, 0.0), np.maximum(y, 0.0)
    every_x, every_y = (max(1, round(_SPACING / cells.step)) for cells in (columns, rows))
    higher = np.maximum(x.max(axis=2), y.max(axis=2))[:, :, None, None]
    x, y = x[:, :, ::every_x], y[:, :, ::every_y]
    product: Values = np.einsum("mjy,mjx->mjyx", y, x)
    product /= np.where(higher > 0, higher, 1.0)
    thinned = (
        Cells(columns.first, columns.step * every_x, x.shape[2]),
        Cells(rows.first, rows.step * every_y, y.shape[2]),
    )
    return placed_heatmaps(product, placement, *thinned)
