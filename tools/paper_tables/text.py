"""The paper's tables as a text to read: :mod:`tools.paper_tables.tables` makes the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from simharness.report.documents import markdown_table, provenance_sentence
from simharness.runtime.progress import duration

_DATA = {"campus": "Campus", "shelf": "Shelf"}
_OF = {
    "paper": "paper",
    "voxelpose": "real Shelf, VoxelPose head",
    "2019": "real Shelf, 2019 head",
    "twin": "twin",
}

_PLACED = {"campus": "people", "shelf": "people or the rack"}  # what a twin may find no place for: no scene then

_TRIANGULATED = (
    "The twin's detector leaves joints out, and the paper's gives every joint of whom it finds. A joint that fewer "
    "than two cameras have cannot be triangulated, while the pictorial structure puts it where the bones let it be: "
    "with nothing left out most of the loss is gone."
)
_UNMATCHED = (
    "How much it loses depends on the joints that the detector leaves out, and on how near people come to each other: "
    "those of the twin are not the actors. And the paper gives this variant another 2D detector than its full method; "
    "here all variants see the same detections."
)

# What the paper's set-up and the twin's do not have in common that a row depends on. Told only of rows that differ.
_WHY: dict[str, dict[str, str]] = {
    "full": {
        "campus": "Other detections: the paper's are a Cascaded Pyramid Network's on the real pictures, the twin's are "
        "simulated and not fitted to Campus. Other people, and exact truth in place of annotations by hand.",
        "shelf": "Other detections: the paper's are a Cascaded Pyramid Network's, the twin's are simulated by what "
        "OpenPose does on Shelf. Other people, and exact truth in place of annotations by hand.",
    },
    "appearance": {
        "campus": "Other descriptors: the paper's network was trained on real people, ours on rendered ones, and reads "
        "rendered people here.",
        "shelf": "In the paper actor 2 looks like another person, and most of the loss is his. Two people of the twin "
        "wear the same, too, but our descriptors are other ones: of a network that was trained on rendered people, and "
        "reads rendered people here.",
    },
    "geometry": {
        "campus": "The measure is not why: an epipolar distance in pixels, as the paper's, loses as little on this "
        "twin. Its cameras are calibrated to 0.2 degrees, so that rays agree and leave little to decide.",
        "shelf": "On real Shelf this code goes by geometry alone and scores what the table says, with other detections "
        "than the paper's and affinities on another scale, metres between rays. What descriptors would add there was "
        "not measured.",
    },
    "no-3dps": {"campus": _TRIANGULATED, "shelf": _TRIANGULATED},
    "no-matching": {"campus": _UNMATCHED, "shelf": _UNMATCHED},
}


def markdown(told: Mapping[str, Any]) -> str:
    """The tables, where simulation and paper differ, and where the numbers come from.

    Args:
        told: from :func:`tools.paper_tables.tables.paper_tables`.
    """
    return "\n".join(_lines(told)) + "\n"


def _lines(told: Mapping[str, Any]) -> Iterator[str]:
    yield "# Tables 1 and 2 of the paper, three ways"
    yield (
        "\nPercentage of correct parts (PCP): as Dong et al. (CVPR 2019) print it, of this code on real data, and of "
        "this code on simulated twins of the data sets, with 95 % intervals over seeds. The paper's head mapping is "
        "that of 2019; twins have the VoxelPose head. A twin's average is over everybody in it."
    )
    yield "\n## Table 1: methods"
    for data, title in _DATA.items():
        yield f"\n### {title}\n"
        yield from _comparison(told["comparison"][data], title, _seeds(told, data))
        yield "\nSimulated people are not the actors: twins have no column for each."
        if _same(told["ablation"][data]):
            yield "On real Shelf this code goes by geometry alone: the detections carry no descriptors."
        yield from _sources(told, data)
    yield "\n## Table 2: variants of the method"
    yield "\nBeside each PCP: points against `full` on the same detections, of twins seed by seed."
    for data, title in _DATA.items():
        yield f"\n### {title}\n"
        yield from _ablation(told["ablation"][data], title, _seeds(told, data))
        yield from _notes(data, told["ablation"][data])
        yield from _differences(told["ablation"][data], data)
        yield from _sources(told, data)
    yield from _origins(told)


def _comparison(rows: Sequence[Mapping[str, Any]], title: str, seeds: int) -> Iterator[str]:
    of = {**_OF, "twin": f"twin of {title}, {seeds} seeds"}
    cells = []
    for row in rows:
        name = row["method"] if row["of"] == "paper" else f"{row['method']}: {of[row['of']]}"
        actors = ["–"] * 3 if row["actors"] is None else [f"{pcp:.1f}" for pcp in row["actors"]]
        cells.append([name, *actors, _said(row["average"])])
    yield from markdown_table([title, "Actor 1", "Actor 2", "Actor 3", "Average"], cells)


def _ablation(variants: Mapping[str, Mapping[str, Any]], title: str, seeds: int) -> Iterator[str]:
    columns = [column for column in _OF if column in variants["full"]]
    heads = [f"twin, {seeds} seeds" if column == "twin" else _OF[column] for column in columns]
    rows = []
    for name, cells in variants.items():
        row = [f"`{name}`"]
        for column in columns:
            cell = cells[column]
            row += ["–", "–"] if cell is None else [_said(cell["pcp"]), _beside_full(name, cell)]
        rows.append(row)
    yield from markdown_table([title, *(each for head in heads for each in (head, "against `full`"))], rows)


def _beside_full(name: str, cell: Mapping[str, Any]) -> str:
    """What stands in the column "against `full`": of two variants that are one measurement no difference."""
    if same := cell.get("same_as"):
        return f"as `{same}`" if name == "full" else "–"
    return _against(cell["against_full"])


def _same(variants: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether "full" goes by geometry alone in any column."""
    return any(cell is not None and cell.get("same_as") for cell in variants["full"].values())


