"""``simharness export`` from the command line: output, messages and exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from simharness.cli import app

QUICKSTART = str(Path(__file__).parents[2] / "scenarios" / "quickstart.toml")
TINY = [
    *("--set", "people.count=2", "--set", "cameras.count=3", "--set", "duration=0.2", "--set", "clutter.shelves=0"),
    *("--set", "cameras.size=[160, 120]", "--set", "clutter.boxes=1", "--set", "rendering.renderer=rays"),
]


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str):
        return CliRunner().invoke(app, ["export", *arguments], catch_exceptions=False)

    return call


@pytest.mark.slow
def test_the_command_writes_a_sequence_and_prints_the_folder(call, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["simharness", "export", "quickstart.toml", "bench"])
    result = call(QUICKSTART, "bench", *TINY, "--seed", "3")
    assert result.exit_code == 0, result.stderr
    files = [path for path in (tmp_path / "bench" / "quickstart").rglob("*") if path.is_file()]
    assert result.stdout.startswith(f"{len(files)} files, ")
    assert result.stdout.endswith(" MB, in bench/quickstart\n")
    assert len([file for file in files if file.suffix == ".jpg"]) == 6
    content = json.loads((tmp_path / "bench" / "quickstart" / "manifest.json").read_text())
    assert content["seed"] == 3
    assert content["provenance"]["command"] == "simharness export quickstart.toml bench"


@pytest.mark.slow
def test_pictures_may_be_left_out(call, tmp_path):
    assert call(QUICKSTART, "bench", *TINY, "--no-pictures", "--every", "2").exit_code == 0
    assert not list(tmp_path.rglob("*.jpg"))
    assert len(list(tmp_path.rglob("body3DScene_*.json"))) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((QUICKSTART, "bench", "--every", "0"), "--every must be 1 or more, got 0"),
        ((QUICKSTART, "bench", "--set", "people.cuont=2"), "did you mean people.count?"),
        ((QUICKSTART, "bench", *TINY, "--set", "cameras.radius=4.5"), "cameras.radius"),
        ((QUICKSTART, "file"), "file/quickstart: cannot be written: Not a directory"),
        ((QUICKSTART, "existing"), "existing/quickstart: has files, and is no result of simharness export"),
        (("nothing.toml", "bench"), "nothing.toml: no such file"),
    ],
)
def test_bad_input_gives_one_message(call, tmp_path, arguments, message):
    (tmp_path / "file").touch()
    (tmp_path / "existing" / "quickstart").mkdir(parents=True)
    (tmp_path / "existing" / "quickstart" / "thesis").touch()
    result = call(*arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.strip().splitlines()) == 1
    assert message in result.stderr
    assert not (tmp_path / "bench").exists()


@pytest.mark.slow
def test_an_internal_error_shows_its_traceback(call, tmp_path, monkeypatch):
    def broken(*_args, **_options):
        raise ValueError("wrong turn")

    monkeypatch.setattr("simharness.outputs.benchmark.panoptic_sequence.body_scene", broken)
    result = call(QUICKSTART, "bench", *TINY)
    assert result.exit_code == 3
    assert "Traceback" in result.stderr
    assert "failed: write: ValueError: wrong turn" in result.stderr
    assert not list((tmp_path / "bench").iterdir())
