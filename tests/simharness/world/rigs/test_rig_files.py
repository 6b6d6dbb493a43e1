import numpy as np
import pytest

from mvpose.camera import Camera, Rig
from mvpose.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.calibration.file_storage import write_storage
from simharness.scenario.load import load
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.world.rigs.layouts import aligned, build_rig, look_at

RIG = build_rig(CamerasSection(count=3, size=(640, 480), distortion=(-0.1, 0.01, 0.001, 0.002, 0.0)))
FORMATS = {
    "voxelpose.json": voxelpose.write_calibration,
    "panoptic.json": panoptic.write_calibration,
    "opencv.yml": opencv.write_calibration,
    "opencv.xml": opencv.write_calibration,
    "Calib.toml": pose2sim.write_calibration,
    "intri.yml": lambda path, rig: easymocap.write_calibration(path.parent, rig),
    "extri.yml": lambda path, rig: easymocap.write_calibration(path.parent, rig),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_is_told_by_the_content(tmp_path, name):
    FORMATS[name](tmp_path / name, RIG)
    rig = read_calibration(tmp_path / name, size=(640, 480))
    np.testing.assert_allclose(rig.packed, RIG.packed, atol=1e-9)
    assert [(camera.name, camera.size) for camera in rig] == [(camera.name, (640, 480)) for camera in RIG]


@pytest.mark.parametrize("name", FORMATS)
def test_a_scenario_names_a_file_beside_it(tmp_path, name):
    FORMATS[name](tmp_path / name, RIG)
    scenario = tmp_path / "mine.toml"
    scenario.write_text(
        f'name = "mine"\n[cameras]\nlayout = "file"\nfile = "{name}"\nsize = [640, 480]\nonly = ["cam2", "cam0"]\n'
    )
    rig = build_rig(load(scenario).cameras)
    np.testing.assert_allclose(rig.centers, RIG.centers[[2, 0]], atol=1e-9)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"found a file that begins with b''; expected one of Panoptic \(JSON\), .*, OpenCV \(YAML, XML, JSON\)$"),
        (b"\x89PNG\r\n", r"found a file that begins with b'\\x89PNG"),
        (b"[cameras]\ncount = 4\n", r'found TOML with the keys "cameras"; expected'),
        (b'{"a": {"b": 1}}', r'found JSON with the keys "a"; expected one of Panoptic \(JSON\), '),
        (b'{"cameras": [', r"truncated JSON .* cut off"),
        (b"%YAML:1.0\n---\nsize: 3\n", r"no camera found, only size; expected an OpenCV calibration"),
        (b"%YAML:1.0\n---\nK: [1, 2\n", r"as OpenCV's FileStorage \(line 3: did not find expected ',' or '\]'"),
        (b"%YAML:1.0\n---\n", r"FileStorage cannot read it|without named values"),
        (
            b'%YAML:1.0\n---\nnames:\n  - "01"\n  - "02"\n',
            r"camera '01' lacks K_01, R_01 or Rot_01, T_01, in this file and in a",
        ),
    ],
)
def test_a_file_of_no_known_format_says_what_was_found(tmp_path, content, message):
    path = tmp_path / "mine.txt"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        read_calibration(path, size=(640, 480))
    assert "mine.txt" in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"mine\.yml: no such file; expected a camera calibration: Panoptic"):
        read_calibration(tmp_path / "mine.yml", size=(640, 480))


def test_the_half_that_is_missing_is_named(tmp_path):
    easymocap.write_calibration(tmp_path, RIG)
    (tmp_path / "extri.yml").unlink()
    with pytest.raises(ValueError, match=r"lacks R_cam0 or Rot_cam0, T_cam0, in this file and in extri\.yml beside it"):
        read_calibration(tmp_path / "intri.yml", size=(640, 480))


def test_panoptic_cameras_of_other_types_are_there_by_name(tmp_path):
    path = tmp_path / "calibration.json"
    panoptic.write_calibration(path, RIG, kind="vga")
    with pytest.raises(ValueError, match=r"0 of 3 cameras are of type hd, .* the file has vga"):
        read_calibration(path, size=(1, 1))
    assert len(read_calibration(path, size=(1, 1), only=("cam0", "cam1"))) == 2


def stereo_files(folder):
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    D = np.array([[-0.1, 0.01, 0.0, 0.0, 0.0]])
    write_storage(folder / "intrinsics.yml", {"M1": K, "D1": D, "M2": K, "D2": D})
    # The second camera stands 0.3 m to the right of the first.
    write_storage(folder / "extrinsics.yml", {"R": np.eye(3), "T": np.array([[-0.3], [0.0], [0.0]])})


@pytest.mark.parametrize("name", ["intrinsics.yml", "extrinsics.yml"])
def test_a_stereo_pair_hangs_where_the_first_camera_of_a_ring_would(tmp_path, name):
    stereo_files(tmp_path)
    cameras = CamerasSection(layout="file", file=str(tmp_path / name), size=(640, 480), radius=4, height=2, start=90)
    first, second = build_rig(cameras)
    np.testing.assert_allclose(first.center, (0, 4, 2), atol=1e-12)
    np.testing.assert_allclose(first.project(cameras.aim), (320, 240), atol=1e-9)
    np.testing.assert_allclose(second.center, (-0.3, 4, 2), atol=1e-12)  # looking along -y, right is -x
    assert first.size == (640, 480)
    other_way = build_rig(cameras.model_copy(update={"only": ("2", "1")}))
    np.testing.assert_allclose(other_way.packed, Rig([second, first]).packed, atol=1e-12)


def test_carrying_a_rig_keeps_its_cameras_to_each_other():
    first = look_at((1, 2, 3), (0, 0, 1), K=RIG[0].K, size=(640, 480))
    moved = aligned(RIG, RIG[0], to=first)
    np.testing.assert_allclose(moved[0].center, (1, 2, 3), atol=1e-12)
    np.testing.assert_allclose(moved[0].R, first.R, atol=1e-12)
    for one, two in zip(RIG, moved, strict=True):
        np.testing.assert_allclose(one.R @ RIG[0].R.T, two.R @ moved[0].R.T, atol=1e-12)
        np.testing.assert_allclose(
            RIG[0].R @ (one.center - RIG[0].center), moved[0].R @ (two.center - moved[0].center), atol=1e-12
        )


def test_a_lens_that_folds_in_a_file_is_refused(tmp_path):
    bad = Camera(K=RIG[0].K, R=RIG[0].R, t=RIG[0].t, distortion=np.array([-0.9, 0, 0, 0, 0]), size=(640, 480), name="x")
    opencv.write_calibration(tmp_path / "a.yml", Rig([bad, RIG[1]]))
    with pytest.raises(ValueError, match=r"a\.yml: camera 'x': its lens, .* folds over"):
        build_rig(CamerasSection(layout="file", file=str(tmp_path / "a.yml")))
