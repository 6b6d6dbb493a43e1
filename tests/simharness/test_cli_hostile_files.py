"""Hostile files given to commands: exit code 2 and one line of bounded length."""

import os
import subprocess
import sys

import pytest

SECONDS = 120.0  # of waiting for a command; a command that waits for a pipe would never end
CONTENTS = {
    "nested JSON": b"[" * 100_000,
    "nested TOML": b"a = " + b"[" * 100_000,
    "long key": b".".join([b"a"] * 50_000) + b" = 1",
    "long value": b'name = "x"\nrate = "' + b"y" * 250_000 + b'"',
    "many bad keys": b'name = "x"\n' + b"".join(b"key%d = %d\n" % (k, k) for k in range(10_000)),
    "control characters": b'name = "x"\n"\\u001b[31m\\n" = 1',
    "pipe": None,
}


@pytest.mark.slow
@pytest.mark.parametrize("content", CONTENTS)
def test_a_hostile_scenario_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "hostile.toml"
    if CONTENTS[content] is None:
        os.mkfifo(path)
    else:
        path.write_bytes(CONTENTS[content])
    result = run("show", str(path))
    assert_refused(result)
    assert "hostile.toml" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("content", ["nested JSON", "pipe"])
def test_a_hostile_baseline_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "hostile.json"
    if CONTENTS[content] is None:
        os.mkfifo(path)
    else:
        path.write_bytes(CONTENTS[content])
    assert_refused(run("check", "ci", "--baseline", str(path)))


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "simharness.cli", *arguments],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


def assert_refused(result):
    assert (result.returncode, result.stdout) == (2, ""), result.stderr[-2000:]
    assert len(result.stderr.splitlines()) == 1, result.stderr[-2000:]
    assert result.stderr.startswith("error: ")
    assert len(result.stderr) <= 520
