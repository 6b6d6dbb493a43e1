"""``simharness rehearse`` and ``plan``: what a rig will give in a room, and where to hang the cameras of a room."""

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, check_writable, write_json, write_text
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import plain_table, say
from simharness.cli.program import PROGRAM, AllWorkers, Workers, made_here

if TYPE_CHECKING:
    from mvpose import Rig
    from simharness.planning.plan_result import RigPlan
    from simharness.planning.planned_room import Room
    from simharness.planning.rehearsal_scene import RehearsalSetup
    from simharness.types.floor import Volume

_MOST_PEOPLE = 40
_DETECTOR = "topdown"
_SMALL = 3  # cameras: each set of two and more is the rig, or the rig without one
_CROWD = 6  # scenes of other numbers of people


@dataclass(frozen=True)
class Surroundings:
    """Options that say where people are, and who finds them."""

    room: Path | None = option(
        None,
        "A room file (TOML) as of [cyan]simharness plan[/], or the name of a shipped room: walls, volume, "
        "obstacles, people, clutter, detector and target. Cameras have to be in it.",
        metavar="FILE",
    )
    volume: str = option(
        "",
        "Where people are, metres: a rectangle around the origin, [cyan]4x3[/]; instead of the room file's. "
        "[dim]\\[default: what three cameras see][/]",
        metavar="XxY",
    )
    people: int | None = option(
        None,
        "People in the volume, instead of the file's. [dim]\\[default: one for each 3 m², from 2 to 4][/]",
        metavar="N",
        min=1,
        max=_MOST_PEOPLE,
    )
    detector: str | None = option(
        None,
        "A detector profile, a shipped name or a TOML file, instead of the room file's. [dim]\\[default: topdown][/]",
        metavar="PROFILE",
    )


@grouped()
def rehearse(
    calibration: Annotated[
        Path,
        typer.Argument(
            help="A calibration of any format, a rig file (TOML), or the name of a shipped rig: [cyan]ring5[/].",
            metavar="CALIBRATION",
        ),
    ],
    surroundings: Surroundings,
    size: str | None = option(
        None, "Size of the pictures, pixels, where the calibration does not state it.", metavar="WxH"
    ),
    subsets: bool = option(False, "Also score every set of two cameras and more.", "--subsets"),
    scenes: int = option(16, "Number of simulated scenes.", metavar="N", min=2, max=1000),
    seed: int = option(0, "Seed of all draws.", metavar="N", min=0),
    out: Path | None = option(
        None,
        "Folder of rehearsal.html and rehearsal.json. [dim]\\[default: results/rehearsal/NAME][/]",
        metavar="FOLDER",
        file_okay=False,
    ),
    workers: AllWorkers = None,
) -> None:
    """Predict what a rig will give before its cameras hang: maps of the floor, the worth of each camera, one more.

    A fast approximation makes the maps and compares cameras; simulated scenes
    show how well the method estimates people who walk there.
    """
    with PROGRAM.exit_on_error():
        start = perf_counter()
        from mvpose.cli.inputs import picture_size
        from simharness.outputs.planning.rehearsal_page import render_rehearsal
        from simharness.planning.rehearse_rig import RehearsalEffort, rehearse_rig
        from simharness.planning.rig_file import read_rig

        room = _room(surroundings)
        corners = None if room is None else (*(2 * room.space.bounds[1]).tolist(), room.space.height)
        rig = read_rig(calibration, size=picture_size(size), room=corners)
        if size is not None and (other := next((each for each in rig if each.size != picture_size(size)), None)):
            sides = "x".join(map(str, other.size))
            raise ValueError(
                f"--size {size}: the calibration states {sides} for the camera {other.name!r}; leave it out"
            )
        setup = _setup(rig, room, surroundings)
        name = calibration.stem or calibration.resolve().name
        place = out or Path("results/rehearsal") / name
        check_place(place / "rehearsal.html", option="--out", mark=HTML)
        check_place(place / "rehearsal.json", option="--out", mark=PROVENANCE)
        if subsets and len(rig) <= _SMALL:
            note(f"--subsets has no effect: all sets of {len(rig)} cameras are scored anyway")
        effort = RehearsalEffort(
            scenes=scenes, crowd_scenes=min(_CROWD, scenes), workers=workers or os.cpu_count() or 1
        )
        with reporter() as bars:
            rehearsal = rehearse_rig(rig, setup, subsets=subsets, seed=seed, effort=effort, name=name, reporter=bars)
        made = made_here(start, seeds=range(seed, seed + scenes), variants=("full",))
        write_text(render_rehearsal(rehearsal, provenance=made), place / "rehearsal.html")
        write_json({**made, **rehearsal.to_json()}, place / "rehearsal.json")
    for sentence in rehearsal.sentences:
        Console().print(sentence, highlight=False, markup=False)
    say(f"report: {place / 'rehearsal.html'}")


def _room(given: Surroundings) -> "Room | None":
    from simharness.planning.room_file import read_room

    changes = {("people", "count"): given.people, ("detector",): given.detector}
    known = {key: value for key, value in changes.items() if value is not None}
    return None if given.room is None else read_room(given.room, changes=known)


