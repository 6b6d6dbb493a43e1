"""A program behind a pipe: its bounds, its messages, and that nothing it starts is left running."""

import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from moments import crowd, moment, ring
from typer.testing import CliRunner

from mvpose.commands.errors import MethodError
from simharness import ForeignProgram
from simharness.cli import app

CHILD = "sleep 300 & echo $! >> pids; "
RIG = ring(3)
SEEN, _ = moment(RIG, crowd(1, spacing=1.2))


@pytest.fixture(autouse=True)
def pids(tmp_path, monkeypatch):
    """Let programs write the identities of their processes into a file, and check that none is left."""
    monkeypatch.chdir(tmp_path)
    yield
    if (file := tmp_path / "pids").exists():
        left = [int(each) for each in file.read_text().split()]
        assert left
        assert wait_for(lambda: not any(map(running, left))), f"{left} are still running"


def running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def shell(text, **bounds):
    return ForeignProgram(["/bin/sh", "-c", f"echo $$ >> pids; {text}"], **bounds)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sleep 300", r"did not answer within 0\.5 s; its standard error is empty"),
        (f"{CHILD} echo loading >&2; wait", r"did not answer within 0\.5 s; its standard error ends: loading"),
        ("exec >&- 2>&-; sleep 300", r"did not answer within 0\.5 s"),
        ("while :; do echo warning >&2; done", r"did not answer within 0\.5 s; its standard error ends: .*warning"),
        (f"{CHILD} echo first >&2; echo no weights >&2; exit 4", r"ended with exit code 4; .*: first \| no weights"),
        (f"{CHILD} kill -SEGV $$", "was ended by SIGSEGV"),
        ("(while :; do echo; done) & echo $! >> pids; exit 5", "ended with exit code 5"),
    ],
)
def test_what_goes_wrong_is_one_line_within_the_bounds(text, message):
    program, start = shell(text, seconds=0.5), time.monotonic()
    with pytest.raises(MethodError, match=rf'^the program "/bin/sh -c .*" {message}') as failure:
        program.run("{}")
    assert time.monotonic() - start < 10
    assert "\n" not in str(failure.value)
    assert len(str(failure.value)) < 600


def test_the_output_is_bounded_while_it_comes():
    """The program would write 100 GB; its bound is reached long before its time."""
    with pytest.raises(MethodError, match=r"wrote more than 0\.5 MiB"):
        shell("head -c 100000000000 /dev/zero", seconds=300, megabytes=0.5).run("{}")


def test_a_program_that_cannot_be_started():
    with pytest.raises(MethodError, match=r'^the program "\./nothing" cannot be started: No such file'):
        ForeignProgram(["./nothing"]).run("{}")


def test_all_of_a_long_answer_arrives_and_children_are_ended():
    text = json.dumps(list(range(200_000)))
    assert shell(f"{CHILD} cat", seconds=60).run(text) == text
    assert shell(f"{CHILD} echo warned >&2; echo answer").run(text) == "answer\n"  # which does not read its input


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("", "JSONDecodeError"),
        ('{"joints": [[', "JSONDecodeError"),
        ("[1, 2]", "TypeError: .*begins .*1, 2"),
        ('{"people": []}', "KeyError: 'joints'"),
        ('{"joints": [[[0, 0, 0]]]}', r"joints must be \(n, 17, 3\), got \(1, 1, 3\)"),
        ("[" * 100_000, "nested"),
    ],
)
def test_answers_that_are_none(answer, message):
    Path("answer").write_text(answer)
    with pytest.raises(MethodError, match=f'^the program "cat answer" wrote no JSON object with "joints".*{message}'):
        ForeignProgram(["cat", "answer"]).estimate(RIG, SEEN)


def test_an_estimate_is_that_of_the_answer():
    joints = [[[0.5, None, 1.0]] + [[1.0, 2.0, 3.0]] * 16]
    labels = [0] + [-1] * (len(SEEN) - 1)
    Path("answer").write_text(json.dumps({"joints": joints, "labels": labels, "scores": [0.25]}))
    estimate = ForeignProgram(["sh", "-c", "cat > request; cat answer"]).estimate(RIG, SEEN)
    assert np.isnan(estimate.joints[0, 0]).all()
    np.testing.assert_array_equal(estimate.joints[0, 1:], [[1.0, 2.0, 3.0]] * 16)
    assert estimate.matching.labels.tolist() == labels
    assert estimate.scores[0].tolist() == [0.0] + [0.25] * 16
    request = json.loads(Path("request").read_text())
    assert request["names"][0] == "nose"
    np.testing.assert_array_equal(request["P"], RIG.P)
    np.testing.assert_allclose(request["keypoints"], np.nan_to_num(SEEN.keypoints), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_it_ends_with_the_process_that_started_it(number, tmp_path):
    text = (
        f"from simharness import ForeignProgram\nForeignProgram(['sh', '-c', 'echo $$ > pids; {CHILD} wait']).run('')"
    )
    parent = subprocess.Popen([sys.executable, "-c", text], stderr=subprocess.DEVNULL)
    try:
        assert wait_for(lambda: (file := tmp_path / "pids").exists() and len(file.read_text().split()) == 2)
        parent.send_signal(number)
        assert parent.wait(20) != 0
    finally:
        parent.kill()


@pytest.mark.slow
def test_a_command_ends_with_one_line_and_exit_code_3():
    Path("wrapped.py").write_text(
        "from simharness import ForeignProgram\n"
        "foreign = ForeignProgram(['sh', '-c', 'echo $$ >> pids; echo no weights in ./w >&2; exit 2'])\n"
        "class Mistaken:\n    def estimate(self, rig, detections):\n        return detections.keypoint\n"
    )
    for name, message in {
        "foreign": 'the program "sh -c .*" ended with exit code 2; its standard error ends: no weights in ./w',
        "Mistaken": r"AttributeError: 'Detections' object has no attribute 'keypoint' \(wrapped.py, line 5\)",
    }.items():
        options = (f'method.estimators.own="wrapped.py:{name}"', 'variants=["own"]', "duration=0.2")
        sets = itertools.chain.from_iterable(("--set", each) for each in (*options, 'rendering.renderer="rays"'))
        result = CliRunner().invoke(app, ["run", "quickstart", *sets, "--out", "runs"])
        assert result.exit_code == 3
        lines = [line for line in result.stderr.splitlines() if "failed:" in line or "Traceback" in line]
        (line,) = lines
        assert re.search(rf"^failed: estimate: frame \d: own \(wrapped.py:{name}\): {message}", line)


def test_no_guard_is_left():
    before = len(os.listdir(f"/proc/{os.getpid()}/fd"))
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text()
    for _ in range(3):
        shell("echo").run("")
    assert len(os.listdir(f"/proc/{os.getpid()}/fd")) == before
    assert Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text() == children
