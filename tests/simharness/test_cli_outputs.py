"""What commands write never replaces a file that is the user's: every option of a path, of both programs."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, get_origin, get_type_hints

import pytest
import typer
from typer.testing import CliRunner

from mvpose.cli.app import app as mvpose_app
from simharness.cli import app as simharness_app
from simharness.scenario.load import fingerprint, load
from simharness.study.trial_store import Store

APPS = {"mvpose": mvpose_app, "simharness": simharness_app}
MINE = "years of work"

FILES = {
    "mvpose calibrate --out": "mvpose calibrate dets --intrinsics calib --out {}",
    "mvpose repair --out": "mvpose repair calib dets --out {}",
    "mvpose repair --new-times": "mvpose repair calib dets --out new --new-times {}",
    "simharness schema --out": "simharness schema --out {}",
    "simharness check --junit": "simharness check ci --baseline no.json --junit {}",
    "simharness check --summary": "simharness check ci --baseline no.json --summary {}",
    "simharness check --baseline": "simharness check ci --update-baseline --baseline {}",
    "simharness blame --json": "simharness blame quickstart --json {}",
    "simharness report --out": "simharness report study --out {}",
    "simharness fit-detector --out": "simharness fit-detector shelf --out {}",
    "simharness fit-detector --figure": "simharness fit-detector shelf --figure {}",
    "simharness fit-detector --json": "simharness fit-detector shelf --json {}",
    "simharness evaluate recording --json": "simharness evaluate recording shelf --json {}",
    "simharness evaluate poses --json": "simharness evaluate poses shelf people --json {}",
    "simharness score --json": "simharness score people benchmark --json {}",
    "simharness validate --json": "simharness validate shelf --out new --json {}",
}
"""Options that name a file, and a call with each."""

FOLDERS = {
    "mvpose estimate --out": ("mvpose estimate calib dets --out {}", ""),
    "mvpose run --out": ("mvpose run calib video --detector net.onnx --out {}", ""),
    "mvpose detect --out": ("mvpose detect video --detector net.onnx --out {}", ""),
    "mvpose doctor --out": ("mvpose doctor calib dets --out {}", ""),
    "simharness run --out": ("simharness run quickstart --out {}", "quickstart-HASH"),
    "simharness render --out": ("simharness render quickstart --out {}", "quickstart"),
    "simharness export FOLDER": ("simharness export quickstart {}", "quickstart"),
    "simharness mjcf --out": ("simharness mjcf quickstart --out {}", "quickstart"),
    "simharness study --out": ("simharness study quickstart --out {}", "quickstart"),
    "simharness report --figures": ("simharness report study --figures {}", ""),
    "simharness study --store": ("simharness study quickstart --out new --store {}", ""),
    "simharness merge --into": ("simharness merge store --into {}", ""),
    "simharness plan --out": ("simharness plan lab --out {}", "lab"),
    "simharness rehearse --out": ("simharness rehearse ring5 --volume 4x3 --out {}", ""),
    "simharness hunt --out": ("simharness hunt quickstart --set search.people.count=[1,2] --out {}", "quickstart"),
    "simharness shrink --out": ("simharness shrink quickstart --out {}", ""),
    "simharness validate --out": ("simharness validate shelf --out {}", ""),
}
"""Options that name a folder, a call with each, and the folder in it that the command writes."""

ELSEWHERE = {"mvpose batch --out"}
"""Options that other tests call."""

READ = {
    "calibration", "detections", "videos", "folder", "recording", "fit_on", "rival", "scenario", "suite", "file",
    "study", "stores", "room", "scenes", "other_scenes", "poses", "pictures", "times", "detector", "pose", "skeleton",
    "package", "source", "predictions", "benchmark", "intrinsics", "project",
}  # fmt: skip
"""Parameters whose files are read alone."""


def commands(app: typer.Typer, name: str) -> Iterator[tuple[str, Callable[..., None]]]:
    """Yield all commands of a program with their names."""
    for group in app.registered_groups:
        yield from commands(group.typer_instance, f"{name} {group.name or group.typer_instance.info.name}")
    for each in app.registered_commands:
        yield f"{name} {each.name or each.callback.__name__.replace('_', '-')}", each.callback


def written() -> set[str]:
    """Return all options and arguments that name a file or a folder and are not read alone."""
    found = set()
    for program, app in APPS.items():
        for command, function in commands(app, program):
            for name, hint in get_type_hints(function, include_extras=True).items():
                if "pathlib.Path" not in str(hint.__origin__ if get_origin(hint) is Annotated else hint):
                    continue
                about = hint.__metadata__[0]
                option = "FOLDER" if isinstance(about, typer.models.ArgumentInfo) else f"--{name.replace('_', '-')}"
                declared = (about.default, *(about.param_decls or ()))  # typer sorts them when it builds the command
                option = next((each for each in declared if str(each).startswith("--")), option)
                if name not in READ or f"{command} {option}" == "simharness export FOLDER":
                    found.add(f"{command} {option}")
    return found


def test_every_output_of_every_command_is_examined_here():
    assert written() == {*FILES, *FOLDERS, *ELSEWHERE}
    assert len(written()) > 25


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(line: str, place: str):
        program, *arguments = line.split()
        arguments = [place if each == "{}" else each for each in arguments]
        return CliRunner().invoke(APPS[program], arguments, catch_exceptions=False)

    return call


@pytest.mark.parametrize("option", FILES)
def test_a_file_of_the_user_is_never_replaced(call, tmp_path, option):
    (tmp_path / "mine").write_text(MINE)
    result = call(FILES[option], "mine")
    assert result.exit_code == 2
    assert f"{option.split()[-1]} mine: exists, and" in result.stderr
    assert (tmp_path / "mine").read_text() == MINE
    assert [each.name for each in tmp_path.iterdir()] == ["mine"]  # found before anything runs


@pytest.mark.parametrize("option", FOLDERS)
def test_a_folder_of_the_user_is_never_replaced(call, tmp_path, option):
    line, inside = FOLDERS[option]
    folder = tmp_path / "mine" / inside.replace("HASH", fingerprint(load(Path("quickstart"))))
    folder.mkdir(parents=True)
    Store(tmp_path / "store")  # that merge can read
    names = ["ik.mot", "trials.jsonl", "failures.html", "rehearsal.html", "validation.html", "profile.html"]
    for name in names:
        (folder / name).write_text(MINE)
    result = call(line, "mine")
    assert result.exit_code == 2, result.output
    assert "mine" in result.stderr
    assert any(text in result.stderr for text in ("has files", "exists, and", "not empty")), result.stderr
    assert {each.name: each.read_text() for each in folder.iterdir()} == dict.fromkeys(names, MINE)
