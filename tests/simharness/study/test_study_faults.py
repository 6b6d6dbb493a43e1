"""Studies that are killed, interrupted, or run out of disk space: no finished trial is lost, the store is clean."""

import contextlib
import os
import signal
import subprocess
import time

import psutil
import pytest
from fakes import Fake, called, made_up, program, run_program, study_of

from simharness.study.study_folder import plan
from simharness.study.study_run import run_study
from simharness.study.trial_store import Store


def store_is_clean(folder):
    """Assert that every entry of the store is complete and has the right scores.

    Returns:
        The number of finished trials. A trial that was killed between two variants is not finished.
    """
    store, finished = Store(folder / "out" / "store"), 0
    for each in plan(study_of(folder, cameras=(3, 4), seeds=3)):
        present = {variant: store.file_of(identity).exists() for variant, identity in each.entries.items()}
        for variant in (variant for variant, exists in present.items() if exists):
            assert store.read(each.entries[variant]).result.scores == made_up(each.scenario, variant).scores
        finished += all(present.values())
    assert not store.damaged
    return finished


def entries(folder):
    """Return the entries of the store so far, two for each finished trial."""
    return list(folder.glob("out/store/??/*.trial"))


def gone(process):
    """Return whether a process has ended, even if its parent has not waited for it."""
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def wait_for(condition, seconds=300.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.02)


@pytest.fixture
def start(tmp_path):
    """Start the program in a separate process group, as a shell does; kill the group after the test."""
    with contextlib.ExitStack() as stack:

        def started(**options):
            process = stack.enter_context(
                subprocess.Popen(
                    program(tmp_path, **options),
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                    start_new_session=True,
                )
            )
            stack.callback(end_group, process.pid)
            return process

        yield started


def end_group(group):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def check_resuming(folder, finished):
    """Assert that the same study runs the remaining trials and is complete."""
    fake = Fake(folder / "calls again")
    results = run_study(study_of(folder, cameras=(3, 4), seeds=3), out=folder / "out", measure=fake)
    assert (results.info["kept"], results.info["run"], results.info["failed"]) == (finished, 6 - finished, [])
    assert len(called(fake.calls)) == 6 - finished
    assert len(results.trials) == 12


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_study_keeps_finished_trials(tmp_path, start, workers):
    process = start(seconds=0.1, stuck=2, workers=workers)  # the trials of the last of three seeds never end
    wait_for(lambda: len(entries(tmp_path)) >= 8)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    finished = store_is_clean(tmp_path)
    assert finished == 4
    assert errors.splitlines()[-1] == "interrupted: 4 of 6 trials are stored; the same command continues"
    assert "Traceback" not in errors
    assert output == ""
    assert not (tmp_path / "out" / "views").exists()
    assert list(tmp_path.rglob("*.partial")) == []
    check_resuming(tmp_path, finished)


@pytest.mark.slow
def test_a_killed_parent_leaves_neither_workers_nor_a_broken_store(tmp_path, start):
    process = start(seconds=0.1, stuck=2, workers=2)  # the trials of the last of three seeds never end
    wait_for(lambda: len(entries(tmp_path)) >= 2)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) >= 2
    process.kill()
    process.communicate(timeout=120)
    wait_for(lambda: all(map(gone, workers)), 120)
    finished = store_is_clean(tmp_path)
    assert not (tmp_path / "out" / "views").exists()
    check_resuming(tmp_path, finished)


@pytest.mark.slow
def test_a_full_disk_is_reported_once_and_finished_trials_are_kept(tmp_path):
    done = run_program(tmp_path, file_size=200_000, large=1)  # from seed 1 on the disk is full
    assert done.returncode == 3
    message = done.stderr.splitlines()[-1]
    assert message.startswith("the study stopped: store ")
    assert "cannot be written: File too large" in message
    assert "run the same command again" in message
    assert "Traceback" not in done.stderr
    assert store_is_clean(tmp_path) == 2
    assert list(tmp_path.rglob("*.partial")) == []
    check_resuming(tmp_path, 2)
