"""``simharness rehearse``: what a rig will give in a room, before its cameras hang."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from mvpose.commands.option_groups import grouped
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, write_json, write_text
from simharness.cli.program import PROGRAM

if TYPE_CHECKING:
    from mvpose import Rig
    from simharness.planning.planned_room import Room
    from simharness.planning.rehearsal_setup import RehearsalSetup
    from simharness.types.floor import Volume

_MOST_PEOPLE = 40
_PEOPLE = 4
_DETECTOR = "typical"
_CROWD = 6  # scenes of other numbers of people


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(grouped()(rehearse))


@dataclass(frozen=True)
class Surroundings:
    """Options that say where people are, and who finds them."""

    room: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A room file (TOML) as of [cyan]simharness plan[/], or the name of a shipped room: walls, volume, "
            "obstacles, people, clutter, detector and target. Cameras have to be in it.",
        ),
    ] = None
    volume: Annotated[
        str,
        typer.Option(
            metavar="XxY",
            help="Where people are, metres: a rectangle around the origin, [cyan]4x3[/]; instead of the room file's. "
            "[dim]\\[default: what three cameras see][/]",
        ),
    ] = ""
    people: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=_MOST_PEOPLE,
            help="People in the volume, instead of the file's. [dim]\\[default: 4][/]",
        ),
    ] = None
    detector: Annotated[
        str | None,
        typer.Option(
            metavar="PROFILE",
            help="A detector profile, a shipped name or a TOML file, instead of the room file's. "
            "[dim]\\[default: typical][/]",
        ),
    ] = None


def rehearse(
    calibration: Annotated[
        Path,
        typer.Argument(
            help="A calibration of any format, a rig file (TOML), or the name of a shipped rig: [cyan]ring5[/].",
            metavar="CALIBRATION",
        ),
    ],
    surroundings: Surroundings,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of the pictures, pixels, where the calibration does not state it."),
    ] = None,
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
        from mvpose.cli.inputs import picture_size
        from mvpose.commands.progress import reporter
        from simharness.outputs.planning.rehearsal_page import render_rehearsal
        from simharness.planning.rehearse_rig import RehearsalEffort, rehearse_rig
        from simharness.planning.rig_file import read_rig
        from simharness.trial.identity import provenance

        room = _room(surroundings)
        corners = None if room is None else (*(2 * room.space.bounds[1]).tolist(), room.space.height)
        rig = read_rig(calibration, size=picture_size(size), room=corners)
        setup = _setup(rig, room, surroundings)
        name = calibration.stem or calibration.resolve().name
        place = out or Path("results/rehearsal") / name
        check_place(place / "rehearsal.html", option="--out", mark=HTML)
        check_place(place / "rehearsal.json", option="--out", mark=PROVENANCE)
        effort = RehearsalEffort(
            scenes=scenes, crowd_scenes=min(_CROWD, scenes), workers=workers or os.cpu_count() or 1
        )
        with reporter() as bars:
            rehearsal = rehearse_rig(rig, setup, subsets=subsets, seed=seed, effort=effort, name=name, reporter=bars)
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


def _room(given: Surroundings) -> Room | None:
    from simharness.planning.room_file import read_room

    changes = {("people", "count"): given.people, ("detector",): given.detector}
    known = {key: value for key, value in changes.items() if value is not None}
    return None if given.room is None else read_room(given.room, changes=known)


def _setup(rig: Rig, room: Room | None, given: Surroundings) -> RehearsalSetup:
    """Return what the rig is rehearsed for: the room file's, or the defaults, as the options change it."""
    from simharness.planning.floor_coverage import covered_volume
    from simharness.planning.rehearsal_setup import RehearsalSetup
    from simharness.scenario.presets import read_profile

    if room is not None:
        setup = RehearsalSetup.in_room(room)
        return replace(setup, volume=rectangle_of(given.volume)) if given.volume else setup
    volume = rectangle_of(given.volume) if given.volume else covered_volume(rig)[0]
    return RehearsalSetup(volume, read_profile(given.detector or _DETECTOR), given.people or _PEOPLE)


def rectangle_of(text: str) -> Volume:
    """Return the volume over a rectangle around the origin: "4x3", metres.

    Raises:
        ValueError: not two sides above 0 m.
    """
    from simharness.types.floor import Volume

    try:
        sides = [float(each) for each in text.split("x")]
    except ValueError:
        sides = []
    if len(sides) != 2 or not all(math.isfinite(each) and each > 0 for each in sides):
        raise ValueError(
            f"--volume {text}: expected two sides above 0 m, 4x3, of a rectangle around the origin; another place or "
            "shape, and a height, stand in the section [volume] of a room file: --room FILE"
        )
    return Volume.box(*sides)
