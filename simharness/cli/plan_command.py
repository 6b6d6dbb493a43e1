"""``simharness plan``: where to hang the cameras of a room."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from mvpose.commands.option_groups import grouped
from simharness.cli.program import PROGRAM

if TYPE_CHECKING:
    from simharness.planning.plan_result import RigPlan

INTERRUPTED = 130
_PLAN = "simharness plan"


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(grouped()(plan))


@dataclass(frozen=True)
class RoomOptions:
    """Options that choose among the lenses of a room file, or replace its keys."""

    cameras: Annotated[
        int | None,
        typer.Option(metavar="N", help="Number of cameras, with those that hang already; instead of the file's."),
    ] = None
    lens: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A lens of the room file that may be used. Repeatable. [dim]\\[default: all][/]"
        ),
    ] = None
    people: Annotated[int | None, typer.Option(metavar="N", help="Number of people, instead of the file's.")] = None
    detector: Annotated[
        str | None, typer.Option(metavar="PROFILE", help="Detector profile, instead of the file's.")
    ] = None
    objective: Annotated[
        str | None,
        typer.Option(
            metavar="KIND",
            help="What is maximised: [cyan]share[/], [cyan]mean[/] or [cyan]worst[/]; instead of the file's.",
        ),
    ] = None
    failing: Annotated[
        int | None, typer.Option(metavar="K", help="Number of cameras that may fail, instead of the file's.")
    ] = None
    budget: Annotated[
        float | None, typer.Option(metavar="SUM", help="Largest cost of the lenses, instead of the file's.")
    ] = None

    def changes(self) -> dict[tuple[str, ...], Any]:
        """Return the keys that are replaced, with their values."""
        changes = {
            ("people", "count"): self.people,
            ("detector",): self.detector,
            ("objective", "kind"): self.objective,
            ("objective", "failing"): self.failing,
            ("cameras", "budget"): self.budget,
        }
        return {key: value for key, value in changes.items() if value is not None}


def plan(
    room: Annotated[
        Path,
        typer.Argument(help="A room file (TOML), or the name of a shipped room: [cyan]lab[/].", metavar="ROOM"),
    ],
    options: RoomOptions,
    scenes: Annotated[
        int, typer.Option(metavar="N", min=0, max=1000, help="Simulated scenes that confirm the plan; 0: none.")
    ] = 8,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of all draws.")] = 0,
    workers: Annotated[
        int, typer.Option(metavar="N", min=1, max=1024, help="Processes of the simulation; the results stay the same.")
    ] = 1,
    preview: Annotated[
        bool, typer.Option("--preview", help="Only draw the room and the places for cameras: preview.html.")
    ] = False,
    out: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER", help="Folder in which the plan gets a folder with the name of the room.", file_okay=False
        ),
    ] = Path("results/plans"),
) -> None:
    """Find the best places for the cameras of a room.

    The result is a folder with planned.toml (a rig for scenarios, and for
    rehearse), plan.html for people, and plan.json for programs. An interrupted
    plan continues where it stopped.
    """
    with PROGRAM.exit_on_error():
        from mvpose.commands.progress import reporter
        from simharness.planning.room_file import read_room

        loaded = read_room(room, changes=options.changes())
        folder = out / (Path(loaded.file).stem or loaded.name)
        from mvpose.commands.output_files import check_writable
        from mvpose.files.atomic_files import open_manifest

        check_writable(folder, _PLAN)
        open_manifest(folder, _PLAN)
        if preview:
            from simharness.outputs.planning.plan_page import write_preview

            page = write_preview(loaded, folder)
            typer.echo(f"preview: {page}")
            return
        from simharness.outputs.planning.plan_page import write_plan
        from simharness.planning.plan_rig import PlanEffort, plan_rig

        try:
            with reporter() as bars:
                planned = plan_rig(
                    loaded, options.cameras, lenses=options.lens or (), seed=seed, folder=folder, reporter=bars,
                    effort=PlanEffort(scenes=scenes, workers=workers),
                )  # fmt: skip
        except KeyboardInterrupt:
            typer.echo("interrupted; the same command goes on where this one stopped", err=True)
            raise typer.Exit(INTERRUPTED) from None
        page = write_plan(planned, folder, command=PROGRAM.command_line())
    _show(planned)
    typer.echo(f"rig: {folder / 'planned.toml'}")
    typer.echo(f"report: {page}")


def _show(planned: RigPlan) -> None:
    """Print the sentences and the cameras of a plan."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from simharness.planning.plan_result import sentences

    console = Console()
    for sentence in sentences(planned):
        console.print(sentence, highlight=False, markup=False)
    table = Table(box=SIMPLE_HEAD, show_edge=False)
    for title in ("camera", "place", "x", "y", "z", "lens", "sure", "worth"):
        table.add_column(title, justify="left" if title in ("camera", "place", "lens") else "right")
    for camera, built in zip(planned.cameras, planned.rig, strict=True):
        sure = "" if camera.candidate is None else f"{100 * camera.sure:.0f} %"
        table.add_row(
            camera.name, camera.mount, *(f"{value:.2f}" for value in built.center), camera.lens, sure,
            f"{camera.worth:.1f}",
        )  # fmt: skip
    console.print(table)
