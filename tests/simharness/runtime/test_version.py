"""Two different codes do not share a version."""

import importlib.metadata
import re
import subprocess
import sys

from simharness.runtime import version
from simharness.runtime.version import code_version

SOURCE = '"""A module."""\n\nVALUE = 1  # a comment\n'


def test_a_checkout_adds_the_digest_of_its_code():
    installed = importlib.metadata.version("simharness").partition("+")[0]
    assert re.fullmatch(re.escape(installed) + r"\+code\.[0-9a-f]{8}", code_version())


def test_an_installed_wheel_has_its_version_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(version, "_PACKAGE", tmp_path / "site-packages" / "simharness")
    code_version.cache_clear()
    try:
        assert code_version() == importlib.metadata.version("simharness")
    finally:
        code_version.cache_clear()


def test_statements_and_names_of_files_count_and_comments_do_not(tmp_path):
    def digest(name="module.py", text=SOURCE):
        folder = tmp_path / str(len(list(tmp_path.iterdir()))) / "package"
        folder.mkdir(parents=True)
        (folder / name).write_text(text)
        return version._code_digest(folder)

    assert digest() == digest() == digest(text=SOURCE.replace("  # a comment", ""))
    others = {digest(text=SOURCE.replace("1", "2")), digest(name="other.py"), digest(text="")}
    assert len({digest(), *others}) == 4


def test_a_file_that_does_not_parse_counts_by_its_text(tmp_path):
    digests = set()
    for text in ("def f(:", "def g(:"):
        (tmp_path / "module.py").write_text(text)
        digests.add(version._code_digest(tmp_path))
    assert len(digests) == 2


def test_what_a_build_leaves_does_not_count(tmp_path):
    (tmp_path / "module.py").write_text(SOURCE)
    before = version._code_digest(tmp_path)
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "module.py").write_text(SOURCE)
    assert version._code_digest(tmp_path) == before


def test_the_version_is_read_without_importing_the_method():
    code = "import sys; from simharness.runtime.version import *; code_version(); print('mvpose' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
