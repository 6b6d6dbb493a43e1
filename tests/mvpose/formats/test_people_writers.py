"""Files of tracked people, read back by other readers: positions, axes, units, rates, gaps, identities."""

import io
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from mvpose import COCO17, Skeleton
from mvpose.formats.joint_names import canonical
from mvpose.formats.people import FORMATS, Export, Options, PeopleFormat, check_formats, register, write_people
from mvpose.formats.people.people_files import marker_label
from mvpose.recording import People

J = len(COCO17)
TENTH_MM = 1e-4


def recording(*, frames=12, rate=25.0, skeleton=COCO17, seed=0, covariance=True):
    """Two people: 3 throughout with some joints missing, 8 in frames 4 to 9 only, without frame 6."""
    rng = np.random.default_rng(seed)
    shape = frames, 2, len(skeleton)
    joints, scores = rng.uniform(-3, 3, (*shape, 3)), rng.uniform(0.2, 1, shape)
    joints[2, 0, -1] = joints[5, 0, 0] = np.nan
    joints[:4, 1] = joints[6, 1] = joints[10:, 1] = np.nan
    half = rng.normal(0, 0.01, (*shape, 3, 3))
    covariances = half @ half.swapaxes(-1, -2) if covariance else None
    return People(np.arange(frames) / rate, np.array([3, 8]), joints, scores, covariances, skeleton)


def written(people, kind, **options):
    return dict(FORMATS[kind].write(Export(people, Options(**options))))


def same(got, wanted, tolerance=TENTH_MM):
    """Equal within a tolerance, and undefined at the same places."""
    np.testing.assert_array_equal(np.isnan(got), np.isnan(wanted))
    np.testing.assert_allclose(got, wanted, atol=tolerance, rtol=0, equal_nan=True)


def y_up(joints):
    """x, y, z of a file with y up are y, z, x of the world: z of the world up, and no mirror."""
    return joints[..., [1, 2, 0]]


def read_trc(content):
    """The layout of OpenSim's documentation, with its reader's rule that a line does not end in an empty cell."""
    lines = content.decode().split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    keys, values = lines[1].split("\t"), lines[2].split("\t")
    header = dict(zip(keys, values, strict=True))
    labels = [cell for cell in lines[3].split("\t") if cell]
    assert labels[:2] == ["Frame#", "Time"]
    count = int(header["NumMarkers"])
    axes = [cell for cell in lines[4].split("\t") if cell]
    assert axes == [f"{axis}{k}" for k in range(1, count + 1) for axis in "XYZ"]
    rows = []
    for line in lines[5:-1]:
        cells = line.split("\t")
        if cells[-1] == "":
            cells = cells[:-1]
        assert len(cells) == 2 + 3 * count
        rows.append([float(cell) if cell else np.nan for cell in cells])
    assert lines[-1] == ""
    assert len(rows) == int(header["NumFrames"])
    table = np.array(rows)
    return header, labels[2:], table[:, 0], table[:, 1], table[:, 2:].reshape(len(table), count, 3)


class TestTrc:
    def test_one_file_a_person_in_metres_with_y_up(self):
        people = recording()
        files = written(people, "trc")
        assert list(files) == ["person_3.trc", "person_8.trc"]
        header, labels, numbers, times, markers = read_trc(files["person_3.trc"])
        assert (header["Units"], float(header["DataRate"]), float(header["CameraRate"])) == ("m", 25.0, 25.0)
        assert labels[5:7] == ["LShoulder", "RShoulder"]
        assert numbers.tolist() == list(range(1, 13))
        np.testing.assert_allclose(times, people.times, atol=1e-6)
        same(markers, y_up(people.joints[:, 0]))

    def test_a_visitor_has_the_frames_of_the_visit_and_empty_cells_in_between(self):
        people = recording()
        header, _, numbers, times, markers = read_trc(written(people, "trc")["person_8.trc"])
        assert numbers.tolist() == [5, 6, 7, 8, 9, 10]
        assert header["OrigDataStartFrame"] == "5"
        np.testing.assert_allclose(times, people.times[4:10], atol=1e-6)
        assert np.isnan(markers[2]).all()
        same(markers, y_up(people.joints[4:10, 1]))

    def test_times_are_those_of_the_recording_also_where_it_begins_late(self):
        people = replace(recording(), times=recording().times + 7.36)
        _, _, numbers, times, _ = read_trc(written(people, "trc")["person_8.trc"])
        assert numbers.tolist() == [5, 6, 7, 8, 9, 10]
        np.testing.assert_allclose(times, people.times[4:10], atol=1e-6)

    def test_millimetres_and_z_up_where_asked_for(self):
        people = recording()
        header, *_, markers = read_trc(written(people, "trc", units="mm", up="z")["person_3.trc"])
        assert header["Units"] == "mm"
        same(markers / 1000, people.joints[:, 0])


