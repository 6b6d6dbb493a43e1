"""Shipped failures: small, named as their files, and failing exactly where the method is known to fail."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.hunt.kept_failure import read_failure, write_failure
from simharness.hunt.shrinking import LEAST_CAMERAS

FILES = sorted((Path(__file__).parents[3] / "scenarios" / "failures").glob("*.toml"))


def test_known_failures_are_shipped():
    assert FILES


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_failure_is_small_and_fails_where_it_is_known_to(path, tmp_path):
    failure = read_failure(path)
    assert failure.name == path.stem
    assert len(failure.people) <= 3
    assert len(failure.cameras) == LEAST_CAMERAS
    assert failure.noise_failed >= 0.8 * failure.noise_seeds > 0
    assert failure.replay()[1] != failure.mended
    assert write_failure(failure, tmp_path).read_bytes() == path.read_bytes()


def test_a_folder_is_checked_as_a_suite(tmp_path):
    """What is mended must stay so; what fails as known is no red gate, and neither is what fails no more."""
    known, again, *_ = FILES
    shutil.copy(known, tmp_path)
    assert check(tmp_path).exit_code == 0
    right = read_failure(again).model_copy(update={"errors": (), "name": "right"})
    write_failure(right, tmp_path)
    output = check(tmp_path).output
    assert f"{known.stem}: fails, as known" in output
    assert "right: does not fail any more: set mended = true" in output
    write_failure(right.model_copy(update={"mended": True}), tmp_path)
    assert "right: is right" in check(tmp_path).output
    write_failure(read_failure(again).model_copy(update={"mended": True}), tmp_path)
    red = check(tmp_path)
    assert red.exit_code == 1
    assert f"{again.stem}: fails again" in red.output


def test_options_of_suites_and_folders_without_failures_are_refused(tmp_path):
    assert "expected kept failures" in check(tmp_path).output
    shutil.copy(FILES[0], tmp_path)
    result = check(tmp_path, "--workers", "2")
    assert result.exit_code == 2
    assert "--workers: kept failures are replayed as they are" in result.output


def check(folder, *options):
    return CliRunner().invoke(app, ["check", str(folder), *options])
