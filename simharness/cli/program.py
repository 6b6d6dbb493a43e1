"""The program ``simharness``, and the arguments and options that several of its commands share."""

from collections.abc import Iterable
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from mvpose.commands.programs import Program


def _version() -> str:
    from simharness.runtime.version import code_version

    return code_version()


PROGRAM = Program(
    "simharness",
    "Simulate people in front of calibrated cameras, and find where a method for their 3D poses breaks.",
    version=_version,
    tracebacks=True,
)


def made_here(start: float, *, seeds: Iterable[int], variants: Iterable[str]) -> dict[str, Any]:
    """Return the provenance of the result of this command, which began at ``start`` by ``perf_counter``."""
    from simharness.trial.identity import provenance

    seconds = perf_counter() - start
    return provenance(command=PROGRAM.command_line(), seeds=seeds, variants=variants, seconds=seconds)


ScenarioFile = Annotated[
    Path,
    typer.Argument(
        help="A scenario file (TOML), or the name of a shipped scenario: [cyan]quickstart[/].", metavar="SCENARIO"
    ),
]
RecordingFile = Annotated[
    Path,
    typer.Argument(
        help="A recording with truth: its description (TOML), a folder with recording.toml, or the name of a shipped "
        "description: [cyan]shelf[/].",
        metavar="RECORDING",
    ),
]
RecordingFolder = Annotated[
    Path | None,
    typer.Argument(
        help="Folder with the files of the recording. [dim]\\[default: that of the description][/]", metavar="FOLDER"
    ),
]


def _refuse_repeated(overrides: list[str] | None) -> list[str] | None:
    """Refuse two overrides of one key, of which only the last would count."""
    keys = [each.partition("=")[0].strip() for each in overrides or ()]
    with PROGRAM.exit_on_error():
        if repeated := [each for each in overrides or () if keys.count(each.partition("=")[0].strip()) > 1]:
            raise ValueError(f"--set {', --set '.join(repeated)}: of one key; give one of them")
    return overrides


Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scenario: [cyan]people.count=6[/]. Repeatable, for other keys.",
        callback=_refuse_repeated,
    ),
]
Seed = Annotated[
    int | None, typer.Option(metavar="N", help="Seed of all random draws, instead of the scenario's: another scene.")
]
BlameSeeds = Annotated[
    int,
    typer.Option(
        "--blame",
        metavar="N",
        min=0,
        help="Also find what cost the score, at N seeds, as [cyan]simharness blame[/] does; 0: do not.",
    ),
]
JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write all results to this file as well.", dir_okay=False)
]
Workers = Annotated[
    int, typer.Option(metavar="N", min=1, max=1024, help="Processes that share the work; the results stay the same.")
]
AllWorkers = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, help="Processes; the results stay the same. [dim]\\[default: all cores][/]"),
]
