"""Shipped failures: small, named as their files, and failing exactly where the method is known to fail."""

from pathlib import Path

import pytest

from simharness.hunt.kept_failure import read_failure, write_failure
from simharness.hunt.shrinking import LEAST_CAMERAS

FILES = sorted((Path(__file__).parents[3] / "scenarios" / "failures").glob("*.toml"))

FAILING = {
    "crowd-ghost-54b633",
    "crowd-merged-488c19",
    "crowd-split-c1d7e7",
    "crowd-swapped-limb-11e4fc",
    "crowd-swapped-limb-357bf0",
}
"""Failures that the method still has. A mended one leaves this list, and its file stays."""


def test_known_failures_are_shipped():
    assert {path.stem for path in FILES} >= FAILING
    assert FAILING


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_failure_is_small_and_fails_where_it_is_known_to(path, tmp_path):
    failure = read_failure(path)
    assert failure.name == path.stem
    assert len(failure.people) <= 3
    assert len(failure.cameras) == LEAST_CAMERAS
    assert failure.noise_failed >= 0.8 * failure.noise_seeds > 0
    assert failure.replay()[1] == (path.stem in FAILING)
    assert write_failure(failure, tmp_path).read_bytes() == path.read_bytes()
