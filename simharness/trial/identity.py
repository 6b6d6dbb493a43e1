"""Identities of results, hashes of everything that determines a result, and their provenance: command and machine.

A trial is a scenario at a seed. Its results are made in steps, and each step has an identity:

- detections and truth: the values of the resolved scenario with its seed, the content of the files that it names, the
  code of the folders in :data:`SIMULATION` and :data:`BORROWED`, the versions of :data:`PACKAGES`;
- estimates of a variant: the identity of the trial, the variant, and the code of ``mvpose`` without
  :data:`BESIDE_THE_METHOD`; for presets that track also ``method.lag`` (the time between frames is in the trial's
  identity); for a user-defined estimator also its place and the sources that
  :func:`simharness.trial.stages.estimators.sources_of` finds;
- scores: the identity of the estimates, and the code of the folders in :data:`SCORES`;
- failures and the stage to blame: the identity of the estimates, and the code of the folders in :data:`FAILURES`.

The code of a folder is the syntax trees of its modules without docstrings, comments and field descriptions, and the
bytes of its other files. So a changed docstring changes no identity, and a changed score keeps the simulation and the
estimates.

Names and descriptions of scenarios, detectors and studies, the folder of the study, other variants, the number of
workers and the machine change nothing; nor does code of the command line, of reports and of the gate. One
difference is not detected: ``rendering.renderer = "auto"`` chooses a renderer that depends on the machine.
"""

import contextlib
import functools
import hashlib
import importlib.metadata
import json
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mvpose
import simharness
from mvpose.formats.calibration.camera_folder import calibration_files
from mvpose.formats.calibration.colmap import FILES
from mvpose.formats.people.people_formats import people_files
from simharness.runtime.version import code_version, digest_of_folders
from simharness.scenario.sections.scenario import FILE_KEYS, NETWORK_KEYS, Scenario
from simharness.trial.stages.estimators import sources_of
from simharness.trial.stages.networks import network_file
from simharness.world.scene.objects.object_files import object_dependencies

