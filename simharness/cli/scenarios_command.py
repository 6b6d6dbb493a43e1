"""``simharness scenarios``, ``show``, ``schema`` and ``mjcf``: the shipped scenarios, and what is in their files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import check_place, check_writable, write_text
from mvpose.commands.terminal import plain_table, say
from simharness.cli.program import PROGRAM, Overrides, ScenarioFile, Seed

if TYPE_CHECKING:
    from simharness.scenario.load import ScenarioPlan


def scenarios() -> None:
    """List the shipped scenarios, and the rigs and the sensor and detector profiles for your own."""
    with PROGRAM.exit_on_error():
        from simharness.scenario.layers import PROFILES, RIGS, SENSORS
        from simharness.scenario.load import read_plan
        from simharness.scenario.presets import summary_of
        from simharness.scenario.shipped import shipped_folder

        folder = shipped_folder()
        plans = [read_plan(path) for path in sorted(folder.glob("*.toml"))]
        rows = [
            (plan.document.path.stem, plan.base.description, f"{plan.trials:,}" if plan.is_study else "")
            for plan in plans
        ]
        presets = {
            kind: [(path.stem, summary_of(path), "") for path in sorted(kind.shipped.glob("*.toml"))]
            for kind in (RIGS, SENSORS, PROFILES)
        }
    width = max(len(name) for table in (rows, *presets.values()) for name, *_ in table)
    console = Console()
    console.print(_table('simharness run NAME, or extends = "NAME"', rows, width, trials=True))
    for kind, table in presets.items():
        console.print()
        console.print(_table(f'[{kind.section}] {kind.key} = "NAME"', table, width))
    say(f"\nFiles: {_relative(folder)}")


def show(scenario: ScenarioFile, overrides: Overrides = None, seed: Seed = None) -> None:
    """Print a scenario with all keys, defaults and descriptions, and what it needs; of a study also its trials."""
    with PROGRAM.exit_on_error():
        from simharness.scenario.file_model import MOST_TRIALS
        from simharness.scenario.load import StudyTooLarge, load_study, read_plan
        from simharness.scenario.outline import outline

        plan = read_plan(scenario, overrides=overrides or (), seed=seed)
        note = ""
        try:
            load_study(scenario, overrides=overrides or ())
        except StudyTooLarge:
            note = (
                "simharness study needs --yes to run so many trials."
                if plan.most_trials <= MOST_TRIALS
                else f"simharness study runs at most {MOST_TRIALS:,} trials."
            )
        needs = _needs(plan)
    typer.echo(outline(plan, note) + needs, nl=False)


def _needs(plan: "ScenarioPlan") -> str:
    """Return the needs of the base as comments, with which the scenario can still be read; "" for an impossible rig."""
    from simharness.trial.needs import describe, needs_of

    try:
        needs = needs_of(plan.base)
    except ValueError:
        return ""
    return "".join(f"# {line}".rstrip() + "\n" for line in ("", *describe(needs, trials=plan.trials)))


@grouped()
def schema(
    out: Path | None = option(
        None, "Write the schema to this file instead of printing it.", metavar="FILE", dir_okay=False
    ),
) -> None:
    """Print the JSON schema of scenario files, with which editors complete and validate them."""
    with PROGRAM.exit_on_error():
        from simharness.scenario.shipped import shipped_folder

        text = (shipped_folder() / "schema.json").read_text(encoding="utf-8")
        if out is None:
            typer.echo(text, nl=False)
            return
        check_place(out, option="--out", mark=b'"$schema"')
        write_text(text, out)


@grouped()
def mjcf(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    seed: Seed = None,
    out: Path = option(
        Path("results/mjcf"),
        "Folder in which the scene gets a folder with the name of the scenario.",
        metavar="FOLDER",
        file_okay=False,
    ),
) -> None:
    """Write the scene of a scenario, with its people at the first frame and its cameras, as MJCF.

    MuJoCo's viewer opens it: python -m mujoco.viewer --mjcf=FOLDER/NAME/scene.xml
    """
    with PROGRAM.exit_on_error():
        from simharness.outputs.benchmark.mjcf_scene import MJCF, write_mjcf
        from simharness.scenario.load import load
        from simharness.trial.stages.build_trial import true_rig
        from simharness.world.scene.build import build

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        check_writable(out / loaded.name, MJCF)
        rig = true_rig(loaded)
        file = write_mjcf(build(loaded, rig), rig, out / loaded.name)
    typer.echo(f"python -m mujoco.viewer --mjcf={file}")


def _table(title: str, rows: Sequence[tuple[str, str, str]], width: int, *, trials: bool = False) -> Table:
    """Return a table of names, ``width`` columns wide, descriptions and, if requested, numbers of trials."""
    table = plain_table(title, ("name".ljust(width), ""), ("trials",) if trials else ())
    for name, description, count in rows:
        table.add_row(name, Text(description), *([count] if trials else []))
    return table


def _relative(path: Path) -> Path:
    """Return a path relative to the working directory, where it is below it."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
