"""Markdown text of the paper's tables; the numbers are from :mod:`tools.paper_tables.tables`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from mvpose.commands.progress import duration
from simharness.runtime.number_text import fixed, signed
from simharness.trial.identity import provenance_sentence

_DATA = {"campus": "Campus", "shelf": "Shelf"}
_OF = {"paper": "paper", "voxelpose": "real Shelf, VoxelPose head", "2019": "real Shelf, 2019 head", "twin": "twin"}

_PLACED = {"campus": "people", "shelf": "people or the rack"}  # a seed at which these find no free place has no scene

_TRIANGULATED = (
    "The twin's detector misses joints; the paper's gives every joint of each person that it finds. A joint that fewer "
    "than two cameras detect cannot be triangulated, but the pictorial structure places it by the bone lengths: "
    "without missed joints most of the loss is gone."
)
_UNMATCHED = (
    "The loss depends on the joints that the detector misses and on the distances between people; the people of the "
    "twin are not the actors. The paper also uses another 2D detector for this variant than for its full method; here "
    "all variants get the same detections."
)

# Differences between the set-ups of the paper and of the twin that affect a row; written only for rows that differ.
_WHY: dict[str, dict[str, str]] = {
    "full": {
        "campus": "Different detections: the paper's are from a Cascaded Pyramid Network on the real pictures, the "
        "twin's are simulated and not fitted to Campus. Different people, and exact truth, not manual annotation.",
        "shelf": "Different detections: the paper's are from a Cascaded Pyramid Network, the twin's are simulated with "
        "the errors of OpenPose on Shelf. Different people, and exact truth, not manual annotation.",
    },
    "appearance": {
        "campus": "Different descriptors: the paper's network was trained on real people, ours on rendered people, and "
        "it is used on rendered people here.",
        "shelf": "In the paper actor 2 looks like another person and has most of the loss. Two people of the twin wear "
        "the same clothes, too, but our descriptors differ: they are from a network that was trained on rendered "
        "people and is used on rendered people here.",
    },
    "geometry": {
        "campus": "The distance measure is not the reason: an epipolar distance in pixels, as in the paper, loses as "
        "little on this twin. The twin's cameras are calibrated to 0.2 degrees, so rays agree and few matches are "
        "ambiguous.",
        "shelf": "On real Shelf this code uses geometry alone and has the score in the table, with other detections "
        "than the paper and with affinities from distances between rays in metres. What descriptors would add there "
        "was not measured.",
    },
    "no-3dps": {"campus": _TRIANGULATED, "shelf": _TRIANGULATED},
    "no-matching": {"campus": _UNMATCHED, "shelf": _UNMATCHED},
}


def markdown(tables: Mapping[str, Any]) -> str:
    """Return the tables, the differences between simulation and paper, and the sources of the numbers.

    Args:
        tables: from :func:`tools.paper_tables.tables.paper_tables`.
    """
    return "\n".join(_lines(tables)) + "\n"


def _lines(tables: Mapping[str, Any]) -> Iterator[str]:
    yield "# Tables 1 and 2 of the paper, three ways"
    yield (
        "\nPercentage of correct parts (PCP): as printed by Dong et al. (CVPR 2019), for this code on real data, and "
        "for this code on simulated twins of the data sets, with 95 % intervals over seeds. The paper uses the head "
        "mapping of 2019; twins use the VoxelPose head. A twin's average is over all of its people."
    )
    yield "\n## Table 1: methods"
    for data, title in _DATA.items():
        yield f"\n### {title}\n"
        yield from _comparison(tables["comparison"][data], title, _seed_count(tables, data))
        yield "\nSimulated people are not the actors, so twins have no column for each actor."
        if _full_is_geometry(tables["ablation"][data]):
            yield "On real Shelf this code uses geometry alone: the detections have no descriptors."
        yield from _sources(tables, data)
    yield "\n## Table 2: variants of the method"
    yield "\nBeside each PCP: the difference from `full` in points, on the same detections; for twins paired by seed."
    for data, title in _DATA.items():
        yield f"\n### {title}\n"
        yield from _ablation(tables["ablation"][data], title, _seed_count(tables, data))
        yield from _notes(data, tables["ablation"][data])
        yield from _differences(tables["ablation"][data], data)
        yield from _sources(tables, data)
    yield from _provenance(tables)


def _comparison(rows: Sequence[Mapping[str, Any]], title: str, seeds: int) -> Iterator[str]:
    of = {**_OF, "twin": f"twin of {title}, {seeds} seeds"}
    cells = []
    for row in rows:
        name = row["method"] if row["of"] == "paper" else f"{row['method']}: {of[row['of']]}"
        actors = ["–"] * 3 if row["actors"] is None else [f"{pcp:.1f}" for pcp in row["actors"]]
        cells.append([name, *actors, _pcp(row["average"])])
    yield from markdown_table([title, "Actor 1", "Actor 2", "Actor 3", "Average"], cells)


def _ablation(variants: Mapping[str, Mapping[str, Any]], title: str, seeds: int) -> Iterator[str]:
    columns = [column for column in _OF if column in variants["full"]]
    heads = [f"twin, {seeds} seeds" if column == "twin" else _OF[column] for column in columns]
    rows = []
    for name, cells in variants.items():
        row = [f"`{name}`"]
        for column in columns:
            cell = cells[column]
            row += ["–", "–"] if cell is None else [_pcp(cell["pcp"]), _against_full(name, cell)]
        rows.append(row)
    yield from markdown_table([title, *(each for head in heads for each in (head, "against `full`"))], rows)


def _against_full(name: str, cell: Mapping[str, Any]) -> str:
    """Return the text of the column "against `full`": no difference where both variants are one measurement."""
    if same := cell.get("same_as"):
        return f"as `{same}`" if name == "full" else "–"
    return _difference(cell["against_full"])


def _full_is_geometry(variants: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether "full" had no descriptors, and so used geometry alone, in any column."""
    return any(cell is not None and cell.get("same_as") for cell in variants["full"].values())


