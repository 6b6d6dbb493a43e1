"""People in pictures by detectors in ONNX files: their boxes, and their keypoints from one-stage heads.

The outputs of the file determine its kind:

- ``yolox``: one output (1, A, 5 + C), cells of strides 8, 16 and 32 with box, objectness and classes (Ge et al., 2021);
- ``yolo``: one output (1, 4 + C, A), or with keypoints (1, 5 + 3 J, A), of Ultralytics' YOLOv8 and later;
- ``rtmo``: boxes (1, N, 5) and keypoints (1, N, J, 3), after non-maximum suppression (Lu et al., CVPR 2024);
- boxes (1, N, 5) and labels (1, N) after non-maximum suppression, as MMDeploy exports: ``yolox`` or ``rtmdet`` (Lyu et
  al., 2022), which take pictures of different normalisation, so that the name of the file or ``kind`` must say which.

Class 0 is people, as in COCO.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.networks.card import Card
from mvpose.networks.crops import Pixels, Placement, crop_images
from mvpose.networks.pose import PoseHead
from mvpose.networks.posenet import PoseNet
from mvpose.networks.session import Provider, Session
from mvpose.skeleton import COCO17, Skeleton
from mvpose.wholebody import SKELETONS, skeleton_by_name

Kind = Literal["yolox", "rtmdet", "rtmo", "yolo"]

CARDS: dict[Kind, Card] = {
    "yolox": Card(mean=(0.0, 0.0, 0.0), std=(1 / 255,) * 3, color_order="bgr"),
    "rtmdet": Card(color_order="bgr"),
    "rtmo": Card(mean=(0.0, 0.0, 0.0), std=(1 / 255,) * 3, color_order="bgr"),
    "yolo": Card(mean=(0.0, 0.0, 0.0), std=(1.0, 1.0, 1.0)),
}
"""Normalisation of the pictures that the public networks of each kind take."""

_STRIDES = (8, 16, 32)
_FILL = (114, 114, 114)  # around the picture, as in the training of all of them
_USUAL_SIZE = 640  # of files that leave it open
_PERSON = 0
_BOX = 5  # columns of boxes after non-maximum suppression: corners and score


@dataclass(frozen=True)
class PeopleInPicture:
    """People in one picture."""

    boxes: Floats
    """x, y, width, height, (m, 4), pixels."""
    scores: Floats
    """Confidence of each box, 0 to 1, (m,)."""
    keypoints: Floats | None = None
    """(m, J, 2), pixels, of one-stage heads; None for detectors."""
    keypoint_scores: Floats | None = None
    """(m, J), 0 to 1; None for detectors."""

    @classmethod
    def joined(cls, parts: "Sequence[PeopleInPicture]") -> "PeopleInPicture":
        """Return the people of several, who all have keypoints."""
        columns = ("boxes", "scores", "keypoints", "keypoint_scores")
        return cls(*(np.concatenate([getattr(each, column) for each in parts]) for column in columns))

    def select(self, rows: Integers) -> "PeopleInPicture":
        """Return some people, in a given order."""
        kept = [None if each is None else each[rows] for each in (self.keypoints, self.keypoint_scores)]
        return PeopleInPicture(self.boxes[rows], self.scores[rows], *kept)


class PeopleFinder(Protocol):
    """What finds the people of pictures."""

    least: float
    """Least score of a person."""

    @property
    def kind(self) -> str:
        """Kind of the network."""

    @property
    def one_stage(self) -> bool:
        """Whether it gives keypoints as well."""

    def find(self, picture: Pixels) -> PeopleInPicture:
        """Return the people in a picture, (h, w, 3) uint8, red green blue, the most confident first."""


class PersonDetector:
    """Detector of people in an ONNX file.

    Args:
        model: ONNX file, or its session.
        kind: its kind; None: by its outputs and its name.
        least: least score of a person.
        overlap: intersection over union above which the weaker of two boxes is left out.
        provider: as of :class:`mvpose.networks.Session`.
        threads: as of :class:`mvpose.networks.Session`.

    Attributes:
        kind: kind of the network.
        one_stage: whether it gives keypoints as well.
        least: least score of a person.

    Raises:
        ValueError: as for :class:`mvpose.networks.Session`, or outputs of no known kind.
    """

    def __init__(
        self,
        model: "str | Path | PictureSession",
        *,
        kind: Kind | None = None,
        least: float = 0.3,
        overlap: float = 0.65,
        provider: Provider = "cpu",
        threads: int = 1,
    ) -> None:
        if kind is not None and kind not in get_args(Kind):
            raise ValueError(f"kind of a detector must be one of {', '.join(get_args(Kind))}, got {kind!r}")
        self._session = as_picture_session(model, provider=provider, threads=threads)
        self.least, self._overlap = least, overlap
        self.kind = kind or self._recognised()
        if self._session.card == Card():  # the file has none
            self._session.card = replace(CARDS[self.kind], size=self._session.size)
        self.one_stage = self.find(np.zeros((64, 64, 3), np.uint8)).keypoints is not None

    def find(self, picture: Pixels) -> PeopleInPicture:
        """Return the people in a picture, (h, w, 3) uint8, red green blue, the most confident first."""
        size = self._session.size
        height, width = picture.shape[:2]
        stride = max(width / size[0], height / size[1])
        origin = np.full((1, 2), 0.5 * stride - 0.5)
        placement = Placement(origin, np.full((1, 2), stride))
        crop = crop_images([picture], np.zeros(1, np.int64), placement, size, fill=_FILL)
        found = self._decoded(self._session.outputs_of(crop))
        rows = np.argsort(-found.scores, kind="stable")
        found = found.select(rows[found.scores[rows] >= self.least])
        found = found.select(suppressed(found.boxes, overlap=self._overlap))
        keypoints = None if found.keypoints is None else stride * found.keypoints
        return PeopleInPicture(stride * found.boxes, np.minimum(found.scores, 1.0), keypoints, found.keypoint_scores)

    def _decoded(self, outputs: Sequence[NDArray[Any]]) -> PeopleInPicture:
        if len(outputs) == 1 and outputs[0].ndim == 3 and outputs[0].shape[2] != _BOX:
            values = outputs[0][0].astype(float)
            return decode_yolox(values, self._session.size) if self.kind == "yolox" else decode_yolo(values)
        boxes = next(each for each in outputs if each.ndim == 3 and each.shape[2] == _BOX)[0].astype(float)
        corners, scores = boxes[:, :4], boxes[:, 4]
        labels = next((each[0] for each in outputs if each.ndim == 2), np.zeros(len(boxes)))
        points = next((each[0] for each in outputs if each.ndim == 4), None)
        found = PeopleInPicture(_of_corners(corners), np.where(labels == _PERSON, scores, 0.0))
        if points is None:
            return found
        return replace(found, keypoints=points[..., :2].astype(float), keypoint_scores=np.clip(points[..., 2], 0, 1))

    def _recognised(self) -> Kind:
        """Return the kind of the network by the shapes of its outputs, or else by the name of its file."""
        shapes = [each.shape for each in self._session.outputs_of(_blank(self._session.size))]
        cells = _cells(self._session.size)
        if any(len(shape) == 4 for shape in shapes):
            return "rtmo"
        if len(shapes) == 1 and len(shapes[0]) == 3:
            if shapes[0][1] == cells and shapes[0][2] > 5:
                return "yolox"
            if shapes[0][2] == cells and shapes[0][1] > 4:
                return "yolo"
        name = self._session.path.name.lower()
        if any(len(shape) == 3 and shape[2] == _BOX for shape in shapes):
            for kind in get_args(Kind):
                if kind in name:
                    return kind
            raise ValueError(
                f"network {self._session.path}: boxes after non-maximum suppression, of YOLOX or RTMDet; name the kind "
                "(--detector-kind yolox or rtmdet), because they take pictures of different normalisation"
            )
        raise ValueError(
            f"network {self._session.path}: outputs {shapes} are of no detector; expected YOLOX (1, {cells}, 85), "
            f"YOLO (1, 84, {cells}), or boxes (1, N, 5) with labels (RTMDet, YOLOX) or keypoints (RTMO)"
        )


class PictureSession(Session):
    """Session of a network that takes whole pictures, one at a time, and finds a different number of people in each."""

    def outputs_of(self, crop: Pixels) -> list[NDArray[Any]]:
        """Return the outputs for one picture of the input's size, (1, height, width, 3) uint8."""
        feed = self._feed(crop, 1)
        try:
            return [np.asarray(each) for each in self._session.run(list(self.outputs), {self._input: feed})]
        except Exception as error:  # onnxruntime's exceptions share no base class
            self._refuse(f"fails on a picture. Message of onnxruntime: {error}", error)

    def _output_shapes(self) -> tuple[tuple[int, ...], ...]:
        if self._fixed > 1:
            self._refuse(f"takes {self._fixed} pictures at a time; export it for one")
        return ()

    def _input_size(self, width: int | str | None, height: int | str | None) -> tuple[int, int]:
        usual = self.card.size or (_USUAL_SIZE, _USUAL_SIZE)
        sides = [each if isinstance(each, int) and each > 0 else usual[k] for k, each in enumerate((width, height))]
        return sides[0], sides[1]


