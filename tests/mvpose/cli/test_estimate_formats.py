"""Formats of ``mvpose estimate``, and what their files are to be like."""

import io
import warnings

import numpy as np
import polars as pl
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    rig, _, pixels = filmed(frames=6)
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    write_openpose(folder / "openpose", [camera.name for camera in rig], pixels)
    return folder


def estimate(lab, out, *options):
    given = ("estimate", lab / "Calib.toml", lab / "openpose", "--out", out, "--fps", 25, "--no-page", *options)
    return CliRunner().invoke(app, [str(each) for each in given])


def test_files_have_the_axis_up_and_those_for_our_own_commands_do_not(lab, tmp_path):
    out = tmp_path / "out"
    options = ("--format", "trc,csv,c3d,bvh,gltf,lengths,json", "--files-up", "y", "--together")
    result = estimate(lab, out, "--method", "track-fast", *options)
    assert result.exit_code == 0, result.output
    ours, turned = pl.read_parquet(out / "poses.parquet"), pl.read_csv(out / "poses.csv")
    for axis, old in {"x": "y", "y": "z", "z": "x"}.items():
        np.testing.assert_allclose(turned[axis], ours[old], atol=1e-6)
    c3d = pytest.importorskip("c3d")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(io.BytesIO((out / "people.c3d").read_bytes()))
    assert reader.point_used == 34
    assert reader.get("POINT:Y_SCREEN").string_value == "+Y"
    names = {path.name for path in out.iterdir()}
    assert {"person_0.bvh", "person_1.trc", "people.glb", "bone_lengths.csv", "people.json"} <= names


def test_a_wrong_axis_is_found_before_anything_is_read(lab, tmp_path):
    result = estimate(lab / "nothing", tmp_path / "out", "--files-up", "x")
    assert result.exit_code == 2
    assert "--files-up must be y or z, got 'x'" in result.stderr