def _notes(data: str, variants: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    yield "\n`hungarian` and `fast` are not in the paper."
    if data == "campus":
        yield "There are no detections of real Campus to run on."
    elif _full_is_geometry(variants):
        yield "The detections of real Shelf have no descriptors: `appearance` cannot be run there, and `full` uses"
        yield "geometry alone. So `full` and `geometry` are the same measurement, and differences from `full` in these"
        yield "columns are also differences from `geometry`."


def _differences(variants: Mapping[str, Mapping[str, Any]], data: str) -> Iterator[str]:
    """Return the lines about printed numbers outside the interval of the twin, with possible reasons."""
    outside, inside = [], []
    for name, cells in variants.items():
        if cells["paper"] is None:
            continue
        key, text = ("pcp", _pcp) if name == "full" else ("against_full", _difference)
        printed, (_, low, high) = cells["paper"][key][0], cells["twin"][key]
        if low <= printed <= high:
            inside.append(f"`{name}`")
            continue
        what = f"`{name}`" if name == "full" else f"`{name}` against `full`"
        values = "; ".join(
            f"{_OF[column]} {text(cell[key])}"
            for column, cell in cells.items()
            if cell is not None and cell[key] is not None
        )
        outside.append(f"- {what}: {values}. {_WHY[name][data]}")
    if outside:
        yield f"\nOutside the interval of the twin of {_DATA[data]}, with the differences between paper and twin:\n"
        yield from outside
    if inside:
        yield f"\nInside the interval: {', '.join(inside)}."


def _sources(tables: Mapping[str, Any], data: str) -> Iterator[str]:
    """Return the lines with commands, seeds, code and running time of the inputs of a table."""
    yield "\nSources:\n"
    for key in ("voxelpose", "2019", "shelf") if data == "shelf" else ("campus",):
        source = tables["inputs"][key]
        what = f"twin, seeds {_seed_list(source['seeds'])} of" if source["seeds"] else f"{_OF[key]},"
        digests = ", ".join(f"{name} {digest[:8]}" for name, digest in source["digests"].items())
        yield (
            f"- {what} {source['frames']} frames; code {source['code']} ({digests}); {duration(source['seconds'])}: "
            f"`{source['command']}`"
        )
        if skipped := source["skipped"]:
            seeds = f"seed {skipped[0]}" if len(skipped) == 1 else f"seeds {_and(skipped)}"
            yield f"  Skipped: {seeds}, at which {_PLACED[key]} find no place."


def _provenance(tables: Mapping[str, Any]) -> Iterator[str]:
    """Return the lines with code, libraries and machine; inputs that share all of them are in one line."""
    yield "\n## Code, libraries and machine\n"
    groups: dict[str, list[str]] = {}
    for key, source in tables["inputs"].items():
        name = f"twin of {_DATA[key]}" if key in _DATA else _OF[key]
        groups.setdefault(provenance_sentence(source), []).append(name)
    for sentence, names in groups.items():
        yield f"- {'; '.join(names)}: {sentence}"
    if len({source["digests"]["method"] for source in tables["inputs"].values()}) > 1:
        yield "\nThe method's code differs between these inputs: compare them with care."


def _seed_count(tables: Mapping[str, Any], data: str) -> int:
    return len(tables["inputs"][data]["seeds"])


def _and(seeds: Sequence[int]) -> str:
    """Return two seeds or more as "1, 2 and 5"."""
    *others, last = map(str, seeds)
    return f"{', '.join(others)} and {last}"


def _seed_list(seeds: Sequence[int]) -> str:
    """Return ascending seeds as a range where none is missing, else as a list."""
    whole = len(seeds) == seeds[-1] - seeds[0] + 1
    return f"{seeds[0]} to {seeds[-1]}" if whole and len(seeds) > 2 else ", ".join(map(str, seeds))


def _pcp(ends: Sequence[float | None]) -> str:
    """Return a PCP and its interval."""
    pcp, low, high = (None if end is None else fixed(end, 1) for end in ends)
    return f"{pcp}" if low is None else f"{pcp} ({low} to {high})"


def _difference(ends: Sequence[float | None] | None) -> str:
    """Return a difference and its interval, with signs."""
    if ends is None:
        return ""
    points, low, high = (None if end is None else signed(end, 1) for end in ends)
    return f"{points}" if low is None else f"{points} ({low} to {high})"


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Return the lines of a Markdown table: a left-aligned column of names, then right-aligned columns of numbers."""
    yield f"| {' | '.join(heads)} |"
    yield f"|{'|'.join([':--', *['--:'] * (len(heads) - 1)])}|"
    yield from (f"| {' | '.join(row)} |" for row in rows)
