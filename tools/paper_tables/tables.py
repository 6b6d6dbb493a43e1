"""Tables 1 and 2 of the paper (Dong et al., CVPR 2019) three ways: as printed, on real data, on simulated twins.

The numbers are read from what ``simharness evaluate shelf`` and ``simharness evaluate seeds`` wrote, and keep what that
says of where they come from. Table 1 compares methods, table 2 variants of one.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.pipeline import NEED_DESCRIPTORS
from simharness.reality.evaluation import ACTORS
from simharness.reality.published_scores import ABLATION, COMPARISON
from simharness.runtime.atomic_files import appearing
from simharness.trial.provenance import PROVENANCE
from tools.paper_tables.text import markdown

VARIANTS = ("full", "appearance", "geometry", "no-3dps", "no-matching", "hungarian", "fast")
"""The rows of table 2: the paper's variants, then ours."""

_OURS = {"no-3dps": "this code, without 3DPS", "full": "this code"}  # rows of table 1


@dataclass(frozen=True)
class _Input:
    """A file to read.

    Attributes:
        option: that names it.
        command: of ``simharness``, that writes such files.
        key: what tells it from the other files of that command,
        value: and what that is.
        makes: an example of the command.
    """

    option: str
    command: str
    key: str
    value: str
    makes: str


_METHODS = " ".join(f"--method {name}" for name in VARIANTS if name not in NEED_DESCRIPTORS)
_SEEDS = f"--set 'method.variants={json.dumps(VARIANTS, separators=(',', ':'))}'"

INPUTS = {
    "voxelpose": _Input(
        option="--shelf",
        command="evaluate shelf",
        key="head",
        value="voxelpose",
        makes=f"simharness evaluate shelf FOLDER --head voxelpose {_METHODS} --json FILE",
    ),
    "2019": _Input(
        option="--shelf-2019",
        command="evaluate shelf",
        key="head",
        value="2019",
        makes=f"simharness evaluate shelf FOLDER --head 2019 {_METHODS} --json FILE",
    ),
    "campus": _Input(
        option="--campus-twin",
        command="evaluate seeds",
        key="name",
        value="campus",
        makes=f"simharness evaluate seeds scenarios/campus.toml {_SEEDS} --json FILE",
    ),
    "shelf": _Input(
        option="--shelf-twin",
        command="evaluate seeds",
        key="name",
        value="shelf",
        makes=f"simharness evaluate seeds scenarios/shelf.toml --set appearance.source=pictures {_SEEDS} --json FILE",
    ),
}
"""What the tables are made of: real Shelf by either head mapping, and both twins."""

HEADS = ("voxelpose", "2019")
"""The inputs that are of real Shelf."""


def read_inputs(files: Mapping[str, Path]) -> dict[str, dict[str, Any]]:
    """Read what the tables are made of.

    Args:
        files: by the keys of :data:`INPUTS`.

    Raises:
        ValueError: a file that is not there, that another command wrote, or that lacks variants or provenance.
    """
    return {key: _read(wanted, files[key]) for key, wanted in INPUTS.items()}


def paper_tables(inputs: Mapping[str, Mapping[str, Any]], *, command: str | None = None) -> dict[str, Any]:
    """The numbers of both tables, JSON-ready.

    Every PCP, percent, and every difference, points, is a list of a value and the ends of its 95 % interval, which are
    None where there is none: of what is printed, and of one recording.

    Args:
        inputs: from :func:`read_inputs`.
        command: how the user asked for this.

    Returns:
        ``comparison`` (table 1), by data set a list of rows: ``method``, ``of`` ("paper", "voxelpose", "2019", "twin"),
        ``actors`` (None of twins) and ``average``. ``ablation`` (table 2), by data set, variant and column ("paper",
        "voxelpose", "2019", "twin"): ``pcp``, ``against_full`` and, of recorded data, ``same_as``: without descriptors
        "full" and "geometry" are one measurement, and no difference of them is told; None where a variant was not run.
        ``inputs``: their provenance, and what they are of, ``skipped`` the seeds between theirs that were passed over.
    """
    return {
        "command": command,
        "comparison": {data: list(_comparison(data, inputs)) for data in COMPARISON},
        "ablation": {data: _ablation(data, inputs) for data in ABLATION},
        "inputs": {key: _described(told) for key, told in inputs.items()},
    }


def write_tables(told: Mapping[str, Any], folder: Path) -> None:
    """Write ``tables.md`` and ``tables.json`` into a folder.

    Args:
        told: from :func:`paper_tables`.
        folder: appears whole, in the place of older tables.

    Raises:
        ValueError: the folder holds something else, or cannot be written.
    """
    ours = (folder / "tables.json").is_file()
    if folder.exists() and not ours and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f"--out {folder}: is there and holds no tables of the paper; name another folder")
    text = json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False)
    try:
        with appearing(folder) as partial:
            (partial / "tables.json").write_text(text + "\n", encoding="utf-8")
            (partial / "tables.md").write_text(markdown(told), encoding="utf-8")
    except OSError as error:
        raise ValueError(f"--out {folder}: cannot be written: {error.strerror}") from None


