"""``simharness run``, ``render`` and ``export``: one scenario as a report, as pictures or as a benchmark sequence."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import say
from simharness.cli.program import PROGRAM, BlameSeeds, Overrides, ScenarioFile, Seed, Workers

if TYPE_CHECKING:
    from simharness.cli.score_tables import ScoreTable
    from simharness.outputs.run.headline import Column


@grouped()
def run(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
    workers: Workers = 1,
    out: Path = option(
        Path("results/runs"), "Folder in which the result folder NAME-HASH appears.", metavar="FOLDER", file_okay=False
    ),
    blame: BlameSeeds = 0,
) -> None:
    """Run a scenario: simulate, film, detect, estimate, score, report.

    Prints a table of scores and the path of the report, a page for the
    browser. Files for programs are beside it.
    """
    with PROGRAM.exit_on_error():
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        # After slow imports, mistakes would not be reported at once.
        from simharness.outputs.run.result_folder import run as run_scenario

        command = PROGRAM.command_line()
        with reporter() as bars:
            folder = run_scenario(loaded, out=out, workers=workers, reporter=bars, command=command, blame_seeds=blame)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    console = Console()
    for table in _tables(summary):
        table.print_to(console)
    if blame:
        from simharness.cli.blame_command import print_blame
        from simharness.study.causes.blame_text import read_blame

        if found := read_blame(folder):
            print_blame(found, console)
    say(f"report: {folder / 'report.html'}")


@grouped()
def render(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
    video: bool = option(False, "Write MP4 films instead of PNG pictures.", "--video"),
    overlay: str = option(
        "", "Draw [cyan]truth,detections,estimates[/], or some of them, into the pictures.", metavar="LAYERS"
    ),
    also: str = option("", "Also write [cyan]depth,ids,parts[/], or some of them.", metavar="CHANNELS"),
    every: int = option(1, "Render every Nth frame only.", metavar="N"),
    out: Path = option(
        Path("results/renders"),
        "Folder in which the pictures get a folder with the name of the scenario.",
        metavar="FOLDER",
        file_okay=False,
    ),
) -> None:
    """Render the pictures of all cameras of a scenario, and a mosaic of them.

    The files appear in FOLDER/NAME when they are complete: CAMERA/0000.png, ...
    or CAMERA.mp4, and a mosaic of all cameras.
    """
    with PROGRAM.exit_on_error():
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.outputs.benchmark.render import RenderPlan
        from simharness.outputs.benchmark.render import render as render_scenario

        layers, channels = (frozenset(filter(None, map(str.strip, given.split(",")))) for given in (overlay, also))
        plan = RenderPlan(video=video, overlay=layers, channels=channels, every=every)
        with reporter() as bars:
            folder = render_scenario(loaded, plan, out=out, reporter=bars)
    typer.echo(f"{len(list(folder.rglob('*.*')))} files in {folder}")


def _tables(summary: Mapping[str, Any]) -> "list[ScoreTable]":
    """Return the headline scores of a run, and those of identities, and of feet and hands, where there are any."""
    from simharness.outputs.run.headline import COLUMNS, scored_columns
    from simharness.outputs.run.identity_plots import IDENTITY_COLUMNS, has_identities
    from simharness.scoring.feet_and_hands import WHOLE_BODY_SCORES

    variants: Mapping[str, Any] = summary["variants"]
    title = f"{summary['name']}: {summary['frames']} frames, seed {summary['seed']}"
    tables = [_table(title, COLUMNS, variants)]
    if tracked := {name: scores for name, scores in variants.items() if has_identities(scores)}:
        tables.append(_table("identities, within 0.5 m", IDENTITY_COLUMNS, tracked))
    if columns := scored_columns(summary, WHOLE_BODY_SCORES):
        tables.append(_table("feet and hands", columns, variants))
    return tables


def _table(title: str, columns: "Sequence[Column]", variants: Mapping[str, Any]) -> "ScoreTable":
    """Return a table of scores, a row for each variant."""
    from simharness.cli.score_tables import ScoreTable

    headings = [f"{each.title}\n{each.unit}" if each.unit else each.title.replace(" ", "\n") for each in columns]
    rows = [(name, *(column.number(scores) for column in columns)) for name, scores in variants.items()]
    return ScoreTable(title, ("variant",), headings, rows)


@grouped()
def export(
    scenario: ScenarioFile,
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder in which the sequence gets a folder with the name of the scenario.", metavar="FOLDER"
        ),
    ] = Path("results/exports"),
    overrides: Overrides = None,
    seed: Seed = None,
    every: int = option(1, "Write every Nth frame only.", metavar="N"),
    pictures: bool = option(True, "Write the pictures.", "--pictures/--no-pictures"),
    also: str = option(
        "",
        "Also write [cyan]depth,ids,parts[/], and true keypoints as [cyan]coco,visibility,heatmaps[/], or some.",
        metavar="FILES",
    ),
    sequences: int | None = option(
        None,
        "Write so many sequences, of the seed and the following ones, and describe them all. Those that are there are "
        "kept.",
        metavar="N",
        min=1,
        max=100_000,
    ),
    workers: Workers = 1,
) -> None:
    """Write a scenario as a benchmark in the layout of CMU Panoptic: pictures, truth, calibration, detections.

    The detections are OpenPose files. The sequence appears in FOLDER/NAME when
    it is complete, and replaces an earlier export; manifest.json describes it.
    With --sequences NAME holds one for each seed, with splits and checksums.
    """
    with PROGRAM.exit_on_error():
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
        from simharness.outputs.benchmark.sequences import export_benchmark

        if sequences is None and given("workers"):
            raise ValueError("--workers: share sequences; give --sequences as well")
        wanted = frozenset(filter(None, map(str.strip, also.split(","))))
        plan = partial(ExportPlan, every=every, pictures=pictures, also=wanted)
        command, made = PROGRAM.command_line(), folder / loaded.name
        with reporter() as bars:
            if sequences is None:
                export_sequence(loaded, plan(made), reporter=bars, command=command)
            else:
                done = export_benchmark(
                    loaded, made, plan, sequences=sequences, workers=workers, reporter=bars, command=command
                )
                typer.echo(f"{done.made} sequences written, {done.kept} kept")
                for number, reason in done.impossible.items():
                    note(f"seed {number} is left out: {reason}")
    files = [file for file in made.rglob("*") if file.is_file()]
    megabytes = sum(file.stat().st_size for file in files) / 1e6
    typer.echo(f"{len(files)} files, {megabytes:.1f} MB, in {made}")
