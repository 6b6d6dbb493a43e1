"""Numbers of tables 1 and 2 of the paper (Dong et al., CVPR 2019): as printed, on real data, and on simulated twins.

The inputs are files of ``simharness evaluate shelf`` and of :mod:`tools.paper_tables.seed_scores`; their provenance is
kept. Table 1 compares methods, table 2 compares variants of one method.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.commands.output_files import write_text
from mvpose.presets import NEED_DESCRIPTORS
from simharness.reality.evaluation import ABLATION, PublishedPcp
from simharness.trial.identity import PROVENANCE
from tools.paper_tables.seed_scores import COMMAND
from tools.paper_tables.text import markdown

VARIANTS = ("full", "appearance", "geometry", "no-3dps", "no-matching", "hungarian", "fast")
"""Rows of table 2: the variants of the paper, then the variants of this project."""

_OURS = {"no-3dps": "this code, without 3DPS", "full": "this code"}  # rows of table 1

COMPARISON: dict[str, dict[str, PublishedPcp]] = {
    "campus": {
        "Belagiannis et al., CVPR 2014": PublishedPcp(82.0, 72.4, 73.7, 75.8),
        "Belagiannis et al., ECCV Workshops 2014": PublishedPcp(83.0, 73.0, 78.0, 78.0),
        "Belagiannis et al., PAMI 2016": PublishedPcp(93.5, 75.7, 84.4, 84.5),
        "Ershadi-Nasab et al., Multimedia Tools and Applications 2018": PublishedPcp(94.2, 92.9, 84.6, 90.6),
        "Dong et al., CVPR 2019, without 3DPS": ABLATION["campus"]["no-3dps"],
        "Dong et al., CVPR 2019": ABLATION["campus"]["full"],
    },
    "shelf": {
        "Belagiannis et al., CVPR 2014": PublishedPcp(66.1, 65.0, 83.2, 71.4),
        "Belagiannis et al., ECCV Workshops 2014": PublishedPcp(75.0, 67.0, 86.0, 76.0),
        "Belagiannis et al., PAMI 2016": PublishedPcp(75.3, 69.7, 87.6, 77.5),
        "Ershadi-Nasab et al., Multimedia Tools and Applications 2018": PublishedPcp(93.3, 75.9, 94.8, 88.0),
        "Dong et al., CVPR 2019, without 3DPS": ABLATION["shelf"]["no-3dps"],
        "Dong et al., CVPR 2019": ABLATION["shelf"]["full"],
    },
}
"""Table 1, by data set and method.

