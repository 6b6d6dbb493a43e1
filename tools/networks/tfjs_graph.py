"""Graph models of TensorFlow.js: a JSON file with the graph, and a file of weights."""

import base64
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES = {"float32": "<f4", "float16": "<f2", "int32": "<i4", "uint8": "u1", "uint16": "<u2", "bool": "u1"}


@dataclass(frozen=True)
class GraphNode:
    """Operation of a graph."""

    name: str
    """Its name."""
    kind: str
    """Kind of operation, as TensorFlow calls it."""
    inputs: tuple[str, ...]
    """Names of the operations and weights that it takes."""
    attributes: Mapping[str, Any]
    """Its attributes: numbers, lists of numbers, texts and types."""


@dataclass(frozen=True)
class GraphModel:
    """Graph with its weights."""

    nodes: Mapping[str, GraphNode]
    """Operations by name; constants are in ``weights``."""
    weights: Mapping[str, NDArray[Any]]
    """Constants by name, float32 or int64."""
    stored: Mapping[str, Mapping[str, str]]
    """How each constant is stored in the file of weights: ``offset`` in bytes and ``type``, and ``scale`` and ``least``
    where it is quantised."""

    def between(self, start: str, ends: Iterable[str]) -> list[GraphNode]:
        """Return the operations from the output of one to those of others, each after those that it takes.

        Raises:
            ValueError: a name of no operation, or a graph with a cycle.
        """
        done: dict[str, GraphNode] = {}
        open_ones: set[str] = set()
        stack = [*ends]
        while stack:
            name = stack[-1]
            if name in done or name == start:
                stack.pop()
                continue
            if name not in self.nodes:
                raise ValueError(f"the graph has no operation {name[:80]!r}")
            node = self.nodes[name]
            before = [each for each in node.inputs if not (each in done or each == start or each in self.weights)]
            if before and name in open_ones:
                raise ValueError(f"the graph has a cycle at {name[:80]!r}")
            open_ones.add(name)
            stack += before
            if not before:
                done[name] = node
        return list(done.values())


def read_graph(graph: bytes, weights: bytes) -> GraphModel:
    """Read a graph model.

    Args:
        graph: content of its JSON file.
        weights: content of its file of weights; of several in the order of the manifest.

    Raises:
        ValueError: not a graph model, or weights of another size.
    """
    try:
        content = json.loads(graph)
        nodes = content["modelTopology"]["node"]
        entries = [entry for group in content["weightsManifest"] for entry in group["weights"]]
        constants, stored = _constants(entries, weights)
        found = [
            GraphNode(
                node["name"],
                node["op"],
                tuple(each for each in node.get("input", ()) if not each.startswith("^")),
                {key: _value(value) for key, value in node.get("attr", {}).items()},
            )
            for node in nodes
            if node["op"] != "Const"
        ]
    except (KeyError, TypeError, AttributeError, RecursionError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"not a graph model of TensorFlow.js: {type(error).__name__} {error}") from None
    return GraphModel({node.name: node for node in found}, constants, stored)


def _constants(
    entries: list[dict[str, Any]], content: bytes
) -> tuple[dict[str, NDArray[Any]], dict[str, dict[str, str]]]:
    """Return the weights, one after the other in the file, and how they are stored.

    Quantised ones are ``scale * value + min``.
    """
    found: dict[str, NDArray[Any]] = {}
    places: dict[str, dict[str, str]] = {}
    start = 0
    for entry in entries:
        stored = entry.get("quantization", {})
        kind = np.dtype(_TYPES[stored.get("dtype", entry["dtype"])])
        count = math.prod(entry["shape"])
        if start + count * kind.itemsize > len(content):
            raise ValueError(f"the weights have {len(content)} bytes and are cut off in {entry['name'][:80]!r}")
        values = np.frombuffer(content, kind, count, start).reshape(entry["shape"])
        places[entry["name"]] = {"offset": str(start), "type": kind.str}
        start += count * kind.itemsize
        if "scale" in stored:
            places[entry["name"]] |= {"scale": repr(stored["scale"]), "least": repr(stored["min"])}
            values = values.astype(np.float32) * np.float32(stored["scale"]) + np.float32(stored["min"])
        found[entry["name"]] = values.astype(np.float32 if entry["dtype"] == "float32" else np.int64)
    if start != len(content):
        raise ValueError(f"the weights have {len(content)} bytes, and the graph takes {start}")
    return found, places


def _value(value: dict[str, Any]) -> Any:
    """Return an attribute: ``{"i": "3"}``, ``{"list": {"i": ["1", "2"]}}``, ``{"s": BASE64}``, ``{"type": NAME}``."""
    (kind, given), *_ = value.items()
    if kind == "list":
        ((inner, many),) = given.items() or [("i", [])]
        return [_value({inner: each}) for each in many]
    if kind == "i":
        return int(given)
    return base64.b64decode(given).decode() if kind == "s" else given
