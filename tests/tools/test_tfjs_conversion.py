"""Graphs of TensorFlow.js converted to ONNX, and filled with weights, against the formulas of their operations."""

import numpy as np
import pytest
from tfjs_graphs import TfjsGraph, package_of_networks

from mvpose.networks import Card, Session
from mvpose.networks.catalogue.fetch import filled
from tools.networks.__main__ import DATA, check, graphs
from tools.networks.tfjs_conversion import convert
from tools.networks.tfjs_graph import read_graph

RAW = Card(mean=(0.0,) * 3, std=(1 / 255,) * 3, size=(13, 10))
RANDOM = np.random.default_rng(3)
PICTURES = RANDOM.integers(0, 256, (2, 10, 13, 3)).astype(np.uint8)
INPUT = PICTURES.astype(float)


def computed(graph, output, tmp_path, *, sigmoid=()):
    content, weights = graph.files()
    model = convert(
        read_graph(content, weights), name="network", pictures="pictures", outputs={"result": output}, sigmoid=sigmoid
    )
    path = tmp_path / "network.onnx"
    path.write_bytes(filled(model.SerializeToString(), weights, RAW))
    check(path.read_bytes())
    (result,) = Session(path)(PICTURES)
    return result


def windows(values, size, stride, padding):
    """Windows of TensorFlow's convolutions, (n, h, w, size, size, channels): SAME puts the odd pixel after."""
    pads, counts = [], []
    for extent in values.shape[1:3]:
        if padding == "SAME":
            count = -(-extent // stride)
            total = max((count - 1) * stride + size - extent, 0)
            pads.append((total // 2, total - total // 2))
        else:
            count = (extent - size) // stride + 1
            pads.append((0, 0))
        counts.append(count)
    padded = np.pad(values, [(0, 0), *pads, (0, 0)])
    rows, columns = (stride * np.arange(count) for count in counts)
    return np.stack([[padded[:, r : r + size, c : c + size] for c in columns] for r in rows]).transpose(
        2, 0, 1, 3, 4, 5
    )


CONVOLUTION = {"data_format": "NHWC", "dilations": [1, 1, 1, 1]}


@pytest.mark.parametrize("padding", ["SAME", "VALID"])
@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("fused", [[], ["BiasAdd"], ["BiasAdd", "Relu"], ["BiasAdd", "Relu6"]])
@pytest.mark.parametrize("depthwise", [False, True])
def test_convolutions(tmp_path, padding, stride, fused, depthwise):
    graph = TfjsGraph()
    kernel = RANDOM.normal(size=(3, 3, 3, 2)) / 300
    bias = RANDOM.normal(size=6 if depthwise else 2)
    kind = ("FusedDepthwiseConv2dNative" if fused else "DepthwiseConv2dNative") if depthwise else "_FusedConv2D"
    more = {"fused_ops": fused} if fused or not depthwise else {}
    name = graph.add(
        kind, "pictures", kernel, *([bias] if fused else []),
        padding=padding, strides=[1, stride, stride, 1], **CONVOLUTION, **more,
    )  # fmt: skip
    seen = windows(INPUT, 3, stride, padding)
    expected = np.einsum("nrcijk,ijkm->nrckm" if depthwise else "nrcijk,ijkm->nrcm", seen, kernel)
    expected = expected.reshape(*expected.shape[:3], -1) + (bias if fused else 0)
    bounds = {"Relu": (0, np.inf), "Relu6": (0, 6)}
    low, high = bounds[fused[-1]] if fused[1:] else (-np.inf, np.inf)
    result = computed(graph, name, tmp_path)
    assert expected.std() > 0.1
    np.testing.assert_allclose(result, np.clip(expected, low, high), atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "formula"),
    [
        ("AddV2", np.add), ("Add", np.add), ("BiasAdd", np.add), ("Sub", np.subtract), ("Mul", np.multiply),
        ("RealDiv", np.divide), ("Maximum", np.maximum), ("Minimum", np.minimum),
    ],
)  # fmt: skip
def test_arithmetic(tmp_path, kind, formula):
    graph = TfjsGraph()
    other = np.array([100.0, 2.0, 130.0])
    np.testing.assert_allclose(
        computed(graph, graph.add(kind, "pictures", other), tmp_path), formula(INPUT, other), rtol=1e-6
    )


@pytest.mark.parametrize(
    ("kind", "formula"),
    [("Relu", lambda x: np.maximum(x, 0)), ("Sigmoid", lambda x: 1 / (1 + np.exp(-x))), ("Identity", lambda x: x)],
)
def test_functions(tmp_path, kind, formula):
    graph = TfjsGraph()
    small = graph.add("Mul", graph.add("Sub", "pictures", np.array(128.0)), np.array(0.02))
    expected = formula((INPUT - 128) * 0.02)
    np.testing.assert_allclose(computed(graph, graph.add(kind, small), tmp_path), expected, atol=1e-6)


def test_a_sigmoid_is_added_to_logits(tmp_path):
    graph = TfjsGraph()
    small = graph.add("Mul", "pictures", np.array(0.01))
    result = computed(graph, small, tmp_path, sigmoid=["result"])
    np.testing.assert_allclose(result, 1 / (1 + np.exp(-0.01 * INPUT)), atol=1e-6)


def test_resizing_to_twice_a_computed_size(tmp_path):
    """Each pixel of the doubled picture lies a quarter of the way to a neighbour: weights 3/4 and 1/4."""
    graph = TfjsGraph()
    shape = graph.add("Shape", "pictures")
    masks = dict.fromkeys(("begin_mask", "end_mask", "ellipsis_mask", "new_axis_mask", "shrink_axis_mask"), 0)
    sides = graph.add("StridedSlice", shape, np.array([1]), np.array([3]), np.array([1]), **masks)
    double = graph.add("Mul", sides, np.array([2, 2]))
    resized = graph.add("ResizeBilinear", "pictures", double, align_corners=False, half_pixel_centers=True)

    def doubled(values, axis):
        before = np.concatenate([values.take([0], axis), values.take(range(values.shape[axis] - 1), axis)], axis)
        after = np.concatenate([values.take(range(1, values.shape[axis]), axis), values.take([-1], axis)], axis)
        both = np.stack([0.25 * before + 0.75 * values, 0.75 * values + 0.25 * after], axis + 1)
        return both.reshape(*values.shape[:axis], -1, *values.shape[axis + 1 :])

    np.testing.assert_allclose(computed(graph, resized, tmp_path), doubled(doubled(INPUT, 1), 2), rtol=1e-5)


def test_reshaping(tmp_path):
    graph = TfjsGraph()
    name = graph.add("Reshape", "pictures", np.array([2, 5, 26, 3]))
    np.testing.assert_array_equal(computed(graph, name, tmp_path), INPUT.reshape(2, 5, 26, 3))


@pytest.mark.parametrize(
    ("stored", "scale", "tolerance"), [(None, None, 1e-6), ("float16", None, 1e-3), ("uint8", 1 / 100, 0.005)]
)
def test_weights_that_are_stored_shorter(tmp_path, stored, scale, tolerance):
    graph = TfjsGraph()
    values = np.linspace(-1.0, 1.5, 39).reshape(13, 3)
    name = graph.weight(values, stored=stored, scale=scale, least=-1.0)
    after = graph.weight(np.array([7, -9]))
    added = computed(graph, graph.add("Add", "pictures", name), tmp_path) - INPUT
    np.testing.assert_allclose(added, np.broadcast_to(values, added.shape), atol=tolerance + 3e-5)
    weights = read_graph(*graph.files()).weights
    np.testing.assert_allclose(weights[name], values, atol=tolerance)
    np.testing.assert_array_equal(weights[after], [7, -9])


def branch():
    graph = TfjsGraph()
    graph.add("Sigmoid", "pictures", name="wanted")
    return graph


def refused(graph, message, output="wanted"):
    with pytest.raises(ValueError, match=message):
        convert(read_graph(*graph.files()), name="network", pictures="pictures", outputs={"result": output})


def test_what_the_outputs_do_not_need_is_left_out(tmp_path):
    graph = branch()
    graph.add("NonMaxSuppressionV3", "wanted")
    assert computed(graph, "wanted", tmp_path).shape == PICTURES.shape


def test_what_cannot_be_converted_is_named():
    graph = branch()
    graph.add("NonMaxSuppressionV3", "wanted", name="boxes")
    refused(graph, r"operation 'NonMaxSuppressionV3' is not supported \('boxes'\)", "boxes")
    refused(graph, "no operation 'absent'", "absent")
    dilated = TfjsGraph()
    options = CONVOLUTION | {"padding": "SAME", "strides": [1, 1, 1, 1]}
    dilated.add("Conv2D", "pictures", np.ones((1, 1, 3, 1)), name="wanted", **options | {"dilations": [1, 2, 2, 1]})
    refused(dilated, r"Conv2D 'wanted': dilations \[1, 2, 2, 1\] is not supported")
    computed_kernel = TfjsGraph()
    computed_kernel.add("Conv2D", "pictures", "pictures", name="wanted", **options)
    refused(computed_kernel, "input 1 of 'wanted' .* must be constant")
    cycle = TfjsGraph()
    cycle.add("Add", "pictures", "other", name="wanted")
    cycle.add("Relu", "wanted", name="other")
    refused(cycle, "cycle")


@pytest.mark.parametrize("damage", [lambda g, w: (g[:-9], w), lambda g, w: (b"[1]", w), lambda g, w: (b"{}", w)])
def test_what_is_no_graph_is_refused(damage):
    with pytest.raises(ValueError, match="not a graph model"):
        read_graph(*damage(*branch().files()))


@pytest.mark.parametrize("change", [lambda w: w[:-1], lambda w: w + b"\0", lambda w: b""])
def test_weights_of_another_size_are_refused(change):
    graph = branch()
    graph.weight(np.ones(5))
    content, weights = graph.files()
    with pytest.raises(ValueError, match="weights have"):
        read_graph(content, change(weights))


@pytest.mark.slow
def test_the_shipped_graphs_are_those_of_the_package():
    for name, content in graphs(package_of_networks()).items():
        assert (DATA / f"{name}_without_weights.onnx").read_bytes() == content
