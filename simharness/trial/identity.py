"""What a trial is known by: a hash of everything that determines its result, and of nothing else.

A trial is a scenario at a seed; a store keeps its result for each variant of the method under an *entry*.

What makes a trial anew, and all its entries:

- a value of the resolved scenario, its seed included, wherever it was said: in the file, in a base file, in a profile;
- the content or the name of a file that the scenario names (a calibration, a recorded motion, a network), and of those
  that are read together with it;
- :func:`code` ``.simulation``: a byte of the code or data of ``simharness`` that films, detects and scores;
- the versions of the packages in :data:`PACKAGES`.

What makes an entry anew besides: its variant, and :func:`code` ``.method``, a byte of ``mvpose``. Of a method of one's
own also where in its file it is, and the sources that :func:`simharness.trial.stages.estimators.sources_of` finds; what
else it runs or reads is not seen.

What changes neither: names and descriptions of scenarios, detectors and studies, the folder that they lie in, which
other variants are asked for, the number of workers, the machine; nor the code of the command line, of reports, of the
gate, of training. So a study may be renamed, moved, or get more seeds, and what is finished stays finished. One thing
is not seen: ``rendering.renderer = "auto"`` takes one renderer or the other by what the machine has.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mvpose
import simharness
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.estimators import sources_of

PACKAGES = ("mujoco", "numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "pyrender2", "pillow")
"""What a result also depends on: distributions whose versions count."""

_SIMULATION = (
    "types",
    "scenario/sections",  # scenarios are hashed as resolved: what reads files does not count
    "formats",  # rigs read calibrations by it
    "world",
    "capture",
    "detector",
    "scoring",
    "trial/stages",
    "trial/looking.py",
    "trial/measure.py",
    "trial/trial_result.py",
)
_NOT: tuple[str, ...] = ()
_SIZE = 16  # bytes of a digest: by chance no two of all trials ever run are the same


@dataclass(frozen=True)
class Code:
    """Digests of the code and data that make results, hexadecimal.

    Attributes:
        simulation: of ``simharness``: what films, detects and scores.
        method: of ``mvpose``.
    """

    simulation: str
    method: str


@functools.cache
def code() -> Code:
    """The code of this process, as it lies on disk when first asked for."""
    method = Path(mvpose.__file__).parent
    return Code(
        _digest_of_files(Path(simharness.__file__).parent, simulation_files()),
        _digest_of_files(method, _sources(method)),
    )


def simulation_files() -> list[Path]:
    """The files of ``simharness`` that make results, code and data."""
    root = Path(simharness.__file__).parent
    left_out = [root / name for name in _NOT]
    files = [file for name in _SIMULATION for file in _sources(root / name)]
    return sorted(file for file in files if not any(file.is_relative_to(each) for each in left_out))


def versions() -> dict[str, str]:
    """Version of each of :data:`PACKAGES`, "none" where it is not installed."""
    return {name: _version(name) for name in PACKAGES}


def trial_identity(scenario: Scenario) -> str:
    """The identity of a trial, 32 hexadecimal digits: of a resolved scenario at its seed, whatever its variants."""
    said = scenario.model_dump(mode="json", exclude={"name": True, "description": True, "method": True})
    del said["detector"]["name"]
    said["people"]["motion"] |= {"file": "", "skeleton": ""}  # by content, below
    said["cameras"]["file"] = said["detector"]["onnx"] = said["appearance"]["network"] = ""
    content = {key: _content(files) for key, files in _files(scenario).items()}
    return _digest({"scenario": said, "files": content, "code": code().simulation, "versions": _versions()})


def entry_identity(trial: str, variant: str, own: str = "") -> str:
    """The identity of what one variant makes of a trial, 32 hexadecimal digits.

    Args:
        trial: from :func:`trial_identity`.
        variant: its name.
        own: from :func:`own_code`, of a method of one's own; "" of a preset of :class:`mvpose.Pipeline`.
    """
    said: dict[str, Any] = {"trial": trial, "variant": variant, "code": code().method}
    if own:
        said["own"] = own
    return _digest(said)


def own_code(place: str) -> str:
    """Digest of a method of one's own: of its sources, and of its file's and its own name.

    Args:
        place: of section [method.estimators].
    """
    source, _, attribute = place.rpartition(":")
    sources = {name: hashlib.blake2b(text).hexdigest() for name, text in sources_of(place).items()}
    return _digest({"place": [Path(source).name, attribute], "sources": sources})


def _files(scenario: Scenario) -> dict[str, list[Path]]:
    """The files that a scenario names, each with those beside it that its reader takes, too."""
    motion = scenario.people.motion
    named = {
        "people.motion.file": motion.file,
        "people.motion.skeleton": motion.skeleton,
        "cameras.file": scenario.cameras.file,
        "detector.onnx": scenario.detector.onnx,
        "appearance.network": scenario.appearance.network,
    }
    files = {}
    for key, name in named.items():
        if not name:
            continue
        file = Path(name)
        files[key] = [file]
        suffix = file.suffix.lower()
        if suffix == ".onnx":  # the card beside a network
            files[key].append(file.with_suffix(".json"))
        elif suffix == ".amc":  # the skeleton beside a motion
            files[key] += _beside(file, ".asf")
        elif suffix in (".yml", ".yaml", ".xml"):  # calibrations in two files
            files[key] += _beside(file, ".yml", ".yaml", ".xml")
    return files


def _beside(file: Path, *suffixes: str) -> list[Path]:
    there = sorted(file.parent.iterdir()) if file.parent.is_dir() else []
    return [each for each in there if each.suffix.lower() in suffixes and each != file]


def _content(files: list[Path]) -> dict[str, str | None]:
    """Digests by name; None of a file that is not there."""
    content: dict[str, str | None] = {}
    for file in files:
        if file.is_file():
            stat = file.stat()
            content[file.name] = _digest_of_file(file, stat.st_size, stat.st_mtime_ns)
        else:
            content[file.name] = None
    return content


@functools.lru_cache(maxsize=256)
def _digest_of_file(file: Path, size: int, changed: int) -> str:
    """Of a file as it was at a time, so that ten thousand trials read a network once."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, lambda: hashlib.blake2b(digest_size=_SIZE)).hexdigest()


def _digest(value: Any) -> str:
    return hashlib.blake2b(json.dumps(value, sort_keys=True).encode(), digest_size=_SIZE).hexdigest()


def _digest_of_files(root: Path, files: Iterable[Path]) -> str:
    digest = hashlib.blake2b(digest_size=_SIZE)
    for file in sorted(files):
        content = file.read_bytes()
        digest.update(f"{file.relative_to(root).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def _sources(path: Path) -> Iterator[Path]:
    """A file, or all files of a package but what Python and numba made of them."""
    if path.is_file():
        yield path
        return
    for file in path.rglob("*"):
        if file.is_file() and "__pycache__" not in file.parts and not file.name.startswith("."):
            yield file


@functools.cache
def _versions() -> tuple[tuple[str, str], ...]:
    return tuple(versions().items())


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"
