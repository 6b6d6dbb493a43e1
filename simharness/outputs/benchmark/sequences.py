"""Benchmark of many sequences of one scenario, each of its own seed, in one folder with a description of them all.

    NAME_0000/, NAME_0001/, ...         sequences (:mod:`.layout`), numbered by seed
    benchmark.json                      sequences with their splits, and the digest of their truth
    croissant.json, README.md           metadata (https://docs.mlcommons.org/croissant), datasheet
    SHA256SUMS                          checksums of all other files, for ``sha256sum --check``

People, clothes, places, motion, clutter and noise differ from seed to seed, so no two splits share a person. A sequence
that is there is kept: an export that was stopped goes on, and several machines may write other seeds of one folder.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.commands.progress import Reporter, Silence
from mvpose.files.atomic_files import MANIFEST, write_atomic
from mvpose.files.input_files import read_bytes, read_json_object
from mvpose.formats.people import read_people
from mvpose.report.documents import fill_template
from simharness.outputs import TEMPLATES
from simharness.outputs.benchmark.layout import readable_json
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.load import fingerprint
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.identity import code, provenance

SPLITS = ("train", "train", "train", "test", "train", "val", "train", "train", "test", "train")
"""Splits by the last digit of the seed: those of a benchmark stay when it grows."""

_DATA = Path(__file__).parents[1] / "data"
_TRUTH_STEP = 1e-4  # metres: the digest of the truth does not hang on the processor


@dataclass(frozen=True)
class Exported:
    """What an export of many sequences has done."""

    made: int
    """Number of sequences that were written."""
    kept: int
    """Number of sequences that were there already."""
    impossible: dict[int, str]
    """By seed, why its scene cannot be built."""


def export_benchmark(
    scenario: Scenario,
    folder: Path,
    plan: Callable[[Path], ExportPlan] = ExportPlan,
    *,
    sequences: int,
    workers: int = 1,
    reporter: Reporter | None = None,
    command: str | None = None,
) -> Exported:
    """Write sequences of a scenario, of its seed and the following ones, and describe all that are in the folder.

    Args:
        scenario: resolved scenario; its method is not run.
        folder: folder of the benchmark.
        plan: function that returns the plan of the sequence in a folder.
        sequences: number of seeds.
        workers: processes, each with a sequence of its own.
        reporter: receiver of progress.
        command: command of the user, for the manifests.

    Raises:
        ValueError: no scene can be built, or a folder holds something else.
        RunError: any error after that.
    """
    if _made(folder):
        raise ValueError(f"{folder}: is a sequence, not a benchmark of several; give another folder")
    seeds = range(scenario.seed, scenario.seed + sequences)
    plans = {seed: plan(folder / f"{scenario.name}_{seed:04d}") for seed in seeds}
    wanted = {seed: _request(scenario.model_copy(update={"seed": seed}), plans[seed]) for seed in seeds}
    left = [seed for seed in seeds if _made(plans[seed].folder).get("request") != wanted[seed]]
    export = partial(_export, scenario=scenario, plans=plans, wanted=wanted, command=command)
    with (reporter or Silence()).stage("sequences", len(left)) as advance:
        reasons = map_jobs(export, [(range(k, k + 1),) for k in left], workers=workers, progress=advance, unit="seed")
    impossible = {seed: reason for seed, reason in zip(left, reasons, strict=True) if reason}
    if len(impossible) == sequences:
        raise ValueError(f"no scene of {sequences} seeds can be built; seed {left[0]}: {impossible[left[0]]}")
    _describe(scenario, folder, command)
    return Exported(len(left) - len(impossible), sequences - len(left), impossible)


def _request(scenario: Scenario, plan: ExportPlan) -> dict[str, Any]:
    """Return what makes a sequence what it is: scenario with seed, code of the simulation, and chosen contents."""
    contents = {"every": plan.every, "pictures": plan.pictures, "also": sorted(plan.also)}
    return {"scenario": fingerprint(scenario), "simulation": code().simulation, **contents}


def _made(folder: Path) -> dict[str, Any]:
    """Return the manifest of a sequence; empty where there is none."""
    path = folder / "manifest.json"
    return read_json_object(path, what="the manifest of a sequence") if path.is_file() else {}


def _export(
    seeds: range,
    *,
    scenario: Scenario,
    plans: dict[int, ExportPlan],
    wanted: dict[int, dict[str, Any]],
    command: str | None,
) -> str:
    """Write the sequence of one seed; return why its scene cannot be built, or nothing."""
    (seed,) = seeds
    seeded = scenario.model_copy(update={"seed": seed})
    try:
        export_sequence(seeded, plans[seed], command=command, request=wanted[seed])
    except ValueError as error:  # people do not fit beside the clutter that was drawn
        return str(error)
    return ""


def _describe(scenario: Scenario, folder: Path, command: str | None) -> None:
    """Write the description of all sequences in a folder, and the checksums last."""
    digest, sequences = hashlib.sha256(), []
    for place in sorted(each for each in folder.iterdir() if _made(each)):
        made, truth = _made(place), read_people(place / "truth.npz")
        digest.update(np.rint(np.nan_to_num(truth.joints, nan=-9.0) / _TRUTH_STEP).astype(np.int32).tobytes())
        counts = {"frames": made["frames"]["count"], "cameras": len(made["cameras"]), "people": len(made["people"])}
        sequences.append({"name": place.name, "seed": made["seed"], "split": SPLITS[made["seed"] % 10], **counts})
    seeds = [each["seed"] for each in sequences]
    about: dict[str, Any] = {"format": "simharness benchmark", "version": 1, "name": scenario.name}
    about |= {"description": scenario.description, "sequences": sequences, "truth_sha256": digest.hexdigest()}
    about["provenance"] = provenance(command=command, seeds=seeds, variants=[], seconds=0.0)
    write_atomic(folder / "benchmark.json", readable_json(about))
    metadata = read_json_object(_DATA / "croissant.json", what="the metadata")
    metadata |= {"name": scenario.name, "description": scenario.description or f"Scenario {scenario.name}"}
    metadata["distribution"][0]["sha256"] = hashlib.sha256(readable_json(about)).hexdigest()
    write_atomic(folder / "croissant.json", readable_json(metadata))
    text = fill_template("benchmark.md", folder=TEMPLATES, about=about, scenario=scenario)
    write_atomic(folder / "README.md", text.encode())
    files = sorted(each for each in folder.rglob("*") if each.is_file() and each.name not in (MANIFEST, "SHA256SUMS"))
    lines = [f"{_sha256(each)}  {each.relative_to(folder).as_posix()}\n" for each in files]
    write_atomic(folder / "SHA256SUMS", "".join(lines).encode())


def _sha256(path: Path) -> str:
    return hashlib.sha256(read_bytes(path, what="a file of the benchmark", most=path.stat().st_size)).hexdigest()
