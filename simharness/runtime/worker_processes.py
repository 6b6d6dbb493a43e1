"""Start of worker processes.

A new Python process imports for two seconds what a trial needs, and a run with two workers starts two processes in each
of its stages. On Linux workers are therefore forked from a server process that has imported most of it and has done
nothing else. They are never forked from this process, which may hold threads or a GL context.
"""

from __future__ import annotations

import multiprocessing
import sys
from multiprocessing import forkserver
from multiprocessing.context import BaseContext

IMPORTED = ("simharness.trial.stages.build_trial", "simharness.trial.stages.simulation", "distributed")
"""Modules that the server imports. With them come neither Polars nor ONNX Runtime, which start threads on import."""


def worker_context() -> BaseContext:
    """Return the multiprocessing context of workers: "forkserver" on Linux, "spawn" where system libraries cannot fork.

    The server keeps the environment variables and the output streams that this process had at the first call.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(IMPORTED))
    forkserver.ensure_running()
    return context
