"""Walk over the options of a program: whether each one changes what a command does, is refused, or has no effect.

A command is run with and without an option, and its exit code, output and files are compared. One whose value is the
same to the bit, without a word about it, is ignored.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path

import typer
from typer.testing import CliRunner

RECORDS = (".written", "inputs.json")
"""Files that repeat the options of the command."""


@dataclass(frozen=True)
class Row:
    """One option: what is given, and the words beside which it has an effect.

    Attributes:
        words: the option as given.
        beside: options that are given with and without it.
        base: first words after the command; None: those of the command.
    """

    words: str
    beside: str = ""
    base: str | None = None


@dataclass(frozen=True)
class Outcome:
    """What a command did: exit code, both outputs, and the content of the files that it wrote."""

    code: int
    printed: str
    told: str
    files: dict[str, str] = field(default_factory=dict)


def parameters(app: typer.Typer) -> dict[str, dict[str, str]]:
    """Return the options of every command, by the name of the parameter."""
    found: dict[str, dict[str, str]] = {}

    def visit(command, words):
        for name, inner in getattr(command, "commands", {}).items():
            visit(inner, [*words, name])
        if not getattr(command, "commands", {}):
            found[" ".join(words)] = {
                each.name: each.opts[0]
                for each in command.params
                if each.opts[0].startswith("--") and each.name != "help"
            }

    visit(typer.main.get_command(app), [])
    return found


class Walk:
    """Runs of the commands of a program, each made once.

    Args:
        app: the program.
        out: folder into which commands write; it is removed before each run.
        places: what ``{name}`` stands for in words.
        timed: pattern of what is printed about durations, which are no results.
    """

    def __init__(self, app: typer.Typer, out: Path, places: dict[str, object], *, timed: str = "^$") -> None:
        self.app, self.out, self.places = app, out, places | {"out": out}
        self.timed = re.compile(timed)
        self.runs: dict[str, Outcome] = {}

    def run(self, words: str) -> Outcome:
        """Run a command, if it has not been run."""
        if words not in self.runs:
            for each in self.out.parent.glob(f"{self.out.name}*"):
                shutil.rmtree(each)
            result = CliRunner().invoke(self.app, [word.format(**self.places) for word in words.split()])
            files = (each for each in self.out.parent.glob(f"{self.out.name}*/**/*") if each.is_file())
            digests = {
                str(each.relative_to(self.out.parent)): _digest(each) for each in files if each.name not in RECORDS
            }
            self.runs[words] = Outcome(result.exit_code, self.timed.sub("", result.stdout), result.stderr, digests)
        return self.runs[words]

    def effect(self, base: str, option: str) -> str:
        """Return "changes", "refused", "says" or "ignored" of an option beside others."""
        before, after = self.run(base), self.run(f"{base} {option}")
        name = option.split(maxsplit=1)[0]
        if after.code == 2 and before.code != 2:
            words = [name.lstrip("-"), *option.format(**self.places).split()[1:]]
            return (
                "refused" if any(word in after.told for word in words) else f"refused for another reason: {after.told}"
            )
        if f"{name} has no effect" in after.told:
            return "says"
        if (after.code, after.printed, after.files) != (before.code, before.printed, before.files):
            return "changes"
        return "says" if after.told != before.told else "ignored"


def _digest(file: Path) -> str:
    return hashlib.blake2b(file.read_bytes(), digest_size=8).hexdigest()
