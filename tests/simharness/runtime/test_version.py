"""Versions of code: different code has different versions."""

import importlib.metadata
import re
import subprocess
import sys

from simharness.runtime import version
from simharness.runtime.version import code_version


def test_a_checkout_adds_the_digest_of_its_code():
    installed = importlib.metadata.version("simharness").partition("+")[0]
    assert re.fullmatch(re.escape(installed) + r"\+code\.[0-9a-f]{8}", code_version())


def test_an_installed_wheel_has_the_plain_version(tmp_path, monkeypatch):
    monkeypatch.setattr(version, "_PACKAGE", tmp_path / "site-packages" / "simharness")
    code_version.cache_clear()
    try:
        assert code_version() == importlib.metadata.version("simharness")
    finally:
        code_version.cache_clear()


def test_the_version_is_read_without_importing_the_method():
    code = "import sys; from simharness.runtime.version import *; code_version(); print(*sys.modules)"
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    assert "simharness.runtime.version" in loaded
    assert {each for each in loaded if each.startswith("mvpose.")} == {"mvpose.public_names"}  # a table of names
    assert not loaded & {"numpy", "numba", "scipy"}
