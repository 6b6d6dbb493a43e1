"""Graphs of TensorFlow.js to ONNX without weights: convolutional networks up to their heads, with pictures as input.

For :func:`mvpose.networks.catalogue.fetch.filled` constants say, as external data, where their values are stored.

Tensors keep the layout of TensorFlow, (n, height, width, channels), and integers become 64 bits wide. Convolutions
stand between two transpositions, which onnxruntime cancels against each other when it opens the file.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tools.networks.tfjs_graph import GraphModel, GraphNode

if TYPE_CHECKING:
    from onnx import ModelProto

_OPSET, _IR = 17, 8  # of onnxruntime 1.18 and later
_TO_CHANNELS_FIRST, _TO_CHANNELS_LAST = (0, 3, 1, 2), (0, 2, 3, 1)
_ACTIVATIONS = ("Relu", "Relu6")


def convert(
    model: GraphModel, *, name: str, pictures: str, outputs: Mapping[str, str], sigmoid: Collection[str] = ()
) -> "ModelProto":
    """Convert the part of a graph between two sets of tensors to ONNX.

    Args:
        model: the graph.
        name: name of the network.
        pictures: operation whose output is replaced by the input, pictures (n, height, width, 3), float32.
        outputs: operations whose outputs are those of the network, by their new names.
        sigmoid: names of outputs to which a sigmoid is added.

    Returns:
        The network without weights, for any number of pictures, and where the graph allows it of any size.

    Raises:
        ValueError: an operation or an attribute that is not supported, or a name of no operation.
    """
    from onnx import TensorProto, helper

    graph = _Conversion(model)
    for node in model.between(pictures, outputs.values()):
        if node.kind not in _OPERATIONS:
            raise ValueError(f"operation {node.kind[:60]!r} is not supported ({node.name[:80]!r})")
        _OPERATIONS[node.kind](graph, node)
    for output, tensor in outputs.items():
        graph.add("Sigmoid" if output in sigmoid else "Identity", [tensor], output)
    taken = helper.make_tensor_value_info(pictures, TensorProto.FLOAT, ["n", "height", "width", 3])
    results = [helper.make_tensor_value_info(output, TensorProto.FLOAT, [None] * 4) for output in outputs]
    made = helper.make_graph(graph.nodes, name, [taken], results, graph.initializers)
    network = helper.make_model(made, opset_imports=[helper.make_opsetid("", _OPSET)], producer_name="mvpose")
    network.ir_version = _IR
    return network


class _Conversion:
    """ONNX nodes and constants that are made so far."""

    def __init__(self, model: GraphModel) -> None:
        self.weights, self._places = model.weights, model.stored
        self.nodes: list[Any] = []
        self.initializers: list[Any] = []
        self._stored: set[str] = set()

    def add(self, kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        """Add a node, with the weights that it takes, and return its output."""
        from onnx import helper

        for name in inputs:
            if name in self.weights and name not in self._stored:
                self.stored(name, name)
        self.nodes.append(helper.make_node(kind, list(inputs), [output], name=output, **attributes))
        return output

    def constant(self, name: str, values: NDArray[Any]) -> str:
        """Add a constant and return its name."""
        from onnx import numpy_helper

        self._stored.add(name)
        self.initializers.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def stored(self, name: str, weight: str, kernel: NDArray[Any] | None = None) -> str:
        """Add a constant whose values are weights, or a kernel of them for convolutions, and return its name."""
        values = self.weights[weight] if kernel is None else kernel
        axes = range(values.ndim) if kernel is None else (3, 2, 0, 1)
        self.constant(name, values.transpose(tuple(axes)))
        constant = self.initializers[-1]
        constant.ClearField("raw_data")
        how = {"shape": " ".join(map(str, values.shape)), "axes": " ".join(map(str, axes))}
        for key, value in {**self._places[weight], **how}.items():
            constant.external_data.add(key=key, value=value)
        return name

    def weight(self, node: GraphNode, position: int) -> NDArray[Any]:
        """Return the weights that a node takes."""
        if len(node.inputs) <= position or node.inputs[position] not in self.weights:
            raise ValueError(f"input {position} of {node.name[:80]!r} ({node.kind}) must be constant")
        return self.weights[node.inputs[position]]


def _expect(node: GraphNode, key: str, *allowed: Any) -> Any:
    """Return an attribute of a node, one of those that are supported; the first where it is absent."""
    value = node.attributes.get(key, allowed[0])
    if value not in allowed:
        raise ValueError(f"{node.kind} {node.name[:80]!r}: {key} {value!r} is not supported, only {allowed}")
    return value


def _convolution(graph: _Conversion, node: GraphNode) -> None:
    """Add a convolution, depthwise or not, and the bias and activation that are fused into it."""
    kernel = graph.weight(node, 1)
    groups = 1
    if "Depthwise" in node.kind:  # (h, w, channels, multiplier)
        groups = kernel.shape[2]
        kernel = kernel.reshape(*kernel.shape[:2], 1, -1)
    inputs = [node.inputs[0], graph.stored(f"{node.name}/kernel", node.inputs[1], kernel)]
    fused = list(node.attributes.get("fused_ops", []))
    if fused[:1] == ["BiasAdd"]:
        graph.weight(node, 2)
        inputs.append(graph.stored(f"{node.name}/bias", node.inputs[2]))
        fused = fused[1:]
    if len(fused) > 1 or any(each not in _ACTIVATIONS for each in fused):
        raise ValueError(f"{node.kind} {node.name[:80]!r}: fused operations {fused} are not supported")
    linear = f"{node.name}/linear" if fused else node.name
    _expect(node, "data_format", "NHWC")
    _expect(node, "dilations", [1, 1, 1, 1])
    padding = {"SAME": "SAME_UPPER", "VALID": "VALID"}[_expect(node, "padding", "VALID", "SAME")]
    strides = node.attributes.get("strides", [1, 1, 1, 1])[1:3]
    inputs[0] = graph.add("Transpose", inputs[:1], f"{node.name}/channels_first", perm=_TO_CHANNELS_FIRST)
    made = graph.add("Conv", inputs, f"{node.name}/conv", auto_pad=padding, strides=strides, group=groups)
    graph.add("Transpose", [made], linear, perm=_TO_CHANNELS_LAST)
    if fused:
        _activation(graph, fused[0], linear, node.name)


def _activation(graph: _Conversion, kind: str, tensor: str, output: str) -> None:
    if kind != "Relu6":
        graph.add(kind, [tensor], output)
        return
    bounds = [graph.constant(f"{output}/{value}", np.array(value, np.float32)) for value in (0, 6)]
    graph.add("Clip", [tensor, *bounds], output)


def _resize(graph: _Conversion, node: GraphNode) -> None:
    """Add a bilinear resizing to a height and width that may be computed."""
    _expect(node, "align_corners", False)
    _expect(node, "half_pixel_centers", True)
    first = graph.add("Transpose", node.inputs[:1], f"{node.name}/channels_first", perm=_TO_CHANNELS_FIRST)
    shape = graph.add("Shape", [first], f"{node.name}/shape", end=2)
    sizes = graph.add("Concat", [shape, node.inputs[1]], f"{node.name}/sizes", axis=0)
    resized = graph.add("Resize", [first, "", "", sizes], f"{node.name}/resized", mode="linear")
    graph.add("Transpose", [resized], node.name, perm=_TO_CHANNELS_LAST)


def _slice(graph: _Conversion, node: GraphNode) -> None:
    """Add a slice with constant bounds of the first axes."""
    for mask in ("begin_mask", "end_mask", "ellipsis_mask", "new_axis_mask", "shrink_axis_mask"):
        _expect(node, mask, 0)
    axes = graph.constant(f"{node.name}/axes", np.arange(len(graph.weight(node, 1))))
    graph.add("Slice", [*node.inputs[:3], axes, node.inputs[3]], node.name)


def _same(kind: str) -> Callable[[_Conversion, GraphNode], None]:
    """Return a conversion to an ONNX operation with the same inputs."""

    def add(graph: _Conversion, node: GraphNode) -> None:
        graph.add(kind, node.inputs, node.name)

    return add


_OPERATIONS: dict[str, Callable[[_Conversion, GraphNode], None]] = {
    "_FusedConv2D": _convolution,
    "Conv2D": _convolution,
    "FusedDepthwiseConv2dNative": _convolution,
    "DepthwiseConv2dNative": _convolution,
    "ResizeBilinear": _resize,
    "StridedSlice": _slice,
    "AddV2": _same("Add"),
    "Add": _same("Add"),
    "BiasAdd": _same("Add"),
    "Sub": _same("Sub"),
    "Mul": _same("Mul"),
    "RealDiv": _same("Div"),
    "Maximum": _same("Max"),
    "Minimum": _same("Min"),
    "Relu": _same("Relu"),
    "Sigmoid": _same("Sigmoid"),
    "Shape": _same("Shape"),
    "Reshape": _same("Reshape"),
    "Identity": _same("Identity"),
}
