"""The command line: ``simharness run``, ``render``, ``evaluate`` and ``fit-detector``.

Exit codes: 0 fine, 2 bad input (one message on stderr), 3 the run itself failed (with its traceback).
Nothing heavy is imported before a command needs it.
"""

from __future__ import annotations

import contextlib
import enum
import json
import os
import shlex
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.text import Text

if TYPE_CHECKING:
    from rich.table import Table

BAD_INPUT = 2
FAILED = 3


class HeadMapping(enum.StrEnum):
    """The published rules of :func:`mvpose.skeleton.coco17_to_shelf14`."""

    VOXELPOSE = "voxelpose"
    Y2019 = "2019"


app = typer.Typer(
    name="simharness",
    help="Film simulated people with simulated cameras, and find where a multi-view pose method breaks.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
evaluating = typer.Typer(no_args_is_help=True, help="Score the method on real data.")
app.add_typer(evaluating, name="evaluate")
fitting = typer.Typer(no_args_is_help=True, help="Measure a real detector and write the profile that errs as it does.")
app.add_typer(fitting, name="fit-detector")


def main() -> None:
    """Entry point of the console script."""
    app()


def _version(wanted: bool) -> None:
    if wanted:
        from simharness.scenario.load import code_version

        typer.echo(f"simharness {code_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Film simulated people with simulated cameras, and find where a multi-view pose method breaks."""


@app.command()
def run(
    scenario: Annotated[Path, typer.Argument(help="The scenario file, TOML.", metavar="SCENARIO")],
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key: [cyan]people.count=6[/]. Repeatable."),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Replace the scenario's seed.")] = None,
    workers: Annotated[
        int,
        typer.Option(metavar="N", min=1, help="Processes that share the frames. The results are the same."),
    ] = 1,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the result folder goes.", file_okay=False)] = Path(
        "results/runs"
    ),
) -> None:
    """Run a scenario: simulate, film, detect, estimate, score, report.

    The results appear, when whole, in a folder NAME-HASH: report.html for people, the rest for programs.
    """
    with _border():
        from simharness.experiment.progress import reporter
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)  # before the slow imports, to answer at once
        from simharness.experiment.run import run as run_scenario

        command = shlex.join(["simharness", *sys.argv[1:]])
        with reporter() as bars:
            folder = run_scenario(loaded, out=out, workers=workers, reporter=bars, command=command)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    console = Console()
    console.print(_headline(summary))
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False, markup=False)


@app.command()
def render(
    scenario: Annotated[Path, typer.Argument(help="The scenario file, TOML.", metavar="SCENARIO")],
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key: [cyan]room.floor=wood[/]. Repeatable."),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Replace the scenario's seed.")] = None,
    video: Annotated[bool, typer.Option("--video", help="MP4 films instead of PNG pictures.")] = False,
    overlay: Annotated[
        str,
        typer.Option(metavar="LAYERS", help="Draw in [cyan]truth[/], [cyan]detections[/], [cyan]estimates[/]: a list."),
    ] = "",
    also: Annotated[
        str,
        typer.Option(metavar="CHANNELS", help="Write [cyan]depth[/], [cyan]ids[/], [cyan]parts[/] too: a list."),
    ] = "",
    every: Annotated[int, typer.Option(metavar="N", help="Render one frame of N.")] = 1,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the folder NAME goes.", file_okay=False)] = Path(
        "results/renders"
    ),
) -> None:
    """Render what the cameras of a scenario record, and a mosaic of them all.

    The pictures appear, when whole, in FOLDER/NAME: CAMERA/0000.png, ... or CAMERA.mp4, and mosaic.
    """
    with _border():
        from simharness.experiment.progress import reporter
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.experiment.footage import Footage
        from simharness.experiment.footage import render as render_scenario

        layers, channels = (frozenset(filter(None, map(str.strip, given.split(",")))) for given in (overlay, also))
        footage = Footage(video=video, overlay=layers, channels=channels, every=every)
        with reporter() as bars:
            folder = render_scenario(loaded, footage, out=out, reporter=bars)
    typer.echo(f"{len(list(folder.rglob('*.*')))} files in {folder}")


@evaluating.command()
def shelf(
    folder: Annotated[Path, typer.Argument(help="The published files.", metavar="FOLDER")],
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write the summary there too.", dir_okay=False),
    ] = None,
    head: Annotated[
        HeadMapping,
        typer.Option(help="How the head of the 14 joints is made from COCO's: moves PCP by a point."),
    ] = HeadMapping.VOXELPOSE,
    method: Annotated[
        list[str] | None,
        typer.Option(metavar="VARIANT", help="A preset of mvpose.Pipeline. Repeatable. [dim]\\[default: full][/]"),
    ] = None,
) -> None:
    """Shelf: PCP of actors 1 to 3 on frames 300 to 599, and what PCP does not see.

    FOLDER holds calibration_shelf.json, actorsGT.mat and openpose/.
    """
    with _border():
        from mvpose import Pipeline
        from mvpose.pipeline import NEED_DESCRIPTORS
        from simharness.datasets.evaluate import evaluate, print_evaluation
        from simharness.datasets.shelf import read_shelf
        from simharness.experiment.progress import reporter

        pipelines = {name: Pipeline.preset(name) for name in method or ["full"]}
        if blind := NEED_DESCRIPTORS & pipelines.keys():
            raise ValueError(
                f"--method {', '.join(blind)}: goes by descriptors alone, and the detections of Shelf carry none; "
                "choose another variant"
            )
        data = read_shelf(folder)
        with (
            _after_reading(),
            reporter() as bars,
            bars.stage("evaluate", len(data) * len(pipelines)) as advance,
        ):
            evaluation = evaluate(data, pipelines, head=head.value, progress=lambda *_: advance(1))
        if json_file is not None:
            _write_json(evaluation.summary(), json_file)
    print_evaluation(evaluation, Console())


