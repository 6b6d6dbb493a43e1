"""ONNX files that find people and joints in painted pictures, without training.

The detector gives the box around each shade of red. Pose heads find the body segments of the person whom a crop shows
most, and place a joint where the two segments meet that it connects: the product of the two blurred masks is largest
there. That is how joints were found in depth images (Shotton et al., CVPR 2011): segments first, then joints.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from onnx import TensorProto, checker, helper, numpy_helper, save

from benchmarks.pictures.painted_bodies import PEOPLE, SEGMENTS, SHADES
from mvpose import COCO17
from mvpose.networks import Card
from simharness.world.humans.anatomy import Segment

CARD = Card(mean=(0.0, 0.0, 0.0), std=(1 / 255,) * 3)
"""Networks take colours of 0 to 255."""

_NEAR = 8.0  # largest difference from a colour, of 255: crops are resampled, and mixed colours mean nothing
_FEWEST = 40.0  # pixels of a person who is detected
_SCORE = 0.9  # of every box
_BLUR = 4.0  # standard deviation of the masks of segments, pixels of a crop
_AT_CENTRE = 0.3  # of the size of a crop: standard deviation of the weights by which its person is chosen
_TO_SHOULDER = 24.0  # pixels of a crop: standard deviation of the weights of shoulders about the head
_HEAD_SCORE = 0.6  # height of nose, eyes and ears, which are all taken to be in the middle of the head


def joint_segments() -> list[tuple[Segment, Segment]]:
    """Return the two segments that meet at each joint of COCO-17; twice the head for joints of the face."""
    inner, outer = ("TORSO", "{}_UPPER_ARM", "{}_FOREARM"), ("{}_UPPER_ARM", "{}_FOREARM", "{}_HAND")
    arms = dict(zip(("shoulder", "elbow", "wrist"), zip(inner, outer, strict=True), strict=True))
    inner, outer = ("TORSO", "{}_THIGH", "{}_SHANK"), ("{}_THIGH", "{}_SHANK", "{}_FOOT")
    meet = arms | dict(zip(("hip", "knee", "ankle"), zip(inner, outer, strict=True), strict=True))
    pairs = []
    for joint in COCO17.joints:
        side, _, name = joint.partition("_")
        one, other = (each.format(side.upper()) for each in meet.get(name, ("HEAD", "HEAD")))
        pairs.append((Segment[one], Segment[other]))
    return pairs


def detector(path: Path, size: tuple[int, int] = (640, 640)) -> Path:
    """Write a detector with the outputs of RTMDet: boxes (1, 6, 5) and labels (1, 6).

    Args:
        path: the file.
        size: width and height of its input.
    """
    graph = _Graph((1, 3, size[1], size[0]))
    mask = graph("AveragePool", graph.near(graph.channels(0, 1), SHADES), kernel_shape=[3, 3], pads=[1, 1, 1, 1])
    mask = graph.cast(graph("Greater", mask, 0.6))  # thin lines are mixtures at outlines
    ends = []
    for axis, extent in ((3, size[0]), (2, size[1])):
        number = np.arange(extent).reshape((1, 1, 1, -1) if axis == 3 else (1, 1, -1, 1)) + 0.5
        last = graph.most(graph("Mul", mask, number + 0.5), [2, 3])
        first = graph("Sub", float(extent), graph.most(graph("Mul", mask, extent - number + 0.5), [2, 3]))
        ends.append((first, last))
    (left, right), (top, bottom) = ends
    count = graph("ReduceSum", mask, np.array([2, 3]))
    score = graph("Mul", graph.cast(graph("Greater", count, _FEWEST)), _SCORE)
    boxes = graph("Concat", left, top, right, bottom, score, axis=3)
    graph.output("dets", graph("Reshape", boxes, np.array([1, PEOPLE, 5])), (1, PEOPLE, 5))
    graph.output("labels", graph.constant(np.zeros((1, PEOPLE), np.int64)), (1, PEOPLE), TensorProto.INT64)
    return graph.save(path)


def simcc_head(path: Path, size: tuple[int, int] = (192, 256)) -> Path:
    """Write a pose head with the outputs of RTMPose, vectors (n, 17, W) and (n, 17, H).

    Args:
        path: the file.
        size: width and height of its input.
    """
    graph = _Graph(("n", 3, size[1], size[0]))
    heights = graph.joint_maps(size, size)
    graph.output("simcc_x", graph.most(heights, [2], keepdims=0), ("n", 17, size[0]))
    graph.output("simcc_y", graph.most(heights, [3], keepdims=0), ("n", 17, size[1]))
    return graph.save(path)


def heatmap_head(path: Path, size: tuple[int, int] = (192, 256)) -> Path:
    """Write a pose head with the output of HRNet, heat maps (n, 17, H / 4, W / 4); arguments as :func:`simcc_head`."""
    cells = (size[0] // 4, size[1] // 4)
    graph = _Graph(("n", 3, size[1], size[0]))
    graph.output("heatmaps", graph.joint_maps(size, cells), ("n", 17, cells[1], cells[0]))
    return graph.save(path)


class _Graph:
    """Nodes of a network with one input of pictures; calling it adds a node and returns the name of its output."""

    def __init__(self, shape: tuple[int | str, ...]) -> None:
        self._inputs = [helper.make_tensor_value_info("pictures", TensorProto.FLOAT, shape)]
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self._outputs: list[Any] = []

    def __call__(self, operation: str, *inputs: str | ArrayLike, **attributes: Any) -> str:
        names = [each if isinstance(each, str) else self.constant(each) for each in inputs]
        name = f"node{len(self._nodes)}"
        self._nodes.append(helper.make_node(operation, names, [name], **attributes))
        return name

    def constant(self, values: ArrayLike) -> str:
        """Add a constant, in single precision unless it is of whole numbers, and return its name."""
        array = np.asarray(values)
        array = array.astype(np.float32) if array.dtype.kind == "f" else array.astype(np.int64)
        self._constants.append(numpy_helper.from_array(array, f"constant{len(self._constants)}"))
        return self._constants[-1].name

    def cast(self, mask: str) -> str:
        """Return a mask as 0 and 1."""
        return self("Cast", mask, to=TensorProto.FLOAT)

    def most(self, values: str, axes: list[int], *, keepdims: int = 1) -> str:
        """Return the largest value along some axes."""
        return self("ReduceMax", values, axes=axes, keepdims=keepdims)

    def channels(self, start: int, stop: int) -> str:
        """Return some channels of the pictures, (n, c, h, w)."""
        return self("Slice", "pictures", np.array([start]), np.array([stop]), np.array([1]))

    def near(self, channel: str, levels: ArrayLike) -> str:
        """Return masks of the pixels at each of k levels of a channel (n, 1, h, w), (n, k, h, w)."""
        difference = self("Sub", channel, np.reshape(np.asarray(levels, float), (1, -1, 1, 1)))
        return self.cast(self("Less", self("Abs", difference), _NEAR))

    def joint_maps(self, size: tuple[int, int], cells: tuple[int, int]) -> str:
        """Return the heights of the 17 joints, (n, 17, h, w), 0 to 1, on some number of cells."""
        person = self._mask_of_person(size)
        green, blue = (self.near(self.channels(k + 1, k + 2), SEGMENTS[:, k]) for k in range(2))
        masks = self("Mul", self("Mul", green, blue), person)
        soft = self._blurred(masks, size, cells, _BLUR)
        inner, outer = (self("Gather", soft, np.array(each), axis=1) for each in zip(*joint_segments(), strict=True))
        face = np.array([a == b for a, b in joint_segments()]).reshape(1, -1, 1, 1)
        # Two segments meet where both masks are one half: the product is a quarter. Of the head it is 1 in the middle.
        height = self("Sqrt", self("Mul", self("Mul", inner, outer), np.where(face, _HEAD_SCORE**2, 4.0)))
        # An arm that hangs touches the torso all along: the shoulder is where it does so nearest to the head.
        head = self._blurred(self("Gather", masks, np.array([Segment.HEAD]), axis=1), size, cells, _TO_SHOULDER)
        near_head = self("Div", head, self("Max", self.most(head, [2, 3]), 1e-6))
        shoulder = np.array([name.endswith("shoulder") for name in COCO17.joints], float).reshape(1, -1, 1, 1)
        weight = self("Min", self("Add", self("Mul", near_head, 2.0 * shoulder), 1.0 - shoulder), 1.0)
        return self("Min", self("Mul", height, weight), 1.0)

    def _blurred(self, masks: str, size: tuple[int, int], cells: tuple[int, int], deviation: float) -> str:
        """Return masks (n, k, H, W) as means about the pixels of cells, (n, k, h, w), with Gaussian weights."""
        across, down = (_blur(*each, deviation) for each in zip(size, cells, strict=True))
        return self("MatMul", down.T, self("MatMul", masks, across))

    def _mask_of_person(self, size: tuple[int, int]) -> str:
        """Return the mask of the person with most pixels near the middle of the crop, (n, 1, h, w)."""
        people = self.near(self.channels(0, 1), SHADES)
        weights = [np.exp(-0.5 * ((np.arange(each) + 0.5) / each - 0.5) ** 2 / _AT_CENTRE**2) for each in size]
        amount = self("ReduceSum", self("Mul", people, np.outer(weights[1], weights[0])), np.array([2, 3]))
        chosen = self.cast(self("Equal", amount, self.most(amount, [1])))
        return self.most(self("Mul", people, chosen), [1])

    def output(self, name: str, node: str, shape: tuple[int | str, ...], kind: int = TensorProto.FLOAT) -> None:
        """Make a node an output of the network."""
        self._nodes.append(helper.make_node("Identity", [node], [name]))
        self._outputs.append(helper.make_tensor_value_info(name, kind, shape))

    def save(self, path: Path) -> Path:
        """Write the file, with the card, and return its path."""
        graph = helper.make_graph(self._nodes, "painted", self._inputs, self._outputs, self._constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        helper.set_model_props(model, CARD.to_metadata())
        checker.check_model(model)
        save(model, path)
        return path


def _blur(pixels: int, cells: int, deviation: float) -> np.ndarray:
    """Return the Gaussian weights of pixels about cells at ``k W / w``, (W, w); those of a cell sum to 1 or less."""
    centre = np.arange(cells) * pixels / cells
    weights = np.exp(-0.5 * ((np.arange(pixels)[:, None] - centre) / deviation) ** 2)
    return weights / (np.sqrt(2 * np.pi) * deviation)
