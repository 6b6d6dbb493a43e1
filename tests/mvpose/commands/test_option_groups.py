"""Options that commands share: declared once, the same wherever they stand."""

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.commands.option_groups import grouped, marked, option


@dataclass(frozen=True)
class Drawing:
    color: Annotated[str, typer.Option(help="Colour.")]
    width: float = option(2.0, "Width.", "--wide")
    path: Annotated[Path | None, typer.Option(help="File.")] = None


def program(*, without=()):
    seen = []
    made = typer.Typer()

    @made.command()
    @grouped(without=without)
    def draw(what: Annotated[str, typer.Argument()], *, drawing: Drawing, often: int = 1) -> None:
        """Draw."""
        seen.append((what, drawing, often))

    return lambda *words: (CliRunner().invoke(made, list(words)), seen)


def test_a_command_gets_the_dataclass():
    result, seen = program()("tree", "--color", "red", "--wide", "3", "--often", "2")
    assert result.exit_code == 0, result.output
    assert seen == [("tree", Drawing("red", 3.0), 2)]


def test_what_is_left_out_is_no_option_and_keeps_its_default():
    result, seen = program(without=["width"])("tree", "--color", "red")
    assert seen == [("tree", Drawing("red"), 1)]
    result, _ = program(without=["width"])("tree", "--color", "red", "--wide", "3")
    assert result.exit_code == 2
    assert "No such option" in result.stderr


def test_a_field_without_default_is_required():
    result, _ = program()("tree")
    assert result.exit_code == 2
    assert "--color" in result.stderr


def options(command):
    found = next(each.callback for each in app.registered_commands if each.callback.__name__ == command)
    return {name: parameter.default for name, parameter in inspect.signature(found).parameters.items()}


@pytest.mark.parametrize(
    ("command", "has", "lacks"),
    [
        ("estimate", {"fps", "times", "out", "films", "pictures", "joints"}, {"detector"}),
        ("run", {"fps", "out", "films", "detector", "joints"}, {"times", "skeleton", "pictures"}),
        ("detect", {"out", "detector", "pose"}, {"fps", "method"}),
        ("doctor", {"fps", "times", "up", "out"}, {"joints", "method"}),
        ("repair", {"fps", "times", "out", "free"}, {"joints"}),
    ],
)
def test_commands_have_what_they_can_use(command, has, lacks):
    found = set(options(command))
    assert has <= found
    assert not lacks & found


def test_shared_options_have_the_same_defaults():
    estimate, run = options("estimate"), options("run")
    assert {name: estimate[name] for name in estimate.keys() & run.keys()} == {
        name: run[name] for name in estimate.keys() & run.keys()
    }


def test_fields_are_found_by_their_marks():
    @dataclass(frozen=True)
    class Places:
        folder: str = option("", "A folder.", marks=("path", "new"))
        count: int = option(1, "A number.")
        file: str = option("", "A file.", "--input", marks=("path",))

    assert marked("path", Places) == ("folder", "file")
    assert marked("new", Places, Places) == ("folder", "folder")
