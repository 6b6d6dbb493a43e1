"""Compares converted networks with TensorFlow: ``python -m tools.networks.tfjs_oracle PACKAGE.tgz [PICTURE...]``.

Needs TensorFlow, which the project does not require: an environment of its own with ``tensorflow-cpu`` and
``mvpose[networks,recordings]``. For each network of the catalogue it runs the original graph in TensorFlow, and prints
the largest difference of each output; for MoveNet also that of the joints from those of the whole graph's six people,
in shares of the input; and the mean and standard deviation of TensorFlow's outputs for the probe picture.
"""

from __future__ import annotations

import base64
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.networks.catalogue.fetch import filled, probe_picture, read_members
from mvpose.networks.catalogue.store import PUBLISHED, PublishedNetwork
from mvpose.networks.movenet import Heads, decode
from mvpose.networks.session import Session
from tools.networks.__main__ import DATA, PARTS
from tools.networks.tfjs_graph import read_graph

_PEOPLE = "Identity"  # MoveNet's own decoding: 17 x (y, x, score), box, score of six people


def tensorflow_outputs(graph: bytes, weights: bytes, names: list[str], picture: np.ndarray) -> list[np.ndarray]:
    """Return the values of operations for a picture, (1, h, w, 3), computed by TensorFlow."""
    import tensorflow as tf
    from google.protobuf import json_format

    content = json.loads(graph)
    topology = content["modelTopology"]
    constants = read_graph(graph, weights).weights
    integers = {w["name"] for group in content["weightsManifest"] for w in group["weights"] if w["dtype"] == "int32"}
    definition = tf.compat.v1.GraphDef()
    nodes = [each for node in topology["node"] for each in _unfolded(node)]
    json_format.ParseDict({"node": nodes}, definition, ignore_unknown_fields=True)
    for node in definition.node:
        if node.op == "Const":
            kind = np.int32 if node.name in integers else np.float32
            node.attr["value"].tensor.CopyFrom(tf.make_tensor_proto(constants[node.name].astype(kind)))
        if node.op == "Placeholder":
            place = node.name
            kind = np.int32 if node.attr["dtype"].type == tf.int32.as_datatype_enum else np.float32
            node.attr["shape"].shape.unknown_rank = True
            del node.attr["shape"].shape.dim[:]
    with tf.Graph().as_default() as made:
        tf.import_graph_def(definition, name="")
        with tf.compat.v1.Session(graph=made) as session:
            return list(session.run([f"{name}:0" for name in names], {f"{place}:0": picture.astype(kind)}))


def _unfolded(node: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the operations of one that TensorFlow has fused, which has no kernel for them on every machine."""
    kinds = {"_FusedConv2D": "Conv2D", "FusedDepthwiseConv2dNative": "DepthwiseConv2dNative"}
    if node["op"] not in kinds:
        return [node]
    attributes = {key: node["attr"][key] for key in ("T", "strides", "padding", "data_format", "dilations")}
    of_type = {"T": node["attr"]["T"]}
    fused = [base64.b64decode(each).decode() for each in node["attr"]["fused_ops"]["list"]["s"]]
    steps = [{"op": kinds[node["op"]], "input": node["input"][:2], "attr": attributes}]
    for each in fused:
        steps.append({"op": each, "input": node["input"][2:] if each == "BiasAdd" else [], "attr": of_type})
    for k, step in enumerate(steps):
        step["name"] = node["name"] if k == len(steps) - 1 else f"{node['name']}/step{k}"
        if k:
            step["input"] = [steps[k - 1]["name"], *step["input"]]
    return steps


def compare(network: PublishedNetwork, files: dict[str, bytes], pictures: list[np.ndarray]) -> None:
    """Print the differences of a network."""
    graph, weights = (files[name] for name in network.members)
    outputs, logits = PARTS[network.name]["outputs"], PARTS[network.name].get("sigmoid", ())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{network.name}.onnx"
        shipped = (DATA / f"{network.name}_without_weights.onnx").read_bytes()
        path.write_bytes(filled(shipped, weights, network.card))
        session = Session(path, batch=1)
    for number, picture in enumerate(pictures):
        fed = picture / 255.0
        fed = (fed - np.array(network.card.mean)) / np.array(network.card.std)
        names = [*outputs.values()] + [_PEOPLE] * (network.name == "movenet")
        theirs = tensorflow_outputs(graph, weights, names, fed)
        ours = session(picture)
        for name, one, other in zip(outputs, ours, theirs, strict=False):
            expected = 1 / (1 + np.exp(-other.astype(float))) if name in logits else other
            away, largest = (float(np.abs(each).max()) for each in (one - expected, expected))
            print(f"{network.name} picture {number} {name}: largest difference {away:.1e}, largest value {largest:.3g}")
            if not number:
                print(f'            "{name}": ({expected.mean():.6g}, {expected.std():.6g}),')
        if network.name == "movenet":
            print(f"{network.name} picture {number} people: largest difference {_people(ours, theirs[-1][0]):.1e}")


def _people(outputs: list[np.ndarray], six: np.ndarray) -> float:
    """Return the largest difference of our people from the network's own, in shares of the input."""
    center, heat, regression, offsets, *boxes = (each[0] for each in outputs)
    height, width, joints = heat.shape
    pairs = (height, width, joints, 2)
    heads = Heads(center[..., 0], heat, regression.reshape(pairs), offsets.reshape(pairs), *boxes)
    ours = decode(heads, most=6, least=0.0)
    assert ours.keypoints is not None
    good = six[: len(ours.scores), 55] > 0.05  # of people; beyond them, the order of equal scores is chance
    print(f"    {good.sum()} people")
    places = ours.keypoints / (width, height) - six[: len(good), :51].reshape(-1, joints, 3)[..., 1::-1]
    return float(np.abs(places[good]).max(initial=0.0))


def main() -> None:
    """Compare all networks of the catalogue."""
    import cv2

    package, *files = sys.argv[1:]
    for network in PUBLISHED:
        size = network.card.size
        assert size is not None
        given = [cv2.resize(np.asarray(cv2.imread(file))[..., ::-1], size)[None] for file in files]
        noise = np.random.default_rng(0).integers(0, 256, (1, size[1], size[0], 3)).astype(np.uint8)
        compare(network, read_members(Path(package), list(network.members)), [probe_picture(size), noise, *given])


if __name__ == "__main__":
    main()
