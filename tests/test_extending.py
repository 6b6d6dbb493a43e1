"""Worked examples of docs/extending.md, applied to a copy of both packages and run there."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
SECTIONS = {part.partition("\n")[0]: part for part in re.split(r"^## ", PAGE, flags=re.M)[1:]}
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_USE = "# use\n"
_USE_EACH = """
import json, sys, traceback
outcomes = {}
for name, blocks in json.loads(sys.argv[1]).items():
    outcomes[name] = ""
    for block in blocks:
        if block.startswith("# use"):
            try:
                exec(compile(block, name, "exec"), {"__name__": name})
            except BaseException:
                outcomes[name] += traceback.format_exc()
print()
print(json.dumps(outcomes))
"""


def blocks(language: str, text: str = PAGE) -> list[str]:
    return [block for name, block in _FENCE.findall(text) if name == language]


def apply(diff: str, root: Path) -> None:
    """Apply a diff whose hunks have no line numbers: the old lines of each must occur exactly once in the file."""
    header, *hunks = re.split(r"^@@\n", diff, flags=re.M)
    file = root / header.removeprefix("+++ ").strip()
    text = file.read_text(encoding="utf-8")
    for hunk in hunks:
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line[0] in " -")
        new = "".join(line[1:] for line in lines if line[0] in " +")
        assert text.count(old) == 1, f"{file}: {text.count(old)} places have these lines, expected one:\n{old}"
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")


def write(block: str, root: Path) -> None:
    """Write a new file, whose first line is a comment with its path."""
    path, _, content = block.partition("\n")
    file = root / path.removeprefix("# ").removeprefix("<!-- ").removesuffix(" -->")
    assert not file.exists(), f"{file} exists already"
    file.write_text(content, encoding="utf-8")


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """Return a folder with both packages, all examples applied; compiled kernels are copied as well."""
    root = tmp_path_factory.mktemp("extended")
    for folder in ("mvpose", "simharness", "scenarios"):
        shutil.copytree(ROOT / folder, root / folder, ignore=shutil.ignore_patterns("build", "*.egg-info"))
    for block in [*blocks("python"), *blocks("xml")]:
        if not block.startswith(_USE):
            write(block, root)
    for block in blocks("diff"):
        apply(block, root)
    return root


def run(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the folder, with the packages that are in it."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=root,
        env={**environment, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_every_extension_is_used():
    assert list(SECTIONS) == [
        "An activity",
        "An object",
        "A detector error",
        "A calibration format",
        "A format of detections",
        "A format of people",
        "A score",
        "A plot",
        "A matching method",
        "A tracker",
    ]
    for name, text in SECTIONS.items():
        python = blocks("python", text)
        assert any(block.startswith(_USE) for block in python), name
        assert any(not block.startswith(_USE) for block in python) or blocks("xml", text), name
    assert {language for language, _ in _FENCE.findall(PAGE)} == {"python", "diff", "xml"}


def test_the_changes_fit_the_code(tmp_path):
    for block in blocks("diff"):
        path = re.match(r"\+\+\+ (\S+)", block)[1]
        file = tmp_path / path
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, file)
        apply(block, tmp_path)


@pytest.mark.slow
def test_the_copy_is_what_runs(extended):
    process = run(extended, "-c", "import mvpose, simharness; print(mvpose.__file__, simharness.__file__)")
    assert process.stdout.split() == [str(extended / name / "__init__.py") for name in ("mvpose", "simharness")]


@pytest.fixture(scope="module")
def outcomes(extended):
    """Return the traceback of the use of every extension, empty where it works: one process loads the kernels once."""
    process = run(
        extended, "-c", _USE_EACH, json.dumps({name: blocks("python", text) for name, text in SECTIONS.items()})
    )
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize("name", SECTIONS)
def test_an_extension_works(outcomes, name):
    assert outcomes[name] == ""


@pytest.mark.slow
def test_examples_pass_the_linter(extended):
    pytest.importorskip("ruff")
    shutil.copy(ROOT / "pyproject.toml", extended)
    files = re.findall(r"^(?:# |\+\+\+ )(\S+\.py)$", PAGE, flags=re.M)
    assert len(files) > 10
    process = run(extended, "-m", "ruff", "check", *files)
    assert process.returncode == 0, process.stdout
