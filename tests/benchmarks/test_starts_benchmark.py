"""Benchmark of starts: what its command prints of a recording whose starts are found, and its rigs that are off."""

import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.method.scenes import ring
from benchmarks.starts.__main__ import main, turned


@pytest.mark.slow
def test_starts_of_the_first_recording_are_found(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["starts", "--count", "1"])
    main()
    first, total = capsys.readouterr().out.splitlines()
    assert first.startswith("0: 3 cameras, ")
    assert total == "1 of 1 within a frame, 0 wrong, 0 refused"


def test_cameras_are_turned_about_their_centers():
    rig = ring(4, 2)
    off = turned(rig, 0.5, 3)
    np.testing.assert_allclose(off.centers, rig.centers, atol=1e-12)
    angles = [Rotation.from_matrix(b.R @ a.R.T).magnitude() for a, b in zip(rig, off, strict=True)]
    np.testing.assert_allclose(np.degrees(angles), 0.5)
