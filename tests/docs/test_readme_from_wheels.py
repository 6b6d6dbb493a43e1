"""README: each of its commands works in an empty folder, from the wheels alone."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from built_wheels import ROOT, build_wheels
from doc_pages import PAGES, commands, toml_file
from easy_suite import EASY
from known_commands import ALONE, LAB, PICTURES
from tfjs_graphs import package_of_networks

_SEQUENCE = "benchmark/gathering"
_CALIBRATION = f"{_SEQUENCE}/calibration_gathering.json"
_PROJECT = f"""# project.toml
calibration = "{_CALIBRATION}"
fps = 5
format = ["trc"]
page = false

[trials.first]
detections = "{_SEQUENCE}/openpose"
"""
# What replaces placeholders, and what makes a command cheap, in the order in which they are run.
COMMANDS = {
    "simharness check ci --workers 2": "--baseline own.json --update-baseline --workers 1",
    "simharness export gathering benchmark": PICTURES.replace("duration=0.4", "duration=3"),
    "simharness plan lab --cameras 5": "--scenes 0 --cameras 3",
    "simharness rehearse ring5 --volume 6x6 --people 4": "--scenes 2 --people 2 --workers 1",
    "mvpose estimate CALIBRATION DETECTIONS --out people": "--fps 5",
    "simharness score FILE benchmark/gathering": "",
    "mvpose doctor CALIBRATION DETECTIONS": "--fps 5",
    "mvpose batch PROJECT": "",
    "simharness study my-lab.toml --workers 2": f"{LAB} --seeds 1",
    "simharness run passage": ALONE["simharness run passage"],
}
GET, BY_A_NETWORK = "mvpose networks get movenet", "mvpose run CALIBRATION VIDEO... --out people"
# Of a checkout.
ELSEWHERE = {
    "make demo",
    "make test",
    "make docs",
    "make wheels",
    ". .venv/bin/activate",
    "python -m tools.network_profile movenet",
    "simharness validate shelf FOLDER",
}
GIVEN = {
    "CALIBRATION": _CALIBRATION,
    "DETECTIONS": f"{_SEQUENCE}/openpose",
    "FILE": "people",
    "PROJECT": "project.toml",
    "VIDEO...": f"{_SEQUENCE}/hdImgs",
}
CODES = {"mvpose doctor CALIBRATION DETECTIONS": {0, 1}}  # 1: faults; so few frames determine nothing


class Installed:
    """Both wheels in a folder of their own, and an empty folder in which their commands run."""

    def __init__(self, wheels: Path, folder: Path, work: Path) -> None:
        files = [str(each) for each in build_wheels(wheels).values()]
        install = ["install", "--quiet", "--no-deps", "--no-compile", "--disable-pip-version-check", "--target"]
        subprocess.run([sys.executable, "-m", "pip", *install, str(folder), *files], check=True)
        self.folder, self.work = folder, work
        self.environment = {**os.environ, "PYTHONPATH": str(folder), "XDG_DATA_HOME": str(wheels)}

    def run(self, command: str, more: str = "") -> str:
        """Run a command with more options; it has to end with a code of success."""
        program, *words = shlex.split(command)
        arguments = [str(self.folder / "bin" / program), *(GIVEN.get(word, word) for word in words), *shlex.split(more)]
        done = subprocess.run(
            arguments, cwd=self.work, env=self.environment, capture_output=True, text=True, check=False
        )
        assert done.returncode in CODES.get(command, {0}), f"{command} {more}\n{done.stdout}\n{done.stderr}"
        return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    made = Installed(*(tmp_path_factory.mktemp(each) for each in ("checkout", "installed", "empty")))
    where = "import simharness, mvpose; print(simharness.__file__, mvpose.__file__)"
    found = subprocess.run(
        [sys.executable, "-c", where], cwd=made.work, env=made.environment, capture_output=True, text=True, check=True
    )
    assert all(Path(each).is_relative_to(made.folder) for each in found.stdout.split())
    assert not list(made.work.iterdir())
    return made


def test_each_command_of_the_readme_is_here():
    assert set(commands(PAGES["README.md"])) == {*COMMANDS, GET, BY_A_NETWORK, *ELSEWHERE}


@pytest.mark.slow
def test_the_commands(installed):
    (installed.work / "ci.toml").write_text(EASY.replace(str(ROOT / "scenarios" / "quickstart.toml"), "quickstart"))
    (installed.work / "project.toml").write_text(_PROJECT)
    (installed.work / "my-lab.toml").write_text(toml_file("my-lab.toml"))
    printed = {command: installed.run(command, more) for command, more in COMMANDS.items()}
    assert "PCP" in printed["simharness score FILE benchmark/gathering"]
    assert "first" in printed["mvpose batch PROJECT"]
    for made in ("people/recording.html", "results/runs/*/report.html", "results/studies/my-lab/report.html"):
        assert list(installed.work.glob(made)), made


@pytest.mark.slow
def test_videos_by_a_network(installed):
    fetched = package_of_networks()
    export = "simharness export gathering benchmark"
    if not (installed.work / _SEQUENCE).exists():
        installed.run(export, COMMANDS[export])
    installed.run(GET, f"--package {fetched}")
    installed.run(BY_A_NETWORK, "--fps 5 --out films")
    assert (installed.work / "films" / "recording.html").is_file()
