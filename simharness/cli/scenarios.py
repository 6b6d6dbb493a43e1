"""``simharness scenarios``, ``show`` and ``schema``: what scenario files there are, and what they say."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simharness.cli.exit_codes import border
from simharness.cli.options import Overrides, ScenarioFile, Seed

if TYPE_CHECKING:
    from rich.table import Table


def add_to(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(scenarios)
    app.command()(show)
    app.command()(schema)


def scenarios() -> None:
    """List what ships: scenarios, and the rigs and detectors that a scenario may begin with."""
    with border():
        from simharness.scenario.presets import PROFILES, RIGS, SCENARIOS, about
        from simharness.scenario.resolution import read_plan

        plans = [read_plan(path) for path in sorted(SCENARIOS.glob("*.toml"))]
        rows = [
            (plan.document.path.stem, plan.base.description, f"{plan.trials:,}" if plan.is_study else "")
            for plan in plans
        ]
        presets = {
            kind: [(path.stem, about(path), "") for path in sorted(kind.shipped.glob("*.toml"))]
            for kind in (RIGS, PROFILES)
        }
    width = max(len(name) for table in (rows, *presets.values()) for name, *_ in table)
    console = Console()
    console.print(_table(f"{_path(SCENARIOS)}/NAME.toml", rows, width, trials=True))
    for kind, table in presets.items():
        console.print()
        console.print(_table(f'[{kind.section}] {kind.key} = "NAME"', table, width))


def show(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
) -> None:
    """Print a scenario with all that it leaves unsaid, as TOML; of a study how many trials it makes, and its base."""
    with border():
        from simharness.scenario.outline import outline
        from simharness.scenario.study_definition import StudyTooLarge, load_study, read_plan

        plan = read_plan(scenario, overrides=overrides or (), seed=seed)
        note = ""
        try:
            load_study(scenario, overrides=overrides or ())
        except StudyTooLarge:
            note = "simharness study asks for --yes before it runs so many trials."
    typer.echo(outline(plan, note), nl=False)


def schema(
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write it there instead of printing it.", dir_okay=False)
    ] = None,
) -> None:
    """Write the JSON schema of scenario files, by which editors complete and check them."""
    with border():
        from simharness.scenario.schema import dumps

        if out is None:
            typer.echo(dumps(), nl=False)
            return
        try:
            out.write_text(dumps(), encoding="utf-8")
        except OSError as error:
            raise ValueError(f"--out {out}: cannot be written: {error.strerror}") from None


def _table(title: str, rows: Sequence[tuple[str, str, str]], width: int, *, trials: bool = False) -> Table:
    """Names ``width`` wide, what they are, and how many trials they make."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, show_edge=False)
    table.add_column("name", min_width=width, no_wrap=True)
    table.add_column("")
    if trials:
        table.add_column("trials", justify="right", no_wrap=True)
    for name, about, count in rows:
        table.add_row(name, Text(about), *([count] if trials else []))
    return table


def _path(path: Path) -> str:
    """Relative to where we are, where it is below."""
    return os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path)
