"""Top-down pose: the keypoints of the person in each box."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.detections import Detections
from mvpose.heatmaps import Heatmaps
from mvpose.networks.crops import Images, Placement, check_images, cut, in_view, padded, stretched
from mvpose.networks.decoding import Cells, Values, in_image, outer_product, simcc_modes
from mvpose.networks.session import Session, as_session
from mvpose.skeleton import COCO17, Skeleton

_HIGHEST = 2.0  # heat maps beyond this are on another scale
_BLACK = (0, 0, 0)  # beyond the image, as in the training of every head named below


class PoseHead:
    """Boxes of images to keypoints, by a top-down head in an ONNX file.

    The file's outputs say which kind it is: one (n, J, h, w), or (n, h, w, J), is heat maps (CPN, HRNet,
    SimpleBaseline, ViTPose); two, (n, J, Wx) and (n, J, Wy), are SimCC vectors (RTMPose), whose split ratio is Wx over
    the width of the input. Softmax and sigmoid belong in the file; heights scale by ``Card(peak=...)``.

    Args:
        model: the ONNX file, or a session of it. Its card says how crops are padded, what a sure peak is and which
            pixel a cell stands for.
        skeleton: the J joints, in the order of the outputs.
        flip: the flip test: the mean of the crop and its mirror image, for twice the time.
        likelihoods: whether detections carry heat maps on to the pictorial structure; those of a SimCC head are outer
            products.

    Attributes:
        session: the network.
        simcc: whether it is a SimCC head.

    Raises:
        ValueError: as :class:`Session`, or a network whose outputs are neither kind or of other joints.
    """

    def __init__(
        self,
        model: str | Path | Session,
        *,
        skeleton: Skeleton = COCO17,
        flip: bool = False,
        likelihoods: bool = True,
    ) -> None:
        self.session = as_session(model)
        self.skeleton, self.flip, self.likelihoods = skeleton, flip, likelihoods
        self._read_outputs()

    def detect(
        self, images: Images, view: ArrayLike, boxes: ArrayLike, *, box_scores: ArrayLike | None = None
    ) -> Detections:
        """The pose in every box, all views at once.

        Args:
            images: for each view a picture (h, w, 3) uint8, red green blue, or None where there is none.
            view: whose picture each box is in, (m,).
            boxes: x, y, width, height in pixels, (m, 4).
            box_scores: confidence of each, 0 to 1, (m,); the mean score of its keypoints where not given.

        Returns:
            Detections, one for each box in their order; a box without area, outside its image or without one, or
            without a pixel of its crop in it, has no keypoint. Scores are heights of peaks, 1 at most: of a person who
            is hardly in the image a head itself says how unsure it is, so unlike for a descriptor one pixel is enough.

        Raises:
            ValueError: a wrong shape, boxes that are not finite, a view without an image, an image that is none, heat
                maps far above 1.
        """
        view = as_array(view, ("m",), "view", np.int64)
        boxes = as_array(boxes, (len(view), 4), "boxes")
        check_images(images, view, boxes)
        size = self.session.size
        whole = padded(boxes, size, self.session.card.padding)
        # Where only the padding reaches into the image there is nobody to be seen.
        seen = in_view(images, view, stretched(boxes, size), size) & in_view(images, view, whole, size)
        placement = whole.of(seen)
        outputs = self._outputs(images, view[seen], placement)
        found = self._decoded(outputs, view[seen], boxes[seen], placement)
        detections = _among_unseen(found, seen, view, boxes)
        if box_scores is None:
            return detections
        return replace(detections, box_scores=as_array(box_scores, (len(view),), "box_scores"))

    def _read_outputs(self) -> None:
        """Which kind of head it is, and where its cells lie in a crop."""
        shapes, joints, (width, height) = self.session.shapes, len(self.skeleton), self.session.size
        self.simcc = len(shapes) == 2 and all(len(shape) == 2 for shape in shapes)
        if not self.simcc and not (len(shapes) == 1 and len(shapes[0]) == 3):
            named = zip(self.session.outputs, shapes, strict=True)
            got = " and ".join(f"{name!r} (n, {', '.join(map(str, shape))})" for name, shape in named)
            self._refuse(
                f"a pose head has heat maps (n, {joints}, h, w), or SimCC vectors (n, {joints}, Wx) and "
                f"(n, {joints}, Wy), got {got}; choose outputs with Card(outputs=...)"
            )
        self._joints_last = not self.simcc and shapes[0][0] != joints and shapes[0][2] == joints
        found = shapes[0][2] if self._joints_last else shapes[0][0]
        if found != joints or (self.simcc and shapes[1][0] != joints):
            self._refuse(f"has {found} joints, skeleton {self.skeleton.name!r} has {joints}; state the head's skeleton")
        if self.simcc:
            w, h = shapes[0][1], shapes[1][1]
        else:
            h, w = shapes[0][:2] if self._joints_last else shapes[0][1:]
        if w * height != h * width:
            self._refuse(
                f"outputs are {w} wide and {h} high, which is not the aspect of the input, {width} x {height}: "
                "are x and y exchanged? Card(outputs=...) orders SimCC vectors"
            )
        convention = self.session.card.cells
        self._columns, self._rows = Cells.of(convention, w, width), Cells.of(convention, h, height)

    def _outputs(self, images: Images, view: NDArray[np.int64], placement: Placement) -> list[Values]:
        """Heat maps (m, J, h, w), or SimCC vectors (m, J, Wx) and (m, J, Wy), with 1 at a sure peak."""
        outputs = self._run(images, view, placement)
        if self.flip:
            mirrored = self._run(images, view, placement.mirrored(self._columns.middle))
            back = [values[:, list(self.skeleton.mirror)] for values in mirrored]
            back[0] = back[0][..., ::-1]  # x runs along the last axis of heat maps and of the first SimCC vector
            outputs = [0.5 * (one + other) for one, other in zip(outputs, back, strict=True)]
        highest = max(values.max(initial=0.0) for values in outputs)
        if highest > _HIGHEST:
            self._refuse(
                f"heights reach {highest:.3g}, expected about 1 at a sure peak; state that of the head as "
                "Card(peak=...), or export it with its softmax or sigmoid"
            )
        return outputs

    def _run(self, images: Images, view: NDArray[np.int64], placement: Placement) -> list[Values]:
        outputs = self.session(cut(images, view, placement, self.session.size, fill=_BLACK))
        if self._joints_last:
            outputs = [np.moveaxis(values, -1, 1) for values in outputs]
        return [values / np.float32(self.session.card.peak) for values in outputs]

    def _decoded(
        self, outputs: list[Values], view: NDArray[np.int64], boxes: Floats, placement: Placement
    ) -> Detections:
        if not self.simcc:
            heatmaps = in_image(outputs[0], placement, self._columns, self._rows)
            found = Detections.from_heatmaps(view, heatmaps, boxes=boxes, skeleton=self.skeleton)
            return found if self.likelihoods else replace(found, likelihoods=None)
        x, y = outputs
        keypoints, heights = simcc_modes(x, y, placement, self._columns, self._rows)
        found = Detections.from_keypoints(view, keypoints, np.minimum(heights, 1.0), skeleton=self.skeleton)
        maps = outer_product(x, y, placement, self._columns, self._rows) if self.likelihoods else None
        return replace(found, boxes=boxes, likelihoods=maps)

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"network {self.session.path}: {what}")


def _among_unseen(found: Detections, seen: NDArray[np.bool_], view: NDArray[np.int64], boxes: Floats) -> Detections:
    """What was found in the boxes that are seen, and nothing in the others."""
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
