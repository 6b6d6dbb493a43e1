"""``simharness hunt``: a search for failures, each shrunk and kept."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import check_place
from simharness.cli.program import PROGRAM, Overrides, ScenarioFile, Workers
from simharness.cli.shrink_command import Checked

if TYPE_CHECKING:
    from simharness.hunt.hunt_run import HuntedPoint
    from simharness.hunt.kept_failure import KeptFailure

_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}


@grouped()
def hunt(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    budget: str | None = option(
        None, "Time of the search: [cyan]90s[/], [cyan]30m[/], [cyan]2h[/]. [dim]\\[default: 30m][/]", metavar="TIME"
    ),
    trials: int | None = option(None, "Number of trials. [dim]\\[default: until --budget is over][/]", min=1),
    seed: int = option(0, "Seed of the search.", metavar="N", min=0),
    most: int = option(10, "Largest number of kept failures.", "--keep", metavar="N", min=0),
    workers: Workers = 1,
    out: Path = option(
        Path("results/hunts"), "Folder in which the hunt gets a folder with the name of the scenario.", file_okay=False
    ),
    *,
    checked: Checked,
) -> None:
    r"""Hunt for failures: search the ranges of the section \[search] of a scenario for trials in which something fails.

    A failure counts if it comes back with most fresh draws of the detector's
    errors. One of each kind and stage to blame is shrunk, printed and kept.
    The same command continues an interrupted hunt.
    """
    with PROGRAM.exit_on_error():
        from mvpose.commands.progress import reporter
        from simharness.hunt.hunt_run import TRIALS, Hunt, run_hunt
        from simharness.hunt.kept_failure import check_alone
        from simharness.hunt.properties import properties_of
        from simharness.outputs.hunt.page import write_failures_page
        from simharness.scenario.load import read_plan
        from simharness.trial.run_trial import with_variants

        seconds, wanted = _seconds(budget, trials), properties_of(checked.property, checked.rival)
        plan = read_plan(scenario, overrides=overrides or ())
        chosen = checked.variant or plan.base.method.variants[0]
        check_alone(with_variants(plan.base, [chosen]))
        names, folder = (chosen, checked.rival) if checked.rival else (chosen,), out / plan.base.name
        check_place(folder / TRIALS, option="--out", mark=b'"properties": ')
        limits: dict[str, Any] = {"trials": trials, "keep_most": most, "workers": workers}
        with reporter() as bars:
            points, kept = run_hunt(Hunt(plan, names, wanted, seed), folder, seconds=seconds, reporter=bars, **limits)
        page = write_failures_page(folder / "failures") if kept else None
    _print(points, kept, Console(), f"{plan.base.name}, {chosen}")
    if page is not None:
        Console().print(f"page: {page}", soft_wrap=True, highlight=False, markup=False)


def _seconds(budget: str | None, trials: int | None) -> float | None:
    """Return the time of the search, seconds; None where the number of trials ends it.

    Raises:
        ValueError: the budget is no time.
    """
    if budget is None and trials is not None:
        return None
    if not (match := re.fullmatch(r"(\d+(?:\.\d+)?)([smh])", budget or "30m")):
        raise ValueError(f"--budget {budget}: expected a time such as 90s, 30m or 2h")
    return float(match[1]) * _UNITS[match[2]]


def _print(points: "list[HuntedPoint]", kept: "list[KeptFailure]", console: Console, what: str) -> None:
    """Print the kinds of failures with their numbers, and what each kept one is."""
    from simharness.cli.score_tables import ScoreTable
    from simharness.hunt.hunt_run import distinct
    from simharness.hunt.hunted_trial import NOISES

    cells = distinct(points, lambda each: each.cell)
    rows = []
    for (name, stage), (_, best) in sorted(distinct(points, lambda each: each.cell[:2]).items()):
        alike = sum(cell[:2] == (name, stage) for cell in cells)
        robust = ({each.cell[:2] for each in point.findings if each.robust} for point in points)
        trials = sum((name, stage) in each for each in robust)
        rows.append((name, stage or "–", str(trials), str(alike), f"{best.failed} of {NOISES}"))
    failed = sum(bool(point.error) for point in points)
    lost = f", {failed} of which could not be run" if failed else ""
    console.print(f"{what}: {len(cells)} distinct failures in {len(points)} trials{lost}", highlight=False)
    headings = ("trials", "distinct", "fails with\nfresh noise")
    ScoreTable("", ("property", "stage"), headings, rows).print_to(console)
    for each in kept:
        console.print(f"{each.name}: {each.text}", soft_wrap=True, highlight=False, markup=False)