class TestC3d:
    def read(self, content):
        c3d = pytest.importorskip("c3d")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # no analog data
            reader = c3d.Reader(io.BytesIO(content))
            frames = [(number, points) for number, points, _ in reader.read_frames()]
        return reader, [number for number, _ in frames], np.stack([points for _, points in frames])

    def test_one_file_a_person_in_millimetres_with_z_up(self):
        people = recording()
        files = written(people, "c3d")
        assert list(files) == ["person_3.c3d", "person_8.c3d"]
        reader, numbers, points = self.read(files["person_3.c3d"])
        assert reader.point_rate == 25.0
        assert reader.get("POINT:UNITS").string_value.strip() == "mm"
        assert reader.get("POINT:Y_SCREEN").string_value == "+Z"
        assert [label.strip() for label in reader.point_labels][:2] == ["Nose", "LEye"]
        assert numbers == list(range(1, 13))
        defined = points[..., 3] >= 0
        same(np.where(defined[..., None], points[..., :3], np.nan) / 1000, people.joints[:, 0])

    def test_undefined_points_have_residual_minus_one_and_others_their_expected_error(self):
        people = recording()
        _, numbers, points = self.read(written(people, "c3d")["person_8.c3d"])
        assert numbers == [5, 6, 7, 8, 9, 10]
        assert (points[2, :, 3] == -1).all()
        variance = np.trace(people.covariance[4, 1], axis1=1, axis2=2) / 3
        np.testing.assert_allclose(points[0, :, 3], 1000 * np.sqrt(variance), atol=0.5001)

    def test_all_people_in_one_file_with_prefixes_and_more_than_255_points(self):
        many = Skeleton("many", [f"left_hand_{k}" for k in range(133)], [-1] + [0] * 132, range(133), [0.1] * 133)
        people = recording(skeleton=many)
        files = written(people, "c3d", together=True, up="y")
        assert list(files) == ["people.c3d"]
        reader, _, points = self.read(files["people.c3d"])
        labels = [*reader.point_labels, *reader.get("POINT:LABELS2").string_array]
        assert len(labels) == 266
        assert [labels[k].strip() for k in (0, 265)] == ["P3:LHand_0", "P8:LHand_132"]
        defined = points[..., 3] >= 0
        got = np.where(defined[..., None], points[..., :3], np.nan).reshape(12, 2, 133, 3)
        same(got / 1000, y_up(people.joints))

    def test_ezc3d_reads_the_same(self, tmp_path):
        ezc3d = pytest.importorskip("ezc3d")
        people = recording()
        write_people(people, tmp_path, formats=["c3d"])
        data = ezc3d.c3d(str(tmp_path / "person_8.c3d"))
        assert data["header"]["points"]["frame_rate"] == 25.0
        same(data["data"]["points"][:3].transpose(2, 1, 0) / 1000, people.joints[4:10, 1])


