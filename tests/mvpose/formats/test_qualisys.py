"""Calibrations of Qualisys: its formula, what is wrong with a file, and a real one."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.formats.calibration.calibration_formats import read_calibration

CAMERA = """<camera active="{active}" model="{model}" serial="{name}" viewrotation="{turn}">
<fov_video left="16" top="0" right="815" bottom="599"/>
<transform x="{x}" y="-2000" z="1500" r11="{r[0]}" r12="{r[1]}" r13="{r[2]}" r21="{r[3]}" r22="{r[4]}" r23="{r[5]}"
 r31="{r[6]}" r32="{r[7]}" r33="{r[8]}"/>
<intrinsic focalLengthU="51200" focalLengthV="51840" centerPointU="26624" centerPointV="19200" skew="0"
 radialDistortion1="-0.05" radialDistortion2="0.1" radialDistortion3="0" tangentalDistortion1="0.001"
 tangentalDistortion2="0.002"/></camera>"""
# A camera that looks along the world's y axis: right is x, up is z, backwards is -y.
ALONG_Y = (1, 0, 0, 0, 0, 1, 0, -1, 0)


def text(*cameras):
    values = {"active": 1, "model": "none", "turn": 0, "r": ALONG_Y, "x": 0}
    entries = [CAMERA.format(**{**values, "name": f"c{k}", "x": 1000 * k, **each}) for k, each in enumerate(cameras)]
    return f"<?xml version='1.0'?>\n<calibration><cameras>{''.join(entries)}</cameras></calibration>"


@pytest.fixture
def read(tmp_path):
    def read(content):
        path = tmp_path / "Calib.qca.txt"
        path.write_text(content)
        return read_calibration(path, size=(1, 1))

    return read


def test_a_camera_that_looks_along_y(read):
    rig = read(text({}, {}))
    assert [each.name for each in rig] == ["c0", "c1"]
    assert rig[0].size == (800, 600)
    np.testing.assert_allclose(rig.centers, [[0, -2, 1.5], [1, -2, 1.5]])
    # Straight ahead is the principal point, less the pixels left of the picture; above is higher in the picture.
    np.testing.assert_allclose(rig[0].project([[0, 3, 1.5]]), [[26624 / 64 - 16, 300]])
    assert rig[0].project([[0, 3, 1.8]])[0, 1] < 290
    assert rig[0].project([[0.3, 3, 1.5]])[0, 0] > 410
    np.testing.assert_allclose(rig[0].K, [[800, 0, 400], [0, 810, 300], [0, 0, 1]])
    np.testing.assert_allclose(rig[0].distortion, [-0.05, 0.1, 0.001, 0.002, 0])


def test_any_rotation(read):
    axes = Rotation.from_euler("zyx", [20, -30, 100], degrees=True).as_matrix()
    rig = read(text({"r": axes.ravel()}, {}))
    ahead = rig[0].center - 2.0 * axes[2]
    seen = rig[0].R @ np.array([ahead + 0.1 * axes[0], ahead + 0.1 * axes[1]]).T + rig[0].t[:, None]
    np.testing.assert_allclose(seen.T, [[0.1, 0, 2], [0, -0.1, 2]], atol=1e-12)


def test_cameras_that_record_no_video_are_left_out(read):
    rig = read(text({"model": "Miqus M3"}, {"model": "Miqus Video"}, {"active": 0}, {"model": "Miqus Hybrid Video"}))
    assert [each.name for each in rig] == ["c1", "c3"]
    assert len(read(text({"model": "Oqus"}, {"model": "Oqus"}))) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda given: given[: len(given) // 2], "expected a Qualisys calibration"),
        (lambda given: given.replace("<transform", "<moved"), "camera 'c0' lacks <transform>"),
        (lambda given: given.replace("skew", "slant"), "<intrinsic> lacks 'skew'"),
        (lambda given: given.replace('"51200"', '"wide"'), "<intrinsic>: could not convert"),
        (lambda given: given.replace('viewrotation="0"', 'viewrotation="90"'), "viewrotation 90"),
        (lambda given: given.replace("<calibration>", '<!DOCTYPE a [<!ENTITY b "c">]><calibration>'), "document type"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(read, change, message):
    given = text({}, {})
    assert change(given) != given
    with pytest.raises(ValueError, match=message) as error:
        read(change(given))
    assert "\n" not in str(error.value)


def test_the_calibration_of_pose2sim_is_that_which_it_made_of_it(shared_data):
    """Pose2Sim's own conversion is beside the file; it divides the distortion by 64, which belongs to pixels alone."""
    folder = shared_data / "pose2sim" / "body25b"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not on this machine")
    ours, theirs = (read_calibration(folder / name, size=(1, 1)) for name in ("Calib.qca.txt", "Calib_qualisys.toml"))
    assert len(ours) == 4
    for one, other in zip(ours, theirs, strict=True):
        assert (one.name, one.size) == (other.name, other.size)
        for key in ("K", "R", "t"):
            np.testing.assert_allclose(getattr(one, key), getattr(other, key), atol=1e-9)
        np.testing.assert_allclose(one.distortion, 64 * other.distortion, atol=1e-9)


@pytest.mark.parametrize(
    "command", [("repair", "c.xml", "nowhere", "--out", "new"), ("calibrate", "nowhere", "--intrinsics", "c.xml")]
)
def test_what_cannot_be_written_is_refused_before_anything_is_estimated(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Path("c.xml").write_text(text({}, {}), encoding="utf-8")
    result = CliRunner().invoke(app, [*command, *(("--out", "new") if "--out" not in command else ())])
    assert result.exit_code == 2
    assert "c.xml: calibrations of Qualisys" in result.stderr
    assert "not written" in result.stderr
