"""Formats of ``mvpose estimate``, and what their files are to be like."""

import io
import json
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


@pytest.mark.slow
def test_files_have_the_axis_up_and_those_for_our_own_commands_do_not(lab, tmp_path):
    out = tmp_path / "out"
    options = ("--format", "trc,csv,c3d,bvh,gltf,lengths,json,opensim,mot,angles", "--files-up", "y", "--together")
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
    assert {"person_0.mot", "person_1_angles.csv", "person_0_scale.xml", "opensim_markers.xml"} <= names


def test_a_wrong_axis_is_found_before_anything_is_read(lab, tmp_path):
    result = estimate(lab / "nothing", tmp_path / "out", "--files-up", "x")
    assert result.exit_code == 2
    assert "--files-up must be y or z, got 'x'" in result.stderr


@pytest.mark.slow
def test_what_is_left_out_is_told_in_the_note_the_manifest_and_the_page(lab, tmp_path):
    options = ("--method", "track-fast", "--format", "trc,bvh", "--max-error", "0.03", "--page")
    result = estimate(lab, tmp_path / "out", *options)
    assert result.exit_code == 0, result.output
    assert "note: left out: " in result.stderr
    about = json.loads((tmp_path / "out" / "inputs.json").read_text())
    left_out = about["left_out"]
    assert left_out["limits"] == {"max_error": 0.03, "max_speed": 24.8, "min_frames": 5}
    assert left_out["joints"]["uncertain"] > 0
    table = pl.read_parquet(tmp_path / "out" / "poses.parquet")
    assert len(table) == left_out["joints_before"] - sum(left_out["joints"].values()) > 0
    assert [each["frames"] for each in about["people"]] == [
        table.filter(pl.col("person") == each["id"])["frame"].n_unique() for each in about["people"]
    ]
    sentence = f"{left_out['joints']['uncertain']} joints with an expected error above 0.03 m"
    assert sentence in result.stderr
    assert sentence in (tmp_path / "out" / "recording.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "out" / "recording.json").read_text())["left_out"] == left_out


def test_without_limits_everything_is_written(lab, tmp_path):
    limits = ("--max-error", "inf", "--max-speed", "inf", "--min-frames", "1")
    assert estimate(lab, tmp_path / "out", "--method", "track-fast", "--format", "", *limits).exit_code == 0
    left_out = json.loads((tmp_path / "out" / "inputs.json").read_text())["left_out"]
    assert left_out["limits"] == {"max_error": None, "max_speed": None, "min_frames": 1}
    assert len(pl.read_parquet(tmp_path / "out" / "poses.parquet")) == left_out["joints_before"]


@pytest.mark.parametrize("option", ["--max-error", "--max-speed", "--min-frames"])
def test_a_limit_of_zero_is_refused(lab, tmp_path, option):
    result = estimate(lab, tmp_path / "out", option, 0)
    assert result.exit_code == 2
    assert f"{option} must be above 0" in result.stderr
