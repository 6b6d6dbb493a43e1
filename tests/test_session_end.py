"""The end of the tests themselves."""

import signal
from pathlib import Path
from types import SimpleNamespace

import pytest


@pytest.mark.parametrize(("worker", "ignored"), [({"workerinput": {}}, True), ({}, False)])
def test_a_worker_that_has_finished_is_not_interrupted(request, worker, ignored):
    """Execnet interrupts workers that end slowly; Ctrl-C still ends a process that is no worker."""
    (conftest,) = (
        each
        for each in request.config.pluginmanager.get_plugins()
        if getattr(each, "__file__", None) == str(Path(__file__).with_name("conftest.py"))
    )
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a program in the background ignores it
    try:
        conftest.pytest_sessionfinish(SimpleNamespace(config=SimpleNamespace(**worker)))
        assert (signal.getsignal(signal.SIGINT) is signal.SIG_IGN) == ignored
    finally:
        signal.signal(signal.SIGINT, before)
