"""``simharness blame``: what cost a scenario its score, cause by cause."""

from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from mvpose.commands.output_files import check_place, write_json
from simharness.cli.program import PROGRAM, JsonFile, Overrides, ScenarioFile, Seed, Workers

if TYPE_CHECKING:
    from simharness.study.causes.cause_shares import Blame


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(blame)


def blame(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
    seeds: Annotated[int, typer.Option(metavar="N", min=1, help="Number of seeds.")] = 10,
    variant: Annotated[
        str | None,
        typer.Option(
            metavar="VARIANT", help="A preset such as [cyan]fast[/], instead of the scenario's first variant."
        ),
    ] = None,
    score: Annotated[
        str, typer.Option(metavar="SCORE", help="Score to explain: [cyan]pcp[/], [cyan]recall[/], [cyan]mpjpe_mm[/].")
    ] = "pcp",
    cause: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CAUSE",
            help="Only this cause: [cyan]swaps[/], [cyan]noise[/]. Repeatable. [dim]\\[default: all][/]",
        ),
    ] = None,
    workers: Workers = 1,
    json_file: JsonFile = None,
) -> None:
    """Find what cost a scenario its score, and what to mend first.

    The scenario is simulated again with causes removed ("mended"), one by one
    and together: errors of the detector, what hides people, calibration,
    clocks, matching, and one camera too few. Each gets its share of the loss.
    """
    with PROGRAM.exit_on_error():
        check_place(json_file, option="--json", mark=b'"shares"')
        from mvpose.commands.progress import reporter
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.study.causes.cause_shares import blame as find_blame

        setting = ", ".join(overrides or ())
        with reporter() as bars:
            found = find_blame(
                loaded,
                variant=variant,
                seeds=seeds,
                score=score,
                causes=cause,
                setting=setting,
                workers=workers,
                reporter=bars,
            )
        if json_file is not None:
            write_json(found.json(), json_file)
    print_blame(found, Console())


def print_blame(blame: "Blame", console: Console) -> None:
    """Print what cost a scenario its score: a row for each cause, and what to mend first."""
    from simharness.cli.score_tables import ScoreTable
    from simharness.study.causes.blame_text import conclusion, heading, points, surest

    rows = [(each.about.title, points(each.share), points(each.alone)) for each in blame.shares]
    rows.append(("no cause here", points(blame.rest), "–"))
    seeds = f"{len(blame.seeds)} seed{'' if len(blame.seeds) == 1 else 's'}"
    title = f"{blame.scenario}, {blame.variant}, {seeds}: {heading(blame)}"
    ScoreTable(title, ("cause",), ("share of the\nloss, points", "gain if mended\nalone, points"), rows).print_to(
        console
    )
    console.print(f"{conclusion(blame)} {surest(blame)}".strip(), highlight=False, markup=False)