The average of Belagiannis et al., CVPR 2014, on Campus is printed as 75.8; the mean of its row is 76.0.
"""


@dataclass(frozen=True)
class _Input:
    """An input file.

    Attributes:
        option: option of the command line that names the file.
        contents: what the file holds.
        command: command that writes such files, without arguments.
        key: JSON key that distinguishes the file from other files of that command.
        value: expected value of the key.
        makes: example of the whole command.
    """

    option: str
    contents: str
    command: str
    key: str
    value: str
    makes: str


_METHODS = " ".join(f"--method {name}" for name in VARIANTS if name not in NEED_DESCRIPTORS)
SEED_SCORES = f"python -m {COMMAND}"
_FORMER = "simharness evaluate seeds"  # of 0.2, the same files
_SEEDS = f"--set 'method.variants={json.dumps(VARIANTS, separators=(',', ':'))}'"

INPUTS = {
    "voxelpose": _Input(
        option="--shelf",
        contents="real Shelf with the VoxelPose head",
        command="simharness evaluate shelf",
        key="head",
        value="voxelpose",
        makes=f"simharness evaluate shelf FOLDER --head voxelpose {_METHODS} --json FILE",
    ),
    "2019": _Input(
        option="--shelf-2019",
        contents="real Shelf with the 2019 head",
        command="simharness evaluate shelf",
        key="head",
        value="2019",
        makes=f"simharness evaluate shelf FOLDER --head 2019 {_METHODS} --json FILE",
    ),
    "campus": _Input(
        option="--campus-twin",
        contents="twin of Campus",
        command=SEED_SCORES,
        key="name",
        value="campus",
        makes=f"{SEED_SCORES} scenarios/campus.toml {_SEEDS} --json FILE",
    ),
    "shelf": _Input(
        option="--shelf-twin",
        contents="twin of Shelf",
        command=SEED_SCORES,
        key="name",
        value="shelf",
        makes=f"{SEED_SCORES} scenarios/shelf.toml --set appearance.source=pictures {_SEEDS} --json FILE",
    ),
}
"""Input files of the tables: real Shelf with each head mapping, and both twins."""

_ACTORS = 3  # whose PCP the paper averages

HEADS = ("voxelpose", "2019")
"""Inputs with results on real Shelf."""


def read_inputs(files: Mapping[str, Path]) -> dict[str, dict[str, Any]]:
    """Read and check the input files.

    Args:
        files: paths by the keys of :data:`INPUTS`.

    Raises:
        ValueError: a file does not exist, was written by another command, or lacks variants or provenance.
    """
    return {key: _read(wanted, files[key]) for key, wanted in INPUTS.items()}


def paper_tables(inputs: Mapping[str, Mapping[str, Any]], *, command: str | None = None) -> dict[str, Any]:
    """Return the numbers of both tables, JSON-ready.

    Every PCP (percent) and every difference (points) is a list of a value and the two ends of its 95 % interval. The
    ends are None for printed numbers and for a single recording, which have no interval.

    Args:
        inputs: from :func:`read_inputs`.
        command: command line of the user, to be recorded.

    Returns:
        ``comparison`` (table 1): by data set a list of rows with ``method``, ``of`` (source: "paper", "voxelpose",
        "2019" or "twin"), ``actors`` (None for twins) and ``average``. ``ablation`` (table 2): by data set, variant and
        source: ``pcp``, ``against_full`` and, for recorded data, ``same_as``: without descriptors "full" and "geometry"
        are the same measurement, and their difference is left out; None for a variant that was not run. ``inputs``:
        provenance and contents of the inputs; ``skipped`` are seeds inside the range that gave no scene.
    """
    return {
        "command": command,
        "comparison": {data: list(_comparison(data, inputs)) for data in COMPARISON},
        "ablation": {data: _ablation(data, inputs) for data in ABLATION},
        "inputs": {key: _described(summary) for key, summary in inputs.items()},
    }


def write_tables(tables: Mapping[str, Any], folder: Path) -> None:
    """Write ``tables.md`` and ``tables.json`` into a folder.

    Args:
        tables: from :func:`paper_tables`.
        folder: a new folder, or one with older tables, which are replaced.

    Raises:
        ValueError: the folder holds something else, or cannot be written.
    """
    has_tables = (folder / "tables.json").is_file()
    if folder.exists() and not has_tables and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f"--out {folder}: exists and holds no tables of the paper; name another folder")
    text = json.dumps(tables, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(markdown(tables), folder / "tables.md")
    write_text(text + "\n", folder / "tables.json")


def _comparison(data: str, inputs: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for method, row in COMPARISON[data].items():
        yield {"method": method, "of": "paper", "actors": [*row[:3]], "average": [row.average, None, None]}
    for head in HEADS if data == "shelf" else ():
        for variant, method in _OURS.items():
            scores = inputs[head]["variants"][variant]
            yield {"method": method, "of": head, "actors": scores["pcp_actors"], "average": [scores["pcp"], None, None]}
    for variant, method in _OURS.items():
        yield {"method": method, "of": "twin", "actors": None, "average": _ends(inputs[data]["pcp"][variant])}


def _ablation(data: str, inputs: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    printed = {name: row.average for name, row in ABLATION[data].items()}
    recorded = {head: inputs[head]["variants"] for head in HEADS} if data == "shelf" else {}
    twin = inputs[data]
    return {
        name: {
            "paper": _alone(printed, name),
            **{head: _recorded(variants, name) for head, variants in recorded.items()},
            "twin": {
                "pcp": _ends(twin["pcp"][name]),
                "against_full": None if name == "full" else _ends(twin["ahead_of_full"][name]),
            },
        }
        for name in VARIANTS
    }


def _alone(pcp: Mapping[str, float], name: str) -> dict[str, Any] | None:
    """Return the cell of a variant whose numbers have no intervals; None for a variant without a number."""
    if name not in pcp:
        return None
    against = None if name == "full" else [round(pcp[name] - pcp["full"], 10), None, None]
    return {"pcp": [pcp[name], None, None], "against_full": against}


def _recorded(variants: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Any] | None:
    """Return the cell of a variant on recorded data; None for a variant that was not run."""
    cell = _alone({each: scores["pcp"] for each, scores in variants.items()}, name)
    if cell is None:
        return None
    same = {"full": "geometry", "geometry": "full"}.get(name) if _without_descriptors(variants) else None
    return {**cell, "same_as": same, "against_full": None if same else cell["against_full"]}


def _without_descriptors(variants: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether the recorded detections have no descriptors, from the results alone.

    Then no variant that needs descriptors was run, and "full" has the same PCP as "geometry".
    """
    return NEED_DESCRIPTORS.isdisjoint(variants) and variants["full"]["pcp"] == variants["geometry"]["pcp"]


