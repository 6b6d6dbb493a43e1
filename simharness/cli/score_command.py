"""``simharness score``: people in files, against the exact truth of an exported sequence or benchmark."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console

from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import PROVENANCE, check_place, write_json
from simharness.cli.program import PROGRAM, JsonFile, made_here

_OVER_TIME = ("hota", "idf1")


@grouped()
def score(
    predictions: Annotated[
        Path,
        typer.Argument(
            help="People over time: Panoptic, NPZ, TRC, C3D, JSON, Parquet. For a benchmark a folder with a file or "
            "folder for each sequence, of its name.",
            metavar="PREDICTIONS",
        ),
    ],
    benchmark: Annotated[Path, typer.Argument(help="A folder of [cyan]simharness export[/].", metavar="BENCHMARK")],
    split: str | None = option(None, "Score only [cyan]train[/], [cyan]val[/] or [cyan]test[/].", metavar="SPLIT"),
    json_file: JsonFile = None,
) -> None:
    """Score people in files against the exact truth of an exported sequence, or of all sequences of a benchmark.

    Prints means over sequences with 95 % intervals, of all and of each split.
    """
    with PROGRAM.exit_on_error():
        start = perf_counter()
        check_place(json_file, option="--json", mark=PROVENANCE)
        from simharness.cli.score_tables import ScoreTable, mean_cell
        from simharness.outputs.benchmark.submission import score_submission
        from simharness.scoring.catalogue import HEADLINE, SCORES

        result = score_submission(predictions, benchmark, split=split)
        keys = [key for key in (*HEADLINE, "map", *_OVER_TIME) if any(each is not None for each in result.of("", key))]
        rows = []
        for name in ("", *sorted(set(result.splits.values()))):
            count = len(result.of(name, keys[0]))
            cells = [mean_cell(result.of(name, key), SCORES[key]) for key in keys]
            rows.append((name or "all", str(count), *cells))
        if json_file is not None:
            made = made_here(start, seeds=(), variants=())
            write_json({**made, "scores": result.scores, "splits": result.splits}, json_file)
    heads = [f"{SCORES[key].title}\n{SCORES[key].unit}" for key in keys]
    ScoreTable(f"{predictions} on {benchmark}", ("split", "sequences"), heads, rows).print_to(Console())