PACKAGES = ("mujoco", "numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "pyrender2", "pillow")
"""Distributions whose versions are part of a trial's identity."""

SIMULATION = ("types", "scenario/sections", "assets", "world", "capture", "detector", "trial/stages")
"""Folders of ``simharness`` that make detections and estimates. Scenarios count as resolved, not how they are read."""

BESIDE_THE_SIMULATION = ("scenario/sections/gate_section.py",)
"""Modules in :data:`SIMULATION` that make neither: what the gate allows."""

BORROWED = (
    "formats/calibration", "formats/joint_names.py", "formats/people", "networks/card.py", "networks/crops.py",
    "networks/detector.py", "networks/finders.py", "networks/movenet.py", "networks/pose.py", "networks/posenet.py",
    "networks/reid.py", "networks/session.py", "recording.py", "wholebody",
)  # fmt: skip
"""Folders and modules of ``mvpose`` that simulations use: readers of rigs and of people to re-enact, networks that
read pictures, skeletons with feet and hands and their estimates."""

BESIDE_THE_METHOD = (
    "cli", "commands", "files", "formats", "networks/catalogue", "networks/detector.py", "networks/finders.py",
    "networks/movenet.py", "networks/posenet.py", "recording.py", "report", "skeleton_fit", "wholebody",
)  # fmt: skip
"""Folders and modules of ``mvpose`` that make no estimates of bodies in trials: readers, writers, detection in videos,
hands and faces, the command line, pages."""

SCORES = ("types", "scoring")
"""Folders of ``simharness`` that score estimates, without :data:`FAILURES_ALONE`."""

FAILURES_ALONE = ("scoring/failure_classes.py", "scoring/stage_blame.py")
"""Modules in :data:`SCORES` on which only failures depend."""

FAILURES = ("types", "scoring/pairing.py", *FAILURES_ALONE)
"""Folders and modules of ``simharness`` that find failures and the stage of the method to blame."""

PROVENANCE = ("command", "seeds", "variants", "code", "digests", "versions", "machine", "seconds")
"""The keys of :func:`provenance`."""

_SIZE = 16  # bytes of a digest, so that no two trials share one by chance


@dataclass(frozen=True)
class Code:
    """Digests of the code that makes results, hexadecimal."""

    simulation: str
    """Of the folders :data:`SIMULATION` and :data:`BORROWED`."""
    method: str
    """Of ``mvpose`` without :data:`BESIDE_THE_METHOD`."""
    scores: str
    """Of the folders :data:`SCORES`."""
    failures: str
    """Of the folders :data:`FAILURES`."""


@functools.cache
def code() -> Code:
    """Return the digests of the code on disk at the first call in this process."""
    ours, its = Path(simharness.__file__).parent, Path(mvpose.__file__).parent
    return Code(
        simulation=_digest(
            [digest_of_folders(ours, SIMULATION, without=BESIDE_THE_SIMULATION), digest_of_folders(its, BORROWED)]
        ),
        method=digest_of_folders(its, ("",), without=BESIDE_THE_METHOD),
        scores=digest_of_folders(ours, SCORES, without=FAILURES_ALONE),
        failures=digest_of_folders(ours, FAILURES),
    )


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the version of each of :data:`PACKAGES`, "none" where it is not installed."""
    return {name: _version(name) for name in PACKAGES}


def trial_identity(scenario: Scenario) -> str:
    """Return the identity of a trial's detections and truth, 32 hexadecimal digits.

    Args:
        scenario: resolved scenario with its seed; its variants do not count.
    """
    values = scenario.model_dump(mode="json", exclude={"name": True, "description": True, "method": True})
    del values["detector"]["name"]
    for *sections, key in FILE_KEYS:  # by content, below
        functools.reduce(dict.__getitem__, sections, values)[key] = ""
    content = {key: _content(files) for key, files in _files(scenario).items()}
    made_by = {"code": code().simulation, "versions": list(versions().items())}
    return _digest({"scenario": values, "files": content, **made_by})


def entry_identity(trial: str, variant: str, estimator: str = "", *, lag: float | None = None) -> str:
    """Return the identity of a variant's estimates in a trial, 32 hexadecimal digits.

    Args:
        trial: from :func:`trial_identity`.
        variant: name of the variant.
        estimator: from :func:`estimator_code`, of a user-defined estimator; "" for a preset.
        lag: ``method.lag`` of the scenario, for presets that track; None for all others.
    """
    values: dict[str, Any] = {"trial": trial, "variant": variant, "code": code().method}
    if estimator:
        values["own"] = estimator
    if lag is not None:
        values["lag"] = lag
    return _digest(values)


def estimator_code(place: str) -> str:
    """Return the digest of a user-defined estimator: its sources, and the names of its file and of itself.

    Args:
        place: its place as section [method.estimators] gives it.
    """
    source, _, attribute = place.rpartition(":")
    sources = {name: hashlib.blake2b(text).hexdigest() for name, text in sources_of(place).items()}
    return _digest({"place": [Path(source).name, attribute], "sources": sources})


def provenance(*, command: str | None, seeds: Iterable[int], variants: Iterable[str], seconds: float) -> dict[str, Any]:
    """Return the provenance of a result, ready for JSON.

    Args:
        command: command line of the user.
        seeds: seeds of the scenes; empty for recorded data.
        variants: variants of the method.
        seconds: duration of the run.

    Returns:
        The arguments, and ``code`` (version), ``digests`` (of the code: simulation, method, scores, failures),
        ``versions`` (of packages), ``machine``.
    """
    return {
        "command": command,
        "seeds": list(seeds),
        "variants": list(variants),
        "code": code_version(),
        "digests": asdict(code()),
        "versions": {"python": platform.python_version(), **versions()},
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cpus": os.cpu_count()},
        "seconds": seconds,
    }


def provenance_sentence(provenance: Mapping[str, Any]) -> str:
    """Return a sentence with the code, the libraries and the machine that made a result.

    Args:
        provenance: keys of :func:`provenance`.
    """
    digests = ", ".join(f"{name} {digest[:8]}" for name, digest in provenance["digests"].items())
    versions = ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    machine = provenance["machine"]
    return f"Code {provenance['code']} ({digests}) with {versions}; {machine['processor']}, {machine['cpus']} cores."


def _files(scenario: Scenario) -> dict[str, list[Path]]:
    """Return the files that a scenario names, by key, each with the files beside it that its reader also takes."""
    files = {}
    for key, file in scenario.named_files.items():
        files[key] = [file]
        suffix = file.suffix.lower()
        if key.startswith("clutter.objects"):
            files[key] = list(object_dependencies(file))
            continue
        if tuple(key.split(".")) in NETWORK_KEYS:
            with contextlib.suppress(ValueError):  # not on this machine: its content is that of a missing file
                files[key] = [network_file(scenario, key)]
            files[key].append(files[key][0].with_suffix(".json"))
        elif suffix == ".onnx":  # the card beside a network
            files[key].append(file.with_suffix(".json"))
        elif suffix == ".amc":  # the skeleton beside a motion
            files[key] += _beside(file, ".asf")
        elif key == "people.motion.file" and suffix != ".bvh":  # people over time, in one or more files
            files[key] = people_files(file)
        elif file.is_dir():  # a calibration with a file for each camera, or in the folder of a project
            files[key] = calibration_files(file)
        elif suffix in (".yml", ".yaml", ".xml"):  # calibrations in two files
            files[key] += _beside(file, ".yml", ".yaml", ".xml")
        elif file.name in FILES:
            files[key] = [file.with_name(each) for each in FILES]
    return files


def _beside(file: Path, *suffixes: str) -> list[Path]:
    files = sorted(file.parent.iterdir()) if file.parent.is_dir() else []
    return [each for each in files if each.suffix.lower() in suffixes and each != file]


def _content(files: list[Path]) -> dict[str, str | None]:
    """Return digests by name; None for a missing file."""
    stats = {file: file.stat() if os.path.isfile(file) else None for file in files}
    return {
        file.name: None if stat is None else _digest_of_file(file, stat.st_size, stat.st_mtime_ns)
        for file, stat in stats.items()
    }


@functools.lru_cache(maxsize=256)
def _digest_of_file(file: Path, size: int, changed: int) -> str:
    """Return the digest of a file. It is cached by size and time of change: ten thousand trials read a network once."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, lambda: hashlib.blake2b(digest_size=_SIZE)).hexdigest()


def _digest(value: Any) -> str:
    return hashlib.blake2b(json.dumps(value, sort_keys=True).encode(), digest_size=_SIZE).hexdigest()


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"
