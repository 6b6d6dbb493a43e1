"""README, CONTRIBUTING and guide: every command in them works."""

from __future__ import annotations

import importlib.util
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from itertools import product
from pathlib import Path

import pytest
from call_commands import call, done
from doc_pages import FENCE, PAGES, ROOT, commands, toml_file
from known_commands import (
    ALONE,
    BAKE,
    CI,
    IN_PARTS,
    KNOWN,
    MAKE,
    MODULES,
    NAMES,
    OWN_RECORDING,
    OWN_STUDY,
    PYTEST,
    RAYS,
    READ_BY_A_NETWORK,
    SHELF,
    USER_FILES,
)

from mvpose.formats.calibration.voxelpose import write_calibration
from mvpose.networks.catalogue.store import path_of
from simharness.scenario.load import load_study


def test_commands_are_found_in_blocks_and_in_prose():
    text = """`simharness` and `make` are names, `simharness/gate` is a folder; `simharness show
FILE` and `python -m json.tool` stand in prose.
10. An item
    that goes on

    make demo   # says what
    pip install .

```sh
simharness run a#b.toml
```

```toml
    a = 1
```
"""
    found = ["simharness run a#b.toml", "make demo", "pip install .", "simharness show FILE", "python -m json.tool"]
    assert list(commands(text)) == found


def test_every_command_is_run_here():
    present = {command: name for name, page in PAGES.items() for command in commands(page)}
    new = {command: name for command, name in present.items() if command not in KNOWN}
    assert not new, f"commands in the pages that no test here runs: {new}"
    gone = sorted(KNOWN - set(present))
    assert not gone, f"commands that are no longer in any page: {gone}"


@pytest.mark.parametrize("name", PAGES)
def test_links_to_files_resolve(name):
    targets = re.findall(r"\]\((?!https?:)([^)#\s]+)", FENCE.sub("", PAGES[name]))
    assert not [target for target in targets if not ((ROOT / name).parent / target).exists()]


OUTPUT = {
    "run": "results/runs/*/report.html",
    "export": "*/gathering/**/manifest.json",
    "render": "results/renders/gathering/mosaic*",
    "study": "results/*/*/report.html",
}


@pytest.mark.slow
@pytest.mark.parametrize("command", ALONE)
def test_commands_that_stand_alone(workplace, command):
    assert done(command.replace("FILE", "my-lab.toml"), ALONE[command])
    if output := OUTPUT.get(command.split()[1]):
        assert list(workplace.glob(output))


@pytest.mark.slow
@pytest.mark.parametrize("command", READ_BY_A_NETWORK)
def test_commands_whose_pictures_a_network_reads(workplace, command):
    try:
        path_of("movenet")
    except ValueError as error:
        pytest.skip(str(error))
    done(command, READ_BY_A_NETWORK[command])
    assert list(workplace.glob(OUTPUT[command.split()[1]]))


@pytest.mark.slow
@pytest.mark.parametrize("file", USER_FILES)
def test_commands_with_a_file_of_the_user(workplace, file):
    small = RAYS.replace("--set cameras.count=3 ", "").replace("--set cameras.size=[160,120] ", "")
    if file == "calibration.json":
        ring = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))["ring"](3, radius=3.2, size=(1032, 776))
        write_calibration(workplace / file, ring)
        small += " --set people.area=1.0"
    elif file == "clip.bvh":
        made = runpy.run_path(str(ROOT / "tests" / "simharness" / "world" / "motion" / "test_mocap_retarget.py"))
        (workplace / file).write_text(made["bvh"](**made["HANG"]), encoding="utf-8")
    assert "full" in done(USER_FILES[file], f"{small} --set clutter.boxes=0 --set clutter.shelves=0")


@pytest.mark.parametrize("command", NAMES)
def test_commands_that_are_only_mentioned(command):
    assert "Usage" in done(command, "--help")