def _comparison(data: str, inputs: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for method, row in COMPARISON[data].items():
        yield {"method": method, "of": "paper", "actors": [*row[:3]], "average": [row.average, None, None]}
    for head in HEADS if data == "shelf" else ():
        for variant, method in _OURS.items():
            scores = inputs[head]["variants"][variant]
            yield {
                "method": method,
                "of": head,
                "actors": scores["pcp_actors"],
                "average": [scores["pcp"], None, None],
            }
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
    """A cell of figures without intervals."""
    if name not in pcp:
        return None
    against = None if name == "full" else [round(pcp[name] - pcp["full"], 10), None, None]
    return {"pcp": [pcp[name], None, None], "against_full": against}


def _recorded(variants: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Any] | None:
    """A cell of recorded data."""
    cell = _alone({each: scores["pcp"] for each, scores in variants.items()}, name)
    if cell is None:
        return None
    same = {"full": "geometry", "geometry": "full"}.get(name) if _without_descriptors(variants) else None
    return {**cell, "same_as": same, "against_full": None if same else cell["against_full"]}


def _without_descriptors(variants: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether recorded detections carry no descriptors: nothing that needs them was run, and "full" is "geometry"."""
    return NEED_DESCRIPTORS.isdisjoint(variants) and variants["full"]["pcp"] == variants["geometry"]["pcp"]


def _ends(score: Mapping[str, float]) -> list[float]:
    return [score["pcp"], score["low"], score["high"]]


def _described(told: Mapping[str, Any]) -> dict[str, Any]:
    """Where an input comes from. Recorded data have no seeds."""
    kept = {key: told[key] for key in PROVENANCE}
    seeds = list(told["seeds"] or ())
    skipped = sorted(set(range(min(seeds), max(seeds))) - set(seeds)) if seeds else []
    kept |= {"seeds": seeds, "skipped": skipped, "variants": list(told["variants"])}
    return {**kept, "frames": told["frames"], "detector": told.get("detector"), "head": told["head"]}


def _read(wanted: _Input, file: Path) -> dict[str, Any]:
    """One input, checked."""
    where, remedy = f"{wanted.option} {file}", f"make it by: {wanted.makes}"
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{where}: no such file; {remedy}") from None
    except OSError as error:
        raise ValueError(f"{where}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise ValueError(f"{where}: is not JSON; {remedy}") from None
    if not isinstance(told, dict):
        raise ValueError(f"{where}: expected an object of JSON, got {type(told).__name__}; {remedy}")
    if lacking := [key for key in (*PROVENANCE, "frames", "head") if key not in told]:
        raise ValueError(f"{where}: does not say what it is and where it comes from: no {', '.join(lacking)}; {remedy}")
    command = " ".join(shlex.split(str(told["command"]))[1:3])
    if command != wanted.command:
        raise ValueError(f"{where}: expected what simharness {wanted.command} wrote, got {told['command']}; {remedy}")
    if told.get(wanted.key) != wanted.value:
        raise ValueError(f"{where}: expected the {wanted.key} {wanted.value}, got {told.get(wanted.key)}; {remedy}")
    check = _check_recorded if command == "evaluate shelf" else _check_twin
    try:
        if missing := check(told):
            raise ValueError(f"{where}: lacks the variants {', '.join(missing)}; {remedy}")
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{where}: is not as simharness {command} writes it ({error!r}); {remedy}") from None
    return told


def _check_recorded(told: Mapping[str, Any]) -> list[str]:
    """Variants that a file of recorded data lacks.

    Raises:
        AttributeError, KeyError, TypeError: it is not built as such files are.
    """
    variants = told["variants"]
    for name in (there := [each for each in VARIANTS if each in variants]):
        scores = variants[name]
        if len(scores["pcp_actors"]) != len(ACTORS) or not _all_numbers(scores["pcp"], *scores["pcp_actors"]):
            raise TypeError(f"PCP of {name}")
    return [name for name in VARIANTS if name not in there and name not in NEED_DESCRIPTORS]


def _check_twin(told: Mapping[str, Any]) -> list[str]:
    """Variants that a file of many seeds lacks. Raises as :func:`_check_recorded`."""
    for name in (there := [each for each in VARIANTS if each in told["pcp"]]):
        if not _all_numbers(*_ends(told["pcp"][name])):
            raise TypeError(f"PCP of {name}")
        if "full" in there and name != "full" and not _all_numbers(*_ends(told["ahead_of_full"][name])):
            raise TypeError(f"PCP of {name} beside full")
    return [name for name in VARIANTS if name not in there]


def _all_numbers(*values: Any) -> bool:
    return all(isinstance(value, int | float) and math.isfinite(value) for value in values)
