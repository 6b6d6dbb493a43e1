"""Groups of commands on recordings: ``simharness evaluate shelf FOLDER`` beside ``simharness evaluate seeds ...``."""

from __future__ import annotations

import typer
from typer.core import TyperGroup

_COMMAND = "recording"


class RecordingGroup(TyperGroup):
    """Group that runs its command ``recording`` where the first word is no other command, but a recording."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Put the command before the words of a call that names none."""
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            args = [_COMMAND, *args]
        return super().parse_args(ctx, args)


def recording_group(help_text: str) -> typer.Typer:
    """Return a group of commands, to which a command ``recording`` has to be added."""
    return typer.Typer(
        cls=RecordingGroup,
        no_args_is_help=True,
        help=help_text,
        subcommand_metavar="RECORDING [FOLDER] | COMMAND [ARGS]...",
    )
