"""Working directories of the tests of the documentation."""

from __future__ import annotations

import pytest
from doc_pages import ROOT, toml_file
from easy_suite import EASY
from suites import remember_scenes


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Return a folder like that of a checkout, with the files that the pages write."""
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    for name in ("my-lab.toml", "night.toml"):
        (tmp_path / name).write_text(toml_file(name), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def easy_workplace(tmp_path, monkeypatch):
    """Return a folder like that of a checkout, with an easy suite."""
    remember_scenes(monkeypatch)
    (tmp_path / "ci.toml").write_text(EASY)  # a file in the working directory goes before a shipped scenario
    monkeypatch.chdir(tmp_path)
    return tmp_path