@evaluating.command()
def twin(
    folder: Annotated[Path, typer.Argument(help="The published files of Shelf.", metavar="FOLDER")],
    scenario: Annotated[
        Path | None,
        typer.Option(
            metavar="SCENARIO", help="The simulated twin. [dim]\\[default: scenarios/shelf.toml][/]", dir_okay=False
        ),
    ] = None,
    twins: Annotated[int, typer.Option(metavar="N", min=2, help="How many twins, of different seeds.")] = 10,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write everything there too.", dir_okay=False),
    ] = None,
) -> None:
    """Shelf beside its simulated twin: PCP of the scenario's variants in reality and in simulation, with intervals."""
    with _border():
        from simharness.datasets.shelf import read_shelf
        from simharness.experiment.progress import reporter
        from simharness.experiment.twin import compare, print_comparison
        from simharness.scenario.load import load
        from simharness.scenario.profiles import SHIPPED

        loaded, recorded = load(scenario or SHIPPED.parent / "shelf.toml"), read_shelf(folder)
        with reporter() as bars, bars.stage("compare", 1 + twins) as advance:
            comparison = compare(recorded, loaded, count=twins, progress=advance)
        if json_file is not None:
            _write_json(comparison.summary(), json_file)
    print_comparison(comparison, Console())


@evaluating.command("seeds")
def evaluate_seeds(
    scenario: Annotated[Path, typer.Argument(help="The scenario file, TOML.", metavar="SCENARIO")],
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key: [cyan]people.count=6[/]. Repeatable."),
    ] = None,
    seeds: Annotated[int, typer.Option(metavar="N", min=2, help="How many seeds.")] = 10,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write everything there too.", dir_okay=False),
    ] = None,
) -> None:
    """A scenario at many seeds: PCP of its variants, everybody's and each person's, with intervals."""
    with _border():
        from simharness.experiment.progress import reporter
        from simharness.experiment.seeds import evaluate_seeds as evaluate_at
        from simharness.experiment.seeds import print_seeds
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or ())
        with reporter() as bars, bars.stage("evaluate", seeds) as advance:
            result = evaluate_at(loaded, seeds, progress=advance)
        if json_file is not None:
            _write_json(result.summary(), json_file)
    print_seeds(result, Console())


@fitting.command("shelf")
def fit_shelf(
    folder: Annotated[Path, typer.Argument(help="The published files.", metavar="FOLDER")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the profile there, a TOML file.", dir_okay=False)
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a PNG there: measured beside its simulated twin.", dir_okay=False),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all figures there.", dir_okay=False)
    ] = None,
) -> None:
    """Shelf: OpenPose on frames 300 to 599 against the published truth.

    FOLDER holds calibration_shelf.json, actorsGT.mat and openpose/.
    """
    with _border():
        from simharness.datasets.shelf import read_shelf
        from simharness.detector.fitting.fit import fit, twin_of, write_profile
        from simharness.detector.fitting.plot import plot_comparison
        from simharness.detector.fitting.sample import of_shelf
        from simharness.detector.fitting.table import print_agreement, print_measurement

        sample = of_shelf(read_shelf(folder))
        fitted = fit(sample, command="simharness fit-detector shelf FOLDER --out FILE")
        if out is not None:
            write_profile(fitted, out)
        print_measurement(fitted.real, Console())
        summary = {"real": fitted.real.summary()}
        if figure is not None:
            with _after_reading():
                simulated = twin_of(fitted, sample)
            plot_comparison([fitted.real, simulated], figure)
            print_agreement(fitted.real, simulated, Console())
            summary["simulated"] = simulated.summary()
        if json_file is not None:
            _write_json(summary, json_file)


def _write_json(summary: dict[str, Any], path: Path) -> None:
    """By rename: a file that is there is whole."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise ValueError(f"--json {path}: cannot be written: {error.strerror}") from None


def _headline(summary: dict[str, Any]) -> Table:
    """The headline numbers of a run, a row for each variant."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from simharness.experiment.headline import COLUMNS

    title = f"{summary['name']}: {summary['frames']} frames, seed {summary['seed']}"
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, show_edge=False)
    table.add_column("variant", no_wrap=True)
    for column in COLUMNS:
        heading = f"{column.title}\n{column.unit}" if column.unit else column.title.replace(" ", "\n")
        table.add_column(heading, justify="right", no_wrap=True)
    for name, scores in summary["variants"].items():
        table.add_row(name, *(column.number(scores) for column in COLUMNS))
    return table


@contextlib.contextmanager
def _border() -> Iterator[None]:
    """Where errors become exit codes.

    A ValueError that gets here is the input's fault, for whatever works on checked input raises a RunError
    instead: :func:`simharness.experiment.run.run` and :func:`_after_reading` see to that.
    """
    console = Console(stderr=True)
    try:
        yield
    except ValueError as error:
        console.print(Text.assemble(("error: ", "bold red"), str(error)), soft_wrap=True)
        raise typer.Exit(BAD_INPUT) from None
    except (typer.Exit, typer.Abort):
        raise
    except Exception as error:
        traceback.print_exc()
        console.print(Text.assemble(("the run failed: ", "bold red"), str(error)), soft_wrap=True)
        raise typer.Exit(FAILED) from None


@contextlib.contextmanager
def _after_reading() -> Iterator[None]:
    """From here on, an error is not the input's fault."""
    from simharness.experiment.execution import RunError

    try:
        yield
    except Exception as error:
        raise RunError(f"{type(error).__name__}: {error}") from error


if __name__ == "__main__":
    main()