def _ends(score: Mapping[str, float]) -> list[float]:
    return [score["pcp"], score["low"], score["high"]]


def _described(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return provenance and contents of an input. Recorded data have no seeds."""
    kept = {key: summary[key] for key in PROVENANCE}
    seeds = list(summary["seeds"] or ())
    skipped = sorted(set(range(min(seeds), max(seeds))) - set(seeds)) if seeds else []
    kept |= {"seeds": seeds, "skipped": skipped, "variants": list(summary["variants"])}
    return {**kept, "frames": summary["frames"], "detector": summary.get("detector"), "head": summary["head"]}


def _read(wanted: _Input, file: Path) -> dict[str, Any]:
    """Read and check one input."""
    where, remedy = f"{wanted.option} {file}", f"make it with: {wanted.makes}"
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{where}: no such file; {remedy}") from None
    except OSError as error:
        raise ValueError(f"{where}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise ValueError(f"{where}: is not JSON; {remedy}") from None
    if not isinstance(summary, dict):
        raise ValueError(f"{where}: expected a JSON object, got {type(summary).__name__}; {remedy}")
    if missing := [key for key in (*PROVENANCE, "frames", "head") if key not in summary]:
        raise ValueError(f"{where}: lacks the keys {', '.join(missing)}; {remedy}")
    command = " ".join(shlex.split(str(summary["command"]))[:3])
    command = SEED_SCORES if command == _FORMER else command
    if command != wanted.command:
        raise ValueError(f"{where}: expected a file of {wanted.command}, got one of {summary['command']}; {remedy}")
    if summary.get(wanted.key) != wanted.value:
        raise ValueError(f"{where}: expected the {wanted.key} {wanted.value}, got {summary.get(wanted.key)}; {remedy}")
    check = _check_twin if command == SEED_SCORES else _check_recorded
    try:
        if missing := check(summary):
            raise ValueError(f"{where}: lacks the variants {', '.join(missing)}; {remedy}")
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{where}: is not as {command} writes it ({error!r}); {remedy}") from None
    return summary


def _check_recorded(summary: Mapping[str, Any]) -> list[str]:
    """Return the variants that a file of recorded data lacks.

    Raises:
        AttributeError, KeyError, TypeError: the file does not have the structure of such files.
    """
    variants = summary["variants"]
    present = [name for name in VARIANTS if name in variants]
    for name in present:
        scores = variants[name]
        if len(scores["pcp_actors"]) != _ACTORS or not _all_numbers(scores["pcp"], *scores["pcp_actors"]):
            raise TypeError(f"PCP of {name}")
    return [name for name in VARIANTS if name not in present and name not in NEED_DESCRIPTORS]


def _check_twin(summary: Mapping[str, Any]) -> list[str]:
    """Return the variants that a file of many seeds lacks; raises like :func:`_check_recorded`."""
    present = [name for name in VARIANTS if name in summary["pcp"]]
    for name in present:
        if not _all_numbers(*_ends(summary["pcp"][name])):
            raise TypeError(f"PCP of {name}")
        if "full" in present and name != "full" and not _all_numbers(*_ends(summary["ahead_of_full"][name])):
            raise TypeError(f"PCP of {name} against full")
    return [name for name in VARIANTS if name not in present]


def _all_numbers(*values: Any) -> bool:
    return all(isinstance(value, int | float) and math.isfinite(value) for value in values)
