"""``simharness rehearse``: what a rig will give in a room, before its cameras hang."""

from __future__ import annotations

import os
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from mvpose.commands.output_files import make_folder, write_json, write_text
from simharness.cli.program import PROGRAM

if TYPE_CHECKING:
    from simharness.planning.visibility import Obstacle
    from simharness.planning.volume import Volume

_MOST_PEOPLE = 40
_PEOPLE = 4
_DETECTOR = "typical"
_CROWD = 6  # scenes of other numbers of people


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(rehearse)


def rehearse(
    calibration: Annotated[
        Path,
        typer.Argument(
            help="A calibration of any format, a rig file (TOML), or the name of a shipped rig: [cyan]ring5[/].",
            metavar="CALIBRATION",
        ),
    ],
    room: Annotated[
        str,
        typer.Option(
            metavar="ROOM",
            help="Size of the room around the origin, metres, as [cyan]8x6x3[/], or a room file of "
            "[cyan]simharness plan[/], with its volume, obstacles, people and detector. Cameras have to be in it.",
        ),
    ] = "",
    volume: Annotated[
        str,
        typer.Option(
            metavar="XxY[@X,Y]",
            help="Where people are, metres: [cyan]4x3[/] around the origin, [cyan]4x3@1,0.5[/] around a point, or "
            "corners [cyan]0,0 4,0 4,3[/]. [dim]\\[default: what three cameras see][/]",
        ),
    ] = "",
    people: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, max=_MOST_PEOPLE, help="People in the volume. [dim]\\[default: 4][/]"),
    ] = None,
    detector: Annotated[
        str | None,
        typer.Option(
            metavar="PROFILE", help="A detector profile: a shipped name or a TOML file. [dim]\\[default: typical][/]"
        ),
    ] = None,
    obstacle: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,W,D,H",
            help="A box that hides people: its middle on the floor, width along x, depth along y, height. Repeatable.",
        ),
    ] = None,
    clutter: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=N",
            help="Objects that the simulator places around the people, in the simulation alone: [cyan]boxes=6[/], "
            "[cyan]shelves=1[/] and other kinds of a scenario. Repeatable.",
        ),
    ] = None,
    target: Annotated[
        str, typer.Option(metavar="PCP,MM", help="What a place must reach: PCP, and joint error in mm.")
    ] = "95,40",
    size: Annotated[
        str,
        typer.Option(metavar="WxH", help="Size of the pictures, pixels, where the calibration does not state it."),
    ] = "",
    subsets: Annotated[bool, typer.Option("--subsets", help="Also score every set of two cameras and more.")] = False,
    scenes: Annotated[int, typer.Option(metavar="N", min=2, max=1000, help="Number of simulated scenes.")] = 16,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of all draws.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of rehearsal.html and rehearsal.json. [dim]\\[default: results/rehearsal/NAME][/]",
            file_okay=False,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Processes; the results stay the same. [dim]\\[default: all cores][/]"),
    ] = None,
) -> None:
    """Predict what a rig will give before its cameras hang: maps of the floor, the worth of each camera, one more.

    A fast approximation makes the maps and compares cameras; simulated scenes
    show how well the method estimates people who walk there.
    """
    with PROGRAM.exit_on_error():
        start = perf_counter()
        from mvpose.commands.progress import reporter
        from simharness.cli.rehearse_values import (
            clutter_of,
            obstacle_of,
            picture_size,
            surroundings_of,
            target_of,
            volume_of,
        )
        from simharness.outputs.planning.rehearsal_page import render_rehearsal
        from simharness.planning.rehearse_rig import RehearsalEffort, rehearse_rig
        from simharness.planning.rig_file import read_rig
        from simharness.scenario.presets import read_profile
        from simharness.trial.provenance import provenance

        around = surroundings_of(room) if room else None
        walls: Volume | None = None if around is None else around.room
        where: Volume | None = volume_of(volume) if volume else None if around is None else around.volume
        boxes: list[Obstacle] = [obstacle_of(each) for each in obstacle or ()]
        boxes += () if around is None else around.obstacles
        wanted, objects = target_of(target), clutter_of(clutter or ())
        rig = read_rig(
            calibration,
            size=picture_size(size) if size else None,
            room=None if walls is None else (*(2 * walls.outline.max(axis=0)).tolist(), walls.height),
        )
        profile = None if around is None or detector is not None else around.detector
        profile = read_profile(detector or _DETECTOR) if profile is None else profile
        count = people or (None if around is None else around.people) or _PEOPLE
        name = calibration.stem or calibration.resolve().name
        place = out or Path("results/rehearsal") / name
        make_folder(place)
        with reporter() as bars:
            rehearsal = rehearse_rig(
                rig,
                detector=profile,
                volume=where,
                people=count,
                room=walls,
                obstacles=boxes,
                clutter=objects,
                target=wanted,
                subsets=subsets,
                seed=seed,
                effort=RehearsalEffort(
                    scenes=scenes, crowd_scenes=min(_CROWD, scenes), workers=workers or os.cpu_count() or 1
                ),
                name=name,
                reporter=bars,
            )
        made = provenance(
            command=PROGRAM.command_line(),
            seeds=range(seed, seed + scenes),
            variants=("full",),
            seconds=perf_counter() - start,
        )
        write_text(render_rehearsal(rehearsal, provenance=made), place / "rehearsal.html")
        write_json({**made, **rehearsal.to_json()}, place / "rehearsal.json")
    console = Console()
    for sentence in rehearsal.sentences:
        console.print(sentence, highlight=False, markup=False)
    console.print(f"report: {place / 'rehearsal.html'}", soft_wrap=True, highlight=False, markup=False)