class TestTables:
    @pytest.mark.parametrize("kind", ["csv", "parquet"])
    def test_rows_are_the_joints_with_their_covariances(self, kind):
        pl = pytest.importorskip("polars")
        people = recording()
        content = written(people, kind)[f"poses.{kind}"]
        table = (pl.read_csv if kind == "csv" else pl.read_parquet)(io.BytesIO(content))
        assert len(table) == people.present.sum()
        got, covariance = np.full(people.joints.shape, np.nan), np.full((*people.joints.shape, 3), np.nan)
        for row in table.iter_rows(named=True):
            place = row["frame"], people.ids.tolist().index(row["person"]), COCO17.index(row["joint"])
            got[place] = row["x"], row["y"], row["z"]
            xx, xy, xz, yy, yz, zz = (row[f"cov_{key}"] for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
            covariance[place] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
            assert row["time"] == pytest.approx(people.times[row["frame"]], abs=1e-6)
            assert row["score"] == pytest.approx(people.scores[place], abs=1e-6)
        same(got, people.joints)
        same(covariance, people.covariance, 1e-12)

    def test_covariances_turn_with_the_axes(self):
        pytest.importorskip("polars")
        from mvpose.formats.people.people_tables import table

        people = recording()
        upright, turned = (table(Export(people, Options(up=up))) for up in ("z", "y"))
        for old, new in {"zz": "yy", "yy": "xx", "xx": "zz", "yz": "xy", "xz": "yz", "xy": "xz"}.items():
            np.testing.assert_allclose(turned[f"cov_{new}"], upright[f"cov_{old}"], atol=1e-15)
        np.testing.assert_array_equal(turned["y"], upright["z"])

    def test_unknown_covariances_are_empty_and_nobody_is_a_table(self):
        pl = pytest.importorskip("polars")
        people = recording(covariance=False)
        table = pl.read_parquet(io.BytesIO(written(people, "parquet")["poses.parquet"]))
        assert table["cov_yz"].null_count() == len(table) > 0
        nobody = pl.read_parquet(io.BytesIO(written(People.of_estimates([]), "parquet")["poses.parquet"]))
        assert nobody.schema == table.schema
        assert len(nobody) == 0


class TestJson:
    def test_frames_have_bodies_with_flat_joints(self):
        people = recording()
        data = json.loads(written(people, "json")["people.json"])
        assert (data["units"], data["up"], data["rate"]) == ("m", "z", 25.0)
        assert tuple(data["skeleton"]["joints"]) == COCO17.joints
        assert [[body["id"] for body in frame["bodies"]] for frame in data["frames"]] == [
            [3, 8] if k in (4, 5, 7, 8, 9) else [3] for k in range(12)
        ]
        for k, frame in enumerate(data["frames"]):
            assert (frame["frame"], frame["time"]) == (k, pytest.approx(k / 25))
            values = np.array(frame["bodies"][0]["joints17"], float).reshape(J, 4)  # null is NaN
            same(values[:, :3], people.joints[k, 0])
            np.testing.assert_allclose(values[:, 3], people.scores[k, 0], atol=1e-6)

    def test_panoptic_has_centimetres_with_y_down_and_marks_of_undefined_joints(self):
        people = recording()
        files = written(people, "panoptic")
        assert len(files) == 12
        scene = json.loads(files["hdPose3d/body3DScene_00000005.json"])
        assert [body["id"] for body in scene["bodies"]] == [3, 8]
        values = np.array(scene["bodies"][0]["joints17"]).reshape(J, 4)
        assert values[0].tolist() == [0, 0, 0, -1]
        x, y, z = people.joints[5, 0, 1:].T
        np.testing.assert_allclose(values[1:, :3].T / 100, [x, -z, y], atol=TENTH_MM)


class TestUniformTimes:
    def at(self, steps, period=0.1):
        """A joint that moves at 1 m/s along x, at times ``period * steps``."""
        times = period * np.array(steps, float)
        joints = np.zeros((len(times), 1, J, 3))
        joints[..., 0] = times[:, None, None]
        return People(times, np.array([0]), joints, np.ones((len(times), 1, J)))

    def test_uniform_times_stay_as_they_are(self):
        people = self.at(range(6))
        assert Export(people, Options()).uniform is people

    def test_a_lost_frame_is_a_gap(self):
        even = Export(self.at([0, 1, 2, 5, 6, 7]), Options()).uniform
        np.testing.assert_allclose(even.times, 0.1 * np.arange(8))
        np.testing.assert_allclose(even.joints[:, 0, 3, 0], [0, 0.1, 0.2, np.nan, np.nan, 0.5, 0.6, 0.7])

    def test_uneven_times_are_interpolated_to_the_positions_at_even_ones(self):
        people = self.at([0, 1.1, 2, 2.9, 4, 5, 6.2, 7])
        even = Export(people, Options()).uniform
        np.testing.assert_allclose(np.diff(even.times), 1 / people.rate)
        np.testing.assert_allclose(even.joints[:, 0, 3, 0], even.times, atol=1e-12)

    def test_long_pauses_are_refused(self):
        with pytest.raises(ValueError, match="export the parts separately"):
            _ = Export(self.at([0, 1, 2, 3, 500]), Options()).uniform


class TestRegistry:
    def test_unknown_formats_and_missing_packages_are_found_before_anything_is_written(self, tmp_path):
        with pytest.raises(ValueError, match="unknown format 'fbx' of people; expected one of parquet, json"):
            write_people(recording(), tmp_path / "out", formats=["trc", "fbx"])
        register("odd", PeopleFormat("x", FORMATS["trc"].write, requires=("no_such_package",), install="mvpose[odd]"))
        try:
            with pytest.raises(ValueError, match=r"needs the package no_such_package, .* pip install 'mvpose\[odd\]'"):
                check_formats(["odd"])
        finally:
            del FORMATS["odd"]
        assert not (tmp_path / "out").exists()

    def test_files_replace_older_ones_and_leave_nothing_else(self, tmp_path):
        for people in (recording(), recording(seed=1)):
            paths = write_people(people, tmp_path / "out", formats=["trc", "json", "trc"])
        assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(path.name for path in paths)
        *_, markers = read_trc((tmp_path / "out" / "person_3.trc").read_bytes())
        same(markers, y_up(recording(seed=1).joints[:, 0]))

    def test_a_folder_that_cannot_be_made_is_named(self, tmp_path):
        (tmp_path / "out").write_text("a file")
        with pytest.raises(OSError, match="out"):
            write_people(recording(), tmp_path / "out")

    @pytest.mark.parametrize("kind", ["trc", "c3d", "json", "csv", "panoptic"])
    def test_nobody_and_no_frames_are_no_error(self, kind):
        written(People.of_estimates([]), kind)
        written(replace(recording(), joints=np.full((12, 2, J, 3), np.nan)), kind)


def test_marker_labels_are_those_of_labs_and_are_understood_by_our_readers():
    labels = {"nose": "Nose", "left_shoulder": "LShoulder", "right_big_toe": "RBigToe", "left_hand_3": "LHand_3"}
    assert {joint: marker_label(joint) for joint in labels} == labels
    for joint in (*COCO17.joints, *labels, "face_12", "mid_hip", "head_top"):
        assert canonical(marker_label(joint)) == joint


@pytest.mark.parametrize("options", [{"up": "x"}, {"units": "cm"}])
def test_options_are_checked(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Options(**options)