def as_picture_session(model: str | Path | PictureSession, *, provider: Provider, threads: int) -> PictureSession:
    """Return a session unchanged, or open a file."""
    return model if isinstance(model, PictureSession) else PictureSession(model, provider=provider, threads=threads)


def decode_yolox(values: Floats, size: tuple[int, int]) -> PeopleInPicture:
    """Return the boxes of all cells, (A, 5 + C): x, y relative to the cell, log width and height, in strides."""
    grids, strides = [], []
    for each in _STRIDES:
        rows, columns = np.divmod(np.arange((size[1] // each) * (size[0] // each)), size[0] // each)
        grids.append(np.stack([columns, rows], axis=1))
        strides.append(np.full(len(rows), each))
    stride = np.concatenate(strides)[:, None]
    middle = (values[:, :2] + np.concatenate(grids)) * stride
    sides = np.exp(np.minimum(values[:, 2:4], 20.0)) * stride
    return PeopleInPicture(np.concatenate([middle - sides / 2, sides], axis=1), values[:, 4] * values[:, 5 + _PERSON])


def decode_yolo(values: Floats) -> PeopleInPicture:
    """Return the boxes of all cells, (4 + C, A), and their keypoints, (5 + 3 J, A): middle, width, height in pixels."""
    x, y, width, height, score = values[:5]
    boxes = np.stack([x - width / 2, y - height / 2, width, height], axis=1)
    points = values[5:]
    if len(points) < 3 or len(points) % 3 or np.abs(points).max(initial=0.0) <= 1.0:  # other classes
        return PeopleInPicture(boxes, score)
    points = points.reshape(-1, 3, points.shape[1]).transpose(2, 0, 1)
    return PeopleInPicture(boxes, score, points[..., :2], np.clip(points[..., 2], 0.0, 1.0))


def suppressed(boxes: Floats, *, overlap: float) -> Integers:
    """Return the rows that remain after non-maximum suppression of boxes (m, 4) in the order of their scores."""
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    areas = boxes[:, 2] * boxes[:, 3]
    kept = np.zeros(0, np.int64)
    for row in range(len(boxes)):
        shared = np.clip(np.minimum(high[kept], high[row]) - np.maximum(low[kept], low[row]), 0, None).prod(axis=1)
        if not (shared > overlap * (areas[kept] + areas[row] - shared)).any():
            kept = np.append(kept, row)
    return kept


def _of_corners(corners: Floats) -> Floats:
    return np.concatenate([corners[:, :2], np.maximum(corners[:, 2:] - corners[:, :2], 0.0)], axis=1)


def _cells(size: tuple[int, int]) -> int:
    return sum((size[0] // stride) * (size[1] // stride) for stride in _STRIDES)


def _blank(size: tuple[int, int]) -> Pixels:
    return np.full((1, size[1], size[0], 3), _FILL[0], np.uint8)


def detect_people(
    pictures: Iterable[Pixels], detector: PeopleFinder, head: PoseHead | None, *, workers: int = 1
) -> Iterator[PeopleInPicture]:
    """Yield the people of every picture with their keypoints.

    Args:
        pictures: (h, w, 3) uint8, red green blue.
        detector: gives their boxes, and if it is one-stage their keypoints.
        head: pose head; None with a one-stage detector.
        workers: number of pictures at once, each in a thread.

    Raises:
        ValueError: no head with a detector that gives boxes alone.
    """
    if head is None and not detector.one_stage:
        raise ValueError("a detector that gives boxes alone needs a pose head")

    def find(picture: Pixels) -> PeopleInPicture:
        found = detector.find(picture)
        if head is None or not len(found.scores):
            return found if found.keypoints is not None else _nobody(head)
        posed = head.detect([picture], np.zeros(len(found.boxes), np.int64), found.boxes, box_scores=found.scores)
        return replace(found, keypoints=posed.keypoints, keypoint_scores=posed.scores)

    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[Future[PeopleInPicture]] = deque()
        try:
            for picture in _until_fault(pictures):
                if isinstance(picture, Exception):  # of a damaged video: people in the pictures before it come first
                    while waiting:
                        yield waiting.popleft().result()
                    raise picture
                waiting.append(pool.submit(find, picture))
                if len(waiting) > workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for each in waiting:
                each.cancel()


def _until_fault(pictures: Iterable[Pixels]) -> Iterator[Pixels | Exception]:
    """Yield pictures, and last the error that ends them, if one does."""
    try:
        yield from pictures
    except Exception as error:
        yield error


def open_head(
    path: str | Path,
    *,
    skeleton: Skeleton | None = None,
    likelihoods: bool = False,
    provider: Provider = "cpu",
    threads: int = 1,
) -> PoseHead:
    """Open a pose head: PoseNet, or one of heat maps or SimCC.

    Args:
        path: ONNX file.
        skeleton: its joints; None: COCO-17 or the skeleton of :mod:`mvpose.wholebody` with their number.
        likelihoods: whether detections carry heat maps.
        provider: as of :class:`mvpose.networks.Session`.
        threads: as of :class:`mvpose.networks.Session`.

    Raises:
        ValueError: as :class:`mvpose.networks.PoseHead`, or another number of joints.
    """
    session = Session(path, provider=provider, threads=threads)
    known: list[Skeleton] = [COCO17, *map(skeleton_by_name, SKELETONS)]
    counts = {extent for shape in session.shapes for extent in (shape[0], shape[-1])}
    skeleton = skeleton or next((each for each in known if len(each) in counts), COCO17)
    if session.card.name == PoseNet.name:
        return PoseNet(session, likelihoods=likelihoods)
    return PoseHead(session, skeleton=skeleton, likelihoods=likelihoods)


def _nobody(head: PoseHead | None) -> PeopleInPicture:
    joints = len(COCO17 if head is None else head.skeleton)
    return PeopleInPicture(np.zeros((0, 4)), np.zeros(0), np.zeros((0, joints, 2)), np.zeros((0, joints)))
