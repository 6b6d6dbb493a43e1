"""COLMAP models: round trip, its formulas against OpenCV's projection, and what is refused."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from lab_files import studio
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.formats.calibration import colmap
from mvpose.formats.calibration.calibration_formats import read_calibration, write_like

SIZE = (7, 8)  # of files without one


def model(folder, lens="PINHOLE 1032 776 700 710 516 388", names=("cam1/0001.png", "cam2/0001.png")):
    """Write a model of two pictures of one lens, 3 m to the left and right of the z axis and 2 m above the floor."""
    (folder / "cameras.txt").write_text(f"# Camera list\n1 {lens}\n")
    lines = ["# Image list", "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"]
    for number, (name, side) in enumerate(zip(names, (3.0, -3.0), strict=True), 1):
        s = np.sign(side)
        R = np.array([[0.0, s, 0.0], [0.0, 0.0, -1.0], [-s, 0.0, 0.0]])  # right, down, forward
        x, y, z, w = Rotation.from_matrix(R).as_quat()
        t = -R @ [side, 0.0, 2.0]
        lines += [
            f"{number} {w} {x} {y} {z} {t[0]} {t[1]} {t[2]} 1 {name}",
            "12.5 300.25 -1 14 20 7" if side > 0 else "",
        ]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    return folder


def refused(folder, match):
    with pytest.raises(ValueError, match=match):
        read_calibration(folder, size=SIZE)


@st.composite
def rigs(draw):
    """Cameras on a circle that look inwards, with any lens."""
    cameras = []
    for number, name in enumerate(
        draw(
            st.lists(
                st.text("ab.é _1", min_size=1, max_size=5).filter(
                    lambda each: each == each.strip() and each.strip(".")
                ),
                min_size=2,
                max_size=5,
                unique=True,
            )
        )
    ):
        fx, fy, cx, cy = (draw(st.floats(100, 3000)) for _ in range(4))
        terms = [draw(st.floats(-1, 1)) for _ in range(4)] + [draw(st.just(0.0) | st.floats(-1, 1))]
        R = Rotation.from_rotvec([draw(st.floats(-1.8, 1.8)) for _ in range(3)]).as_matrix()
        t = np.array([draw(st.floats(-5, 5)) for _ in range(3)]) + number
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        cameras.append(Camera(K=K, R=R, t=t, distortion=np.array(terms), size=(900, 800 + number), name=name))
    centers = np.array([camera.center for camera in cameras])
    assume(np.ptp(centers, axis=0).max() > 1e-3)
    return Rig(cameras)


@given(rigs())
def test_a_written_model_is_read_back(rig):
    with TemporaryDirectory() as folder:
        colmap.write_calibration(Path(folder) / "cameras.txt", rig)
        read = colmap.read_calibration(Path(folder) / "cameras.txt")
    for one, two in zip(read, rig, strict=True):
        assert (one.name, one.size) == (two.name, two.size)
        np.testing.assert_allclose(one.K, two.K, rtol=1e-12)
        np.testing.assert_allclose(one.R, two.R, atol=1e-12)
        np.testing.assert_allclose([*one.t, *one.distortion], [*two.t, *two.distortion], atol=1e-12)


def test_a_model_projects_as_colmap_defines_it(tmp_path):
    """The point (0, 0, 1) by hand: pixels count from the corner in COLMAP, from the centre here."""
    rig = read_calibration(model(tmp_path), size=SIZE)
    assert [camera.name for camera in rig] == ["cam1", "cam2"]
    assert rig[0].size == (1032, 776)
    np.testing.assert_allclose(rig.centers, [[3, 0, 2], [-3, 0, 2]], atol=1e-12)
    for camera in rig:
        u, v = camera.project(np.array([0.0, 0.0, 1.0]))
        assert (u, v) == pytest.approx((516 - 0.5, 388 - 0.5 + 710 / 3))


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("SIMPLE_PINHOLE", "700 516 388"),
        ("SIMPLE_RADIAL", "700 516 388 0.1"),
        ("RADIAL", "700 516 388 0.1 0.2"),
        ("OPENCV", "700 710 516 388 0.1 0.2 0.01 0.02"),
        ("FULL_OPENCV", "700 710 516 388 0.1 0.2 0.01 0.02 0.3 0 0 0"),
    ],
)
def test_lens_models_have_their_parameters_in_order(tmp_path, name, numbers):
    camera = read_calibration(model(tmp_path, f"{name} 1032 776 {numbers}"), size=SIZE)[0]
    given = dict(zip(colmap.MODELS[name].split(), map(float, numbers.split()), strict=True))
    assert camera.K[0, 0] == 700
    assert camera.K[1, 1] == (710 if "fy" in given else 700)
    assert camera.distortion.tolist() == [given.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")]


def test_pictures_of_cameras_in_one_folder_have_the_names_of_files_in_the_order_of_their_numbers(tmp_path):
    lines = (model(tmp_path, names=("rig/b.png", "rig/a b.png")) / "images.txt").read_text().splitlines()
    (tmp_path / "images.txt").write_text("\n".join([*lines[:2], *lines[4:6], *lines[2:4]]))
    assert [camera.name for camera in read_calibration(tmp_path / "images.txt", size=SIZE)] == ["b", "a b"]


def test_what_is_no_rig_is_refused_by_name(tmp_path):
    refused(model(tmp_path, names=("cam1/1.png", "cam1/1.jpg")), "are of one camera, '1'; keep one picture of each")
    refused(model(tmp_path, "OPENCV_FISHEYE 1032 776 700 710 516 388 0 0 0 0"), "lens model .OPENCV_FISHEYE.; expected")
    refused(model(tmp_path, "OPENCV 1032 776 700 710 516"), "OPENCV has the numbers fx fy cx cy k1 k2 p1 p2")
    refused(model(tmp_path, "FULL_OPENCV 1032 776 700 710 516 388 0 0 0 0 0 .1 0 0"), "rational model")
    model(tmp_path)
    (tmp_path / "cameras.txt").write_text("2 PINHOLE 1032 776 700 710 516 388")
    refused(tmp_path, "no CAMERA_ID 1 with model and size in cameras.txt")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 0\n\n")
    refused(tmp_path, "expected IMAGE_ID QW QX QY QZ")
    (tmp_path / "images.txt").unlink()
    refused(tmp_path, r"images\.txt")


def test_a_repaired_rig_is_written_as_a_model(tmp_path):
    model(tmp_path)
    rig = studio()
    write_like(tmp_path, tmp_path / "new", rig)
    assert {each.name for each in (tmp_path / "new").iterdir()} == {"cameras.txt", "images.txt", "points3D.txt"}
    read = read_calibration(tmp_path / "new", size=SIZE, only=("cam2", "cam0"))
    np.testing.assert_allclose(read.P, [rig.P[2], rig.P[0]], atol=1e-9)