def _setup(rig: "Rig", room: "Room | None", given: Surroundings) -> "RehearsalSetup":
    """Return what the rig is rehearsed for: the room file's, or the defaults, as the options change it."""
    from simharness.planning.floor_coverage import covered_volume, usual_people
    from simharness.planning.rehearsal_scene import RehearsalSetup
    from simharness.scenario.presets import read_profile

    if room is not None:
        setup = RehearsalSetup.in_room(room)
        return replace(setup, volume=rectangle_of(given.volume)) if given.volume else setup
    volume = rectangle_of(given.volume) if given.volume else covered_volume(rig)[0]
    return RehearsalSetup(volume, read_profile(given.detector or _DETECTOR), given.people or usual_people(volume))


def rectangle_of(text: str) -> "Volume":
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


_PLAN = "simharness plan"


@dataclass(frozen=True)
class RoomOptions:
    """Options that choose among the lenses of a room file, or replace its keys."""

    cameras: int | None = option(
        None, "Number of cameras, with those that hang already; instead of the file's.", metavar="N"
    )
    lens: list[str] | None = option(
        None, "A lens of the room file that may be used. Repeatable. [dim]\\[default: all][/]", metavar="NAME"
    )
    people: int | None = option(None, "Number of people, instead of the file's.", metavar="N")
    detector: str | None = option(None, "Detector profile, instead of the file's.", metavar="PROFILE")
    objective: str | None = option(
        None,
        "What is maximised: [cyan]share[/], [cyan]mean[/] or [cyan]worst[/]; instead of the file's.",
        metavar="KIND",
    )
    failing: int | None = option(None, "Number of cameras that may fail, instead of the file's.", metavar="K")
    budget: float | None = option(None, "Largest cost of the lenses, instead of the file's.", metavar="SUM")

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


@grouped()
def plan(
    room: Annotated[
        Path, typer.Argument(help="A room file (TOML), or the name of a shipped room: [cyan]lab[/].", metavar="ROOM")
    ],
    options: RoomOptions,
    scenes: int = option(8, "Simulated scenes that confirm the plan; 0: none.", metavar="N", min=0, max=1000),
    seed: int = option(0, "Seed of all draws.", metavar="N", min=0),
    workers: Workers = 1,
    preview: bool = option(False, "Only draw the room and the places for cameras: preview.html.", "--preview"),
    out: Path = option(
        Path("results/plans"),
        "Folder in which the plan gets a folder with the name of the room.",
        metavar="FOLDER",
        file_okay=False,
    ),
) -> None:
    """Find the best places for the cameras of a room.

    The result is a folder with planned.toml (a rig for scenarios, and for
    rehearse), plan.html for people, and plan.json for programs. An interrupted
    plan continues where it stopped.
    """
    with PROGRAM.exit_on_error():
        from mvpose.files.atomic_files import open_manifest
        from simharness.planning.room_file import read_room

        loaded = read_room(room, changes=options.changes())
        folder = out / (Path(loaded.file).stem or loaded.name)
        check_writable(folder, _PLAN)
        open_manifest(folder, _PLAN)
        if preview:
            for name in ("cameras", "lens", "budget", "scenes", "seed", "workers"):
                if given(name):
                    raise ValueError(f"--{name}: is about the plan, which --preview does not make; give one of them")
            from simharness.outputs.planning.plan_page import write_preview

            page = write_preview(loaded, folder)
            typer.echo(f"preview: {page}")
            return
        from simharness.outputs.planning.plan_page import write_plan

        if given("workers") and not scenes:
            note("--workers has no effect: --scenes 0 simulates nothing")
        from simharness.planning.plan_rig import PlanEffort, plan_rig

        try:
            with reporter() as bars:
                planned = plan_rig(
                    loaded, options.cameras, lenses=options.lens or (), seed=seed, folder=folder, reporter=bars,
                    effort=PlanEffort(scenes=scenes, workers=workers),
                )  # fmt: skip
        except KeyboardInterrupt:
            raise KeyboardInterrupt("interrupted; the same command goes on where this one stopped") from None
        page = write_plan(planned, folder, command=PROGRAM.command_line())
    _show(planned)
    typer.echo(f"rig: {folder / 'planned.toml'}")
    typer.echo(f"report: {page}")


def _show(planned: "RigPlan") -> None:
    """Print the sentences and the cameras of a plan."""
    from simharness.planning.plan_result import sentences

    console = Console()
    for sentence in sentences(planned):
        console.print(sentence, highlight=False, markup=False)
    table = plain_table("", ("camera", "place", "lens"), ("x", "y", "z", "sure", "worth"))
    for camera, built in zip(planned.cameras, planned.rig, strict=True):
        sure = "" if camera.candidate is None else f"{100 * camera.sure:.0f} %"
        numbers = (*(f"{value:.2f}" for value in built.center), sure, f"{camera.worth:.1f}")
        table.add_row(camera.name, camera.mount, camera.lens, *numbers)
    console.print(table)
