"""ONNX files whose answers are known: they look at pictures through arithmetic that can be done by hand."""

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper, save

from mvpose.networks import Card

# What the conventions of a card mean: pixel of cell k of w, W pixels in all.
PIXEL_OF_CELL = {
    "stride": lambda k, w, W: k * W / w,
    "span": lambda k, w, W: k * (W - 1) / (w - 1),
    "area": lambda k, w, W: (k + 0.5) * W / w - 0.5,
}


class Graph:
    """Nodes one after the other, from one input of pictures."""

    def __init__(self, shape, *, input_name="input", half=False, dtype=None):
        self.half = half
        self.dtype = dtype or (TensorProto.FLOAT16 if half else TensorProto.FLOAT)
        self.inputs = [helper.make_tensor_value_info(input_name, self.dtype, shape)]
        self.nodes, self.constants, self.outputs = [], [], []
        self.last = input_name

    def constant(self, values):
        values = np.asarray(values)
        if values.dtype.kind == "f":
            values = values.astype(np.float16 if self.half else np.float32)
        self.constants.append(numpy_helper.from_array(values, f"constant{len(self.constants)}"))
        return self.constants[-1].name

    def add(self, operation, *inputs, **attributes):
        """A node of the given inputs, names or arrays; of the last node alone where none is given."""
        names = [name if isinstance(name, str) else self.constant(name) for name in inputs or (self.last,)]
        self.last = f"node{len(self.nodes)}"
        self.nodes.append(helper.make_node(operation, names, [self.last], **attributes))
        return self.last

    def output(self, name, shape, dtype=None):
        self.nodes.append(helper.make_node("Identity", [self.last], [name]))
        self.outputs.append(helper.make_tensor_value_info(name, dtype or self.dtype, shape))

    def save(self, path, card=None, metadata=None):
        graph = helper.make_graph(self.nodes, "known", self.inputs, self.outputs, self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        helper.set_model_props(model, {**(metadata or {}), **(card.to_metadata() if card else {})})
        checker.check_model(model)
        save(model, path)
        return path

    def undo_normalisation(self, card, channels_last=False):
        """Red, green and blue in 0..1 again."""
        shape = (1, 1, 1, 3) if channels_last else (1, 3, 1, 1)
        turn = slice(None, None, -1 if card.color_order == "bgr" else 1)
        self.add("Mul", self.last, np.array(card.std)[turn].reshape(shape))
        self.add("Add", self.last, np.array(card.mean)[turn].reshape(shape))

    def scale_to_one(self, axes):
        """Divide by the maximum along axes; what is black stays black."""
        values = self.last
        top = self.add("Max", self.add("ReduceMax", axes=axes), np.array(1e-4))
        self.add("Div", values, top)


def mean_color(path, size=(32, 64), *, batch="n", card=None, stated=None, channels_last=False, pooled=False, **options):
    """A re-ID network: the descriptor is the mean colour, in the order of the card."""
    width, height = size
    graph = Graph((batch, height, width, 3) if channels_last else (batch, 3, height, width), **options)
    graph.undo_normalisation(card or Card(), channels_last)
    graph.add("ReduceMean", axes=[1, 2] if channels_last else [2, 3], keepdims=int(pooled))
    graph.output("features", (batch, 3, 1, 1) if pooled else (batch, 3))
    return graph.save(path, card if stated is None else stated)


def blur(cells, pixels, convention, deviation):
    """A matrix, (pixels, cells), that gathers pixels about those that the cells stand for, by Gaussian weights."""
    centre = PIXEL_OF_CELL[convention](np.arange(cells), cells, pixels)
    return np.exp(-0.5 * ((np.arange(pixels)[:, None] - centre) / deviation) ** 2)


def brightness(graph, by_color):
    """What dots are looked for in: the picture in grey for all joints, or red, green and blue for one each."""
    graph.undo_normalisation(Card())
    return graph.last if by_color else graph.add("ReduceMean", axes=[1], keepdims=1)


def dots(
    path,
    size=(192, 256),
    *,
    card=None,
    gains=(1.0,) * 17,
    by_color=False,
    channels_last=False,
    batch="n",
    deviation=6.0,
):
    """A pose head: every heat map, a cell for 4 pixels, peaks where the picture is brightest, at the map's gain."""
    (width, height), card, joints = size, card or Card(), len(gains)
    w, h = width // 4, height // 4
    graph = Graph((batch, 3, height, width))
    bright = brightness(graph, by_color)
    columns = graph.add("MatMul", bright, blur(w, width, card.cells, deviation))
    graph.add("MatMul", blur(h, height, card.cells, deviation).T, columns)
    graph.scale_to_one([2, 3])
    graph.add("Mul", graph.last, card.peak * np.reshape(gains, (1, -1, 1, 1)))
    if channels_last:
        graph.add("Transpose", perm=[0, 2, 3, 1])
    graph.output("heatmaps", (batch, h, w, joints) if channels_last else (batch, joints, h, w))
    return graph.save(path, card)


def simcc_dots(path, size=(192, 256), *, split=2, gains=(1.0,) * 17, down=1.0, by_color=False, deviation=6.0):
    """A SimCC head: both vectors, ``split`` bins a pixel, peak where the picture is brightest, at the joint's gain.

    Those of y are ``down`` times as high.
    """
    (width, height), joints = size, len(gains)
    graph = Graph(("n", 3, height, width))
    bright = brightness(graph, by_color)
    for name, pixels, across, share in (("simcc_x", width, 2, 1.0), ("simcc_y", height, 3, down)):
        profile = graph.add("ReduceMean", bright, axes=[across], keepdims=0)
        graph.add("MatMul", profile, blur(split * pixels, pixels, "stride", deviation))
        graph.scale_to_one([2])
        graph.add("Mul", graph.last, share * np.reshape(gains, (1, -1, 1)))
        graph.output(name, ("n", joints, split * pixels))
    return graph.save(path)


def constant_people(path, keypoints, size, *, kind="keypoints"):
    """A one-stage detector, as RTMO exports it, that finds the same people in every picture of a size.

    Args:
        path: ONNX file.
        keypoints: (N, J, 2), pixels.
        size: width and height of the pictures.
        kind: "keypoints", or "boxes": boxes and labels alone, as YOLOX after non-maximum suppression.
    """
    keypoints = np.asarray(keypoints, float)
    low, high = keypoints.min(axis=1), keypoints.max(axis=1)
    rows = {
        "dets": np.concatenate([low, high, np.full((len(low), 1), 0.9)], axis=1)[None],
        "keypoints": np.concatenate([keypoints, np.full((*keypoints.shape[:2], 1), 0.8)], axis=2)[None],
    }
    if kind == "boxes":
        rows["labels"] = np.zeros((1, len(rows.pop("keypoints")[0])))
    graph = Graph((1, 3, size[1], size[0]))
    nothing = graph.add("Mul", graph.add("ReduceMean", axes=[1, 2, 3], keepdims=0), np.zeros(1))
    for name, values in rows.items():
        graph.add("Add", nothing, values)
        graph.output(name, values.shape)
    return graph.save(path)


def picture(size, *dots, background=0):
    """A picture, (height, width, 3), with Gaussian dots: x, y, deviation in pixels, colour."""
    width, height = size
    result = np.full((height, width, 3), float(background))
    for x, y, deviation, color in dots:
        across = np.exp(-0.5 * ((np.arange(width) - x) / deviation) ** 2)
        down = np.exp(-0.5 * ((np.arange(height) - y) / deviation) ** 2)
        result += np.outer(down, across)[:, :, None] * np.asarray(color, float)
    return np.clip(np.round(result), 0, 255).astype(np.uint8)
