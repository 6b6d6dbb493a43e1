"""Tables of scores in a terminal: of runs and studies, of evaluations, of a recording beside its twin.

A table that is wider than the terminal is divided, and nothing is cut.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.box import Box
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mvpose.commands.terminal import plain_table
from simharness.scoring.catalogue import ScoreInfo
from simharness.scoring.pcp import GROUPS
from simharness.scoring.score_summary import STAGES
from simharness.scoring.tracking.identity_figures import DISTANCE
from simharness.statistics.intervals import mean_interval

if TYPE_CHECKING:
    from simharness.reality.evaluation import Evaluation, PublishedPcp

_UNLIMITED = 10_000  # columns of a terminal in which everything fits


@dataclass(frozen=True)
class ScoreTable:
    """Scores by row."""

    title: str
    """Title above the table."""
    labels: Sequence[str]
    """Headings of the columns that name a row."""
    scores: Sequence[str]
    """Headings of the columns of scores."""
    rows: Sequence[Sequence[str]]
    """Cells of every row: its labels, then its scores; a cell or a heading may have several lines."""

    def print_to(self, console: Console) -> None:
        """Print the table; where it does not fit, the scores that follow are in another table below, with the labels.

        Labels that leave no room for a single score are broken into lines.
        """
        unlimited = console.options.update(width=_UNLIMITED)
        start = 0
        while start < len(self.scores):
            end = len(self.scores)
            while (
                end > start + 1 and console.measure(self._part(start, end), options=unlimited).maximum > console.width
            ):
                end -= 1
            console.print(self._part(start, end))
            start = end

    def _part(self, start: int, end: int) -> Table:
        """Return the table with the scores from ``start`` up to ``end``."""
        title = f"{self.title}, continued" if start else self.title
        table = plain_table(title, (), (), pad_edge=False, padding=(0, 1, 0, 0))
        for label in self.labels:
            table.add_column(Text(label), overflow="fold")
        for score in self.scores[start:end]:
            table.add_column(Text(score), justify="right", no_wrap=True)
        count = len(self.labels)
        for row in self.rows:
            table.add_row(*map(Text, (*row[:count], *row[count + start : count + end])))
        return table


def mean_cell(values: Sequence[float | None], score: ScoreInfo) -> str:
    """Return the text of the mean of a score over scenes, with the ends of its interval below."""
    interval, digits = mean_interval(values, unit=score.unit), score.digits
    if not interval.n:
        return "–"
    # The ends stand on two lines, because six scores with intervals on one line do not fit 80 columns.
    ends = f"\n{interval.low:.{digits}f}–\n{interval.high:.{digits}f}" if interval.n > 1 else ""
    return f"{interval.mean:.{digits}f}{ends}"


_ONLY_ANNOTATED = (
    " Identities: IDR, people with the estimate of their identity within 0.5 m. There is no HOTA and no IDF1: they "
    "would count estimates of people who are not annotated as false."
)
_PAPER_ACTORS = (0, 1, 2)  # of Campus and Shelf, by tables 1 and 2


def print_evaluation(evaluation: "Evaluation", console: Console) -> None:
    """Print PCP by actor and part beside that of the paper, errors that PCP ignores, and the time per stage."""
    summaries = evaluation.summary()["variants"]
    headline = Text.assemble(
        (evaluation.name, "bold"),
        f"  {evaluation.frames} frames, {evaluation.annotated} of them annotated; head mapping ",
        (evaluation.head, "bold"),
    )
    tracked = {name: [each["tracking"]] for name, each in summaries.items() if "tracking" in each}
    tables = [_pcp_table(name, evaluation) for name in evaluation.variants]
    numbers = ", ".join(str(actor + 1) for actor in evaluation.actors)
    paper = "Paper: Dong et al. 2019, with their detections and the 2019 head." if _paper(evaluation) else ""
    notes = Text(
        f"PCP: part correct within 0.5 of its length; average of actors {numbers}; ignores ghosts. {paper}\n"
        "One-to-one: pairs under 500 mm. An estimate of a person who is not annotated in a frame counts as a ghost. "
        "Same view: detections that share an estimate with another detection of their view."
        f"{_ONLY_ANNOTATED if tracked else ''}",
        style="dim",
    )
    blocks: list[RenderableType] = [
        headline,
        *tables,
        *([_variants_table(evaluation)] if len(tables) > 1 else []),
        _people_table(summaries),
        *([_identities_table(tracked)] if tracked else []),
        *([_time_table(summaries)] if any(map(any, (each.timings for each in evaluation.variants.values()))) else []),
        notes,
    ]
    console.print(Group(*(Padding(block, (0, 0, 1, 0)) for block in blocks)))


def _paper(evaluation: "Evaluation") -> "Mapping[str, PublishedPcp]":
    """Return the published scores by variant; of other recordings none."""
    from simharness.reality.evaluation import ABLATION

    return ABLATION.get(evaluation.name, {}) if evaluation.actors == _PAPER_ACTORS else {}


def _pcp_table(name: str, evaluation: "Evaluation") -> Table:
    scores, actors = evaluation.variants[name], evaluation.actors
    table = _table(f"PCP, {name}", "actor", [group.replace("_", " ") for group in GROUPS])
    table.add_column("all", justify="right", style="bold")
    published = _paper(evaluation).get(name)
    if published:
        table.add_column("paper", justify="right", style="cyan")
    rows = scores.pcp_table(actors=actors)
    summary = scores.summary(actors=actors)
    rows.append({**summary["pcp_parts"], "all": summary["pcp"]})
    labels = [*(str(actor + 1) for actor in actors), "average"]
    for index, (label, row) in enumerate(zip(labels, rows, strict=True)):
        last = index == len(rows) - 1
        cells = [_number(value, 1) for value in row.values()]
        cells += [_number(published[index], 1)] if published else []
        table.add_row(label, *cells, style="bold" if last else "", end_section=index == len(rows) - 2)
    return table


def _variants_table(evaluation: "Evaluation") -> Table:
    """Return the PCP of all actors with a row for each variant, followed by the row of the paper if it has one."""
    table = _table("PCP of the variants", "variant", [f"actor {actor + 1}" for actor in evaluation.actors])
    table.add_column("average", justify="right", style="bold")
    for name, scores in evaluation.summary()["variants"].items():
        table.add_row(name, *(_number(value, 1) for value in (*scores["pcp_actors"], scores["pcp"])))
        if published := _paper(evaluation).get(name):
            table.add_row("  paper", *(_number(value, 1) for value in published), style="cyan not bold")
    return table


def _people_table(summaries: Mapping[str, Any]) -> Table:
    columns = ("precision", "recall", "ghosts", "missed", "mean", "median", "same view")
    table = _table("People, one-to-one: %, people per frame, and MPJPE in mm", "variant", columns)
    for name, scores in summaries.items():
        shares = (_number(scores[key], 1, scale=100) for key in ("precision", "recall"))
        counts = (_number(scores[key], 2) for key in ("ghosts_per_frame", "missed_per_frame"))
        errors = (_number(scores["mpjpe_mm"][key], 1) for key in ("mean", "median"))
        table.add_row(name, *shares, *counts, *errors, _number(scores["same_view_violations"], 0))
    return table


def _identities_table(tracked: Mapping[str, Sequence[Mapping[str, Any]]]) -> Table:
    """Return the scores of identities by variant, means over its recordings."""
    columns = ("PCP", "IDR", "MPJPE", "switches", "a minute", "interrupted")
    table = _table("Identities of annotated people: PCP and IDR in %, MPJPE in mm", "variant", columns)
    for name, recordings in tracked.items():
        at = [each["mean_joint"][f"{DISTANCE:g}"] for each in recordings]
        counted = 0 if len(recordings) == 1 else 1  # decimals: means of counts are no whole numbers
        table.add_row(
            name,
            _number(_mean(recordings, "pcp_tracked"), 1),
            _number(_mean(at, "idr"), 1, scale=100),
            _number(_mean(recordings, "mpjpe_tracked_mm"), 1),
            _number(_mean(at, "id_switches"), counted),
            _number(_mean(at, "switches_per_minute"), 2),
            _number(_mean(at, "interruptions"), counted),
        )
    return table


def _mean(figures: Sequence[Mapping[str, Any]], key: str) -> float | None:
    """Return the mean of a figure over the recordings that have it."""
    known = [each[key] for each in figures if each[key] is not None]
    return sum(known) / len(known) if known else None


def _time_table(summaries: Mapping[str, Any]) -> Table:
    table = _table("Time per frame, ms: median (99th percentile)", "variant", STAGES)
    for name, scores in summaries.items():
        times = (scores["timings_ms"][stage] for stage in STAGES)
        table.add_row(name, *(f"{_number(time['median'], 2)} ({_number(time['p99'], 2)})" for time in times))
    return table


_RULES = Box("    \n    \n ── \n    \n ── \n ── \n    \n    \n")  # a rule under the header and between sections


def _table(title: str, first: str, columns: Sequence[str], *, box: Box = _RULES) -> Table:
    table = plain_table(title, (), (), box=box, pad_edge=False)
    table.add_column(first, min_width=8, no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True, style="bold" if column == "total" else "")
    return table


def _number(value: float | None, digits: int, *, scale: float = 1.0) -> str:
    return "–" if value is None else f"{scale * value:.{digits}f}"
