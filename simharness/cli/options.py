"""Arguments and options that several commands take, and how a command was asked for."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

ScenarioFile = Annotated[Path, typer.Argument(help="The scenario file, TOML.", metavar="SCENARIO")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key: [cyan]people.count=6[/]. Repeatable."),
]
Seed = Annotated[int | None, typer.Option(metavar="N", help="Replace the scenario's seed.")]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write everything there too.", dir_okay=False),
]


def command_line() -> str:
    """How the user asked for this, to be run again."""
    return shlex.join(["simharness", *sys.argv[1:]])