@pytest.mark.parametrize("command", SHELF)
def test_commands_on_shelf_without_data(workplace, command):
    result = call(command)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")  # and no usage: the options are right
    assert "no such folder" in result.stderr


def test_the_described_recording_has_valid_keys(workplace):
    (workplace / "hall.toml").write_text(toml_file("hall.toml"), encoding="utf-8")
    result = call(OWN_RECORDING)
    assert result.exit_code == 2
    assert "hall.toml: calibration.file: calibration.json: no such file" in result.stderr


@pytest.mark.slow
def test_shelf_is_evaluated(workplace, shared_data):
    (workplace / "FOLDER").symlink_to(shared_data / "shelf")
    assert "PCP" in done(SHELF[0], "--method fast")


def test_the_custom_study_has_the_described_settings(workplace):
    study = load_study("my-lab.toml")
    file = tomllib.loads(toml_file("my-lab.toml"))
    heights, people = file["sweep"]["cameras"]["height"], file["sweep"]["people"]["count"]
    assert (people["from"], people["to"], people["steps"]) == (2, 8, 4)
    assert len(study.seeds) == file["seeds"]
    assert list(study.variants) == file["variants"]
    settings = {(each.case, *map(each.factors.get, ("cameras.height", "people.count"))) for each in study.settings}
    assert settings == set(product(file["cases"], heights, (2, 4, 6, 8)))


@pytest.mark.slow
def test_the_custom_study(workplace):
    first, more = OWN_STUDY
    assert "2 trials: 0 kept from before, 2 run, 0 failed" in done(first, OWN_STUDY[first])
    assert "4 trials: 2 kept from before, 2 run, 0 failed" in done(more, OWN_STUDY[more])
    assert (workplace / "results/studies/my-lab/report.html").is_file()


@pytest.mark.slow
def test_the_study_in_parts(workplace):
    first, merge, whole = IN_PARTS
    for k in (1, 2, 3):
        done(first.replace("1/3", f"{k}/3").replace("part1", f"part{k}"), IN_PARTS[first])
    assert "4 entries copied" in done(merge)
    assert "4 trials: 4 kept from before, 0 run, 0 failed" in done(whole, IN_PARTS[whole])


@pytest.mark.parametrize("command", MAKE)
def test_make_knows_its_targets(command):
    program, *targets = command.split()
    dry = subprocess.run([program, "-n", *targets], cwd=ROOT, capture_output=True, text=True, check=False)
    assert dry.returncode == 0, dry.stderr
    assert dry.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("command", MODULES)
def test_modules_have_a_command_line(command, monkeypatch, capsys):
    module = command.removeprefix("python -m ")
    monkeypatch.setattr(sys, "argv", [module, "--help"])
    monkeypatch.delitem(sys.modules, f"{module}.__main__", raising=False)  # other tests import it; runpy would warn
    with pytest.raises(SystemExit) as exit_code:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    assert not exit_code.value.code
    assert capsys.readouterr().out.startswith(f"usage: {command} ")


@pytest.mark.parametrize("command", BAKE)
def test_the_commands_that_bake_the_body_are_programs(command):
    spec = importlib.util.find_spec(command.rsplit(maxsplit=1)[-1])
    assert '\nif __name__ == "__main__":\n' in Path(spec.origin).read_text(encoding="utf-8")


def test_ci_is_a_program():
    assert os.access(ROOT / CI, os.X_OK)


def test_pytest_deselects_slow_tests():
    _, *words = shlex.split(PYTEST[0])
    file = ROOT / "tests" / "simharness" / "test_cli.py"
    process = subprocess.run(
        [sys.executable, "-m", "pytest", *words, str(file), "--collect-only"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout
    assert "test_unknown_key" in process.stdout
    assert "deselected" in process.stdout


def test_the_area_of_tests_exists():
    assert list((ROOT / PYTEST[1].split()[1]).glob("test_*.py"))
