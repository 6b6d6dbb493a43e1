import gc
import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# What a terminal or a CI service says of itself would change what is printed: rich and typer read these on import.
for _name in ("FORCE_COLOR", "CLICOLOR_FORCE", "PY_COLORS", "GITHUB_ACTIONS", "TERMINAL_WIDTH", "TTY_COMPATIBLE"):
    os.environ.pop(_name, None)

# Every worker of xdist rewrites the assertions of 470 modules, and tests start a hundred processes: what Python
# compiles is kept beside the sources, even where the environment of the caller says otherwise.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Kernels compile on first use, and machines are noisy: a deadline would time those, not the code.
settings.register_profile("usual", deadline=None, max_examples=15, derandomize=True)  # the same draws everywhere
settings.register_profile(
    "nightly", deadline=None, max_examples=200
)  # others every time: SIMHARNESS_HYPOTHESIS=nightly
settings.load_profile(os.environ.get("SIMHARNESS_HYPOTHESIS", "usual"))


def pytest_collection_finish() -> None:
    """Keep the garbage collector from walking over modules, kernels and thousands of tests again and again.

    With the usual thresholds it takes a fifth of the time of the suite.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Let a worker of xdist end without an interruption.

    Execnet sends SIGINT to a worker that needs more than five seconds for it. On a busy machine the last collections of
    garbage do, and the KeyboardInterrupt comes in Hypothesis' callback of the collector, which pytest then reports.
    """
    if hasattr(session.config, "workerinput"):
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real evaluation data; skips where it is absent."""
    default = Path(__file__).parents[1] / ".." / "shared" / "data"
    folder = Path(os.environ.get("SIMHARNESS_DATA", default)).resolve()
    if not (folder / "shelf").is_dir():
        pytest.skip(f"no evaluation data in {folder}; set SIMHARNESS_DATA to the folder that holds shelf/")
    return folder
