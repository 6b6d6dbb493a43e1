"""A headless browser for tests of pages."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest


def find_browser() -> str:
    """Path of the browser; without one the test is skipped, or fails where SIMHARNESS_REQUIRE_BROWSER is set."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    missing = "no headless browser: install chromium"
    return (pytest.fail if os.environ.get("SIMHARNESS_REQUIRE_BROWSER") else pytest.skip)(missing)


def run_browser(browser: str, folder: Path, *arguments: str) -> tuple[str, str]:
    """Run the browser and return its output and its log; all of its processes are ended in every case."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
    with subprocess.Popen(
        [browser, *options, f"--user-data-dir={folder / 'profile'}", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            output, log = process.communicate(timeout=400)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 0, log
    return output, log
