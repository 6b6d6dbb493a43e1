"""``simharness blame``: what cost a scenario its score, cause by cause."""

from typing import TYPE_CHECKING

from rich.console import Console

from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import check_place, write_json
from mvpose.commands.progress import reporter
from simharness.cli.program import PROGRAM, JsonFile, Overrides, ScenarioFile, Seed, Workers

if TYPE_CHECKING:
    from simharness.study.causes.cause_shares import Blame


@grouped()
def blame(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
    seeds: int = option(10, "Number of seeds.", metavar="N", min=1),
    variant: str | None = option(
        None, "A preset such as [cyan]fast[/], instead of the scenario's first variant.", metavar="VARIANT"
    ),
    score: str = option("pcp", "Score to explain: [cyan]pcp[/], [cyan]recall[/], [cyan]mpjpe_mm[/].", metavar="SCORE"),
    cause: list[str] | None = option(
        None, "Only this cause: [cyan]swaps[/], [cyan]noise[/]. Repeatable. [dim]\\[default: all][/]", metavar="CAUSE"
    ),
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
