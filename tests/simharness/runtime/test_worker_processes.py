"""Workers start from a server process that may be forked, with the modules that a trial needs."""

import os
import subprocess
import sys

import pytest

from simharness.runtime.frame_pool import IMPORTED, worker_context

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are spawned on this system")


def modules_and_parent(*_):
    return set(sys.modules), os.getppid()


def test_workers_have_a_parent_that_has_imported_for_them():
    with worker_context().Pool(1) as pool:
        modules, parent = pool.apply(modules_and_parent)
    assert parent != os.getpid()
    assert {*IMPORTED, "mujoco", "numba", "scipy.optimize"} <= modules


@pytest.mark.slow
def test_the_server_starts_no_threads_but_those_of_openblas():
    """A thread does not survive a fork, and a lock that it holds is never released; OpenBLAS starts its own again."""
    script = f"import os, sys, {', '.join(IMPORTED)}; print(len(os.listdir('/proc/self/task')), *sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    threads, *modules = done.stdout.split()
    assert threads == "1"
    assert not {"polars", "onnxruntime", "pyrender", "OpenGL"} & set(modules)
