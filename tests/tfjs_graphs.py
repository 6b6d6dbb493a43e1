"""Graphs of TensorFlow.js whose answers are known, as its converter writes them."""

import base64
import io
import json
import os
import tarfile
from pathlib import Path

import numpy as np
import pytest

from mvpose.networks.catalogue.store import PACKAGE

STORED = {"float32": "<f4", "float16": "<f2", "int32": "<i4", "uint8": "u1"}


class TfjsGraph:
    """Operations and weights, from a placeholder ``pictures``."""

    def __init__(self):
        self.nodes = [{"name": "pictures", "op": "Placeholder", "attr": {"dtype": {"type": "DT_FLOAT"}}}]
        self.entries, self.content = [], b""

    def weight(self, values, *, stored=None, scale=None, least=0.0):
        """Add weights, stored as they are or quantised, and return their name."""
        values = np.asarray(values)
        kind = "int32" if values.dtype.kind == "i" else "float32"
        name = f"weight{len(self.entries)}"
        entry = {"name": name, "shape": list(values.shape), "dtype": kind}
        if stored:
            entry["quantization"] = {"dtype": stored}
        if scale:
            entry["quantization"] |= {"scale": scale, "min": least}
            values = np.round((values - least) / scale)
        self.entries.append(entry)
        self.content += values.astype(STORED[stored or kind]).tobytes()
        self.nodes.append({"name": name, "op": "Const", "attr": {"dtype": {"type": "DT_FLOAT"}}})
        return name

    def add(self, kind, *inputs, name=None, **attributes):
        """Add an operation on tensors and arrays, and return its name."""
        names = [each if isinstance(each, str) else self.weight(each) for each in inputs]
        name = name or f"node{len(self.nodes)}"
        written = {key: self._attribute(value) for key, value in attributes.items()}
        self.nodes.append({"name": name, "op": kind, "input": names, "attr": {"T": {"type": "DT_FLOAT"}, **written}})
        return name

    @staticmethod
    def _attribute(value):
        text = lambda each: base64.b64encode(each.encode()).decode()  # noqa: E731
        if isinstance(value, list):
            texts = bool(value) and isinstance(value[0], str)
            return {"list": {"s" if texts else "i": [text(each) if texts else str(each) for each in value]}}
        if isinstance(value, bool):
            return {"b": value}
        return {"i": str(value)} if isinstance(value, int) else {"s": text(value)}

    def files(self):
        """Return the JSON file and the file of weights."""
        content = {
            "format": "graph-model",
            "modelTopology": {"node": self.nodes},
            "weightsManifest": [{"paths": ["weights.bin"], "weights": self.entries}],
        }
        return json.dumps(content).encode(), self.content


def package(path, members):
    """Write a .tgz with some members, bytes by name."""
    with tarfile.open(path, "w:gz") as archive:
        for name, content in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return path


def package_of_networks():
    """Package of the published networks; without it the test skips, or fails if SIMHARNESS_REQUIRE_NETWORKS is set."""
    given = os.environ.get("SIMHARNESS_NETWORKS", "")
    if not Path(given).is_file():
        missing = f"SIMHARNESS_NETWORKS names no package; `npm pack {PACKAGE}` makes it"
        (pytest.fail if os.environ.get("SIMHARNESS_REQUIRE_NETWORKS") else pytest.skip)(missing)
    return Path(given)