def _notes(data: str, variants: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    yield "\n`hungarian` and `fast` are not the paper's."
    if data == "campus":
        yield "There are no detections of real Campus to run on."
    elif _same(variants):
        yield "The detections of real Shelf carry no descriptors: there `appearance` cannot be run, and `full` goes by"
        yield "geometry alone. So `full` and `geometry` are one measurement, and what stands against `full` in these"
        yield "columns stands against `geometry`."


def _differences(variants: Mapping[str, Mapping[str, Any]], data: str) -> Iterator[str]:
    """Where what is printed lies outside the interval of the twin, and why that may be."""
    apart, alike = [], []
    for name, cells in variants.items():
        if cells["paper"] is None:
            continue
        key, said = ("pcp", _said) if name == "full" else ("against_full", _against)
        printed, (_, low, high) = cells["paper"][key][0], cells["twin"][key]
        if low <= printed <= high:
            alike.append(f"`{name}`")
            continue
        what = f"`{name}`" if name == "full" else f"`{name}` against `full`"
        values = "; ".join(
            f"{_OF[column]} {said(cell[key])}"
            for column, cell in cells.items()
            if cell is not None and cell[key] is not None
        )
        apart.append(f"- {what}: {values}. {_WHY[name][data]}")
    if apart:
        twin = f"the twin of {_DATA[data]}"
        yield f"\nWhere the paper lies outside the interval of {twin}, and what is not the same there:\n"
        yield from apart
    if alike:
        yield f"\nWithin it: {', '.join(alike)}."


def _sources(told: Mapping[str, Any], data: str) -> Iterator[str]:
    """Commands, seeds, code and time of what a table is made of."""
    yield "\nMade of:\n"
    for key in ("voxelpose", "2019", "shelf") if data == "shelf" else ("campus",):
        made = told["inputs"][key]
        what = f"twin, seeds {_listed(made['seeds'])} of" if made["seeds"] else f"{_OF[key]},"
        digests = ", ".join(f"{name} {digest[:8]}" for name, digest in made["digests"].items())
        yield (
            f"- {what} {made['frames']} frames; code {made['code']} ({digests}); {duration(made['seconds'])}: "
            f"`{made['command']}`"
        )
        if skipped := made["skipped"]:
            seeds = f"seed {skipped[0]}" if len(skipped) == 1 else f"seeds {_and(skipped)}"
            yield f"  Passed over: {seeds}, at which {_PLACED[key]} find no place."


def _origins(told: Mapping[str, Any]) -> Iterator[str]:
    """Code, libraries and machines; inputs that have them in common are told together."""
    yield "\n## Code, libraries and machine\n"
    groups: dict[str, list[str]] = {}
    for key, made in told["inputs"].items():
        groups.setdefault(provenance_sentence(made), []).append(f"twin of {_DATA[key]}" if key in _DATA else _OF[key])
    for said, inputs in groups.items():
        yield f"- {'; '.join(inputs)}: {said}"
    if len({made["digests"]["method"] for made in told["inputs"].values()}) > 1:
        yield "\nNot all of these are of the same code of the method: compare them with care."


def _seeds(told: Mapping[str, Any], data: str) -> int:
    return len(told["inputs"][data]["seeds"])


def _and(seeds: Sequence[int]) -> str:
    """Two seeds or more."""
    *others, last = map(str, seeds)
    return f"{', '.join(others)} and {last}"


def _listed(seeds: Sequence[int]) -> str:
    """Seeds in few words: those at which nothing could be built are missing in between."""
    whole = len(seeds) == seeds[-1] - seeds[0] + 1
    return f"{seeds[0]} to {seeds[-1]}" if whole and len(seeds) > 2 else ", ".join(map(str, seeds))


def _said(ends: Sequence[float | None]) -> str:
    """A PCP and its interval."""
    pcp, low, high = ends
    return f"{pcp:.1f}" if low is None else f"{pcp:.1f} ({low:.1f} to {high:.1f})"


def _against(ends: Sequence[float | None] | None) -> str:
    """A difference and its interval, with signs."""
    if ends is None:
        return ""
    points, low, high = (None if end is None else _signed(end) for end in ends)
    return f"{points}" if low is None else f"{points} ({low} to {high})"


def _signed(points: float) -> str:
    text = f"{points:+.1f}"
    return text if float(text) else "0.0"
