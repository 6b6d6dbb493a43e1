"""Files of true joints, written here without the package and read by it."""

import json
import struct

import numpy as np
import pytest
from scipy.io import savemat

from mvpose.formats.joint_names import KNOWN, JointNames, skeleton_of
from mvpose.formats.people import FORMATS, PeopleFiles
from mvpose.recording import People

NAMES = ("LHip", "RHip", "Nose")
Y_UP = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # x, y, z of a file with y up, from our x, y, z


def tracks(frames=4, people=1, joints=3, seed=0):
    return np.random.default_rng(seed).normal(size=(frames, people, joints, 3))


def read(kind, *paths, frames=range(100), up="z", rate=25.0, **options):
    return FORMATS[kind].read(PeopleFiles(paths, up=up, rate=rate, numbers=np.array(frames), **options))


def cells(*poses):
    track = np.empty((len(poses), 1), object)
    track[:, 0] = poses
    return track


def write_mat(path, *actors):
    listed = np.empty((1, len(actors)), object)
    listed[0] = actors
    outer = np.empty((1, 1), object)
    outer[0, 0] = listed
    savemat(path, {"actor3D": outer})
    return path


class TestActorsMat:
    @pytest.mark.parametrize("count", [1, 2, 3, 5])
    def test_any_number_of_actors(self, tmp_path, count):
        joints = tracks(6, count, 14)
        path = write_mat(tmp_path / "gt.mat", *(cells(*joints[:, actor]) for actor in range(count)))
        got = read("actors-mat", path)
        np.testing.assert_array_equal(got.joints, joints)
        assert got.numbers.tolist() == list(range(6))

    def test_frames_without_annotation_are_nan(self, tmp_path):
        pose = np.arange(42.0).reshape(14, 3)
        track = cells(pose, np.zeros((1, 0)), np.zeros((1, 1)), np.full((14, 3), np.nan))
        truth = read("actors-mat", write_mat(tmp_path / "gt.mat", track, track)).joints
        np.testing.assert_array_equal(truth[0, 1], pose)
        assert np.isnan(truth[1:]).all()

    def test_another_layout_is_refused(self, tmp_path):
        odd, even = cells(np.zeros((14, 3)), np.zeros((17, 3))), cells(np.zeros((14, 3)), np.zeros((14, 3)))
        wanted = r"gt\.mat: actor 2, frame 1: expected 14 x 3 joints or nothing, got \(17, 3\)"
        with pytest.raises(ValueError, match=wanted):
            read("actors-mat", write_mat(tmp_path / "gt.mat", even, odd))
        savemat(tmp_path / "other.mat", {"x": np.zeros(3)})
        with pytest.raises(ValueError, match=r"other\.mat: has no variable actor3D"):
            read("actors-mat", tmp_path / "other.mat")


class TestPanoptic:
    def write(self, folder, frame, bodies):
        (folder / f"body3DScene_{frame:08d}.json").write_text(json.dumps({"version": 0.7, "bodies": bodies}))

    @pytest.mark.parametrize("count", [19, 15])
    def test_centimetres_with_y_down_become_metres_with_z_up(self, tmp_path, count):
        joints = tracks(2, 2, count)
        for frame, people in zip((7, 9), joints, strict=True):
            bodies = []
            for number, body in zip((3, 8), people, strict=True):
                theirs = 100 * np.stack([body[:, 0], -body[:, 2], body[:, 1]], axis=-1)
                values = np.concatenate([theirs, np.full((count, 1), 0.9)], axis=1)
                bodies.append({"id": number, f"joints{count}": values.ravel().tolist()})
            self.write(tmp_path, frame, bodies)
        got = read("panoptic", tmp_path, skeleton=KNOWN[f"panoptic{count}"])
        np.testing.assert_allclose(got.at([7, 9]), joints)
        assert np.isnan(got.at([8])).all()
        assert got.ids.tolist() == [3, 8]

    def test_joints_of_no_confidence_are_undefined(self, tmp_path):
        body = np.concatenate([np.ones((19, 3)), np.full((19, 1), 0.5)], axis=1)
        body[4] = (0, 0, 0, -1)
        self.write(tmp_path, 0, [{"id": 0, "joints19": body.ravel().tolist()}, {"id": -1, "joints19": [0] * 76}])
        joints = read("panoptic", tmp_path).joints
        assert joints.shape == (1, 1, 19, 3)
        assert np.isnan(joints[0, 0, 4]).all()
        assert np.isfinite(np.delete(joints[0, 0], 4, axis=0)).all()

    def test_the_published_sequence(self, shared_data):
        """Musicians who sit on chairs."""
        folder = shared_data / "panoptic" / "160906_band1" / "hdPose3d_stage1_coco19"
        joints = read("panoptic", folder, frames=[168, 169]).joints
        names = list(KNOWN["panoptic19"].joints)
        nose, hip = (joints[:, :, names.index(each), 2] for each in ("nose", "mid_hip"))
        assert np.nanmin(nose - hip) > 0.1
        assert 0.3 < np.nanmin(hip) < np.nanmax(hip) < 0.8

    def test_faults_are_named(self, tmp_path):
        with pytest.raises(ValueError, match=r"none: no such folder"):
            read("panoptic", tmp_path / "none")
        with pytest.raises(ValueError, match=r"has no file body3DScene"):
            read("panoptic", tmp_path)
        self.write(tmp_path, 500, [])
        with pytest.raises(ValueError, match=r"has files of frames 500 to 500, none of the recording's frames 0 to 99"):
            read("panoptic", tmp_path)
        self.write(tmp_path, 1, [{"id": 0, "joints19": [0.0] * 75}])
        with pytest.raises(ValueError, match=r"00000001\.json: joints19 must be 76 numbers, got 75"):
            read("panoptic", tmp_path)
        self.write(tmp_path, 1, [{"id": 0, "joints15": [0.0] * 60}])
        assert len(read("panoptic", tmp_path).skeleton) == 15
        with pytest.raises(ValueError, match=r"00000001\.json: lacks 'joints19'"):
            read("panoptic", tmp_path, skeleton=KNOWN["panoptic19"])


def write_trc(path, joints, *, first=1, unit="mm", scale=1000.0, names=NAMES):
    """Write one person (T, J, 3) as OpenSim does."""
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        "\t".join(map(str, (25, 25, len(joints), len(names), unit, 25, first, len(joints)))),
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(len(names)) for axis in "XYZ"),
        "",
    ]
    for row, frame in enumerate(scale * joints):
        values = ["" if np.isnan(value) else repr(float(value)) for value in frame.ravel()]
        lines.append("\t".join([str(first + row), f"{row / 25:.3f}", *values]))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(path, joints, *, first=1, unit="mm", scale=1000.0, names=NAMES):
    """Write one person (T, J, 3) as a C3D file of floats, by the format's description, with one block of parameters."""

    def group(number, name):
        return struct.pack("<bb", len(name), -number) + name + struct.pack("<hb", 3, 0)

    def parameter(number, name, kind, sizes, data):
        body = struct.pack("<bb", kind, len(sizes)) + bytes(sizes) + data + b"\0"
        return struct.pack("<bb", len(name), number) + name + struct.pack("<h", len(body) + 2) + body

    count, last = len(names), first + len(joints) - 1
    width = max(map(len, names))
    labels = b"".join(each.encode().ljust(width) for each in names)
    parameters = b"".join(
        [
            group(1, b"POINT"),
            parameter(1, b"USED", 2, [], struct.pack("<h", count)),
            parameter(1, b"FRAMES", 2, [], struct.pack("<h", len(joints))),
            parameter(1, b"SCALE", 4, [], struct.pack("<f", -1.0)),
            parameter(1, b"RATE", 4, [], struct.pack("<f", 25.0)),
            parameter(1, b"DATA_START", 2, [], struct.pack("<h", 3)),
            parameter(1, b"UNITS", -1, [len(unit)], unit.encode()),
            parameter(1, b"LABELS", -1, [width, count], labels),
            group(2, b"ANALOG"),
            parameter(2, b"USED", 2, [], struct.pack("<h", 0)),
            parameter(2, b"GEN_SCALE", 4, [], struct.pack("<f", 1.0)),
            struct.pack("<bb", 0, 0),
        ]
    )
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, count, 0, first, last, 0, -1.0, 3, 0, 25.0).ljust(512, b"\0")
    block = struct.pack("<BBBB", 1, 0x50, 1, 84) + parameters
    assert len(block) <= 512
    points = np.concatenate([scale * joints, np.zeros((*joints.shape[:2], 1))], axis=-1)
    points[np.isnan(joints).any(axis=-1)] = (0, 0, 0, -1)
    path.write_bytes(header + block.ljust(512, b"\0") + points.astype("<f4").tobytes())
    return path


WRITERS = {"trc": write_trc, "c3d": write_c3d}


@pytest.mark.parametrize("kind", WRITERS)
class TestMarkers:
    @pytest.mark.parametrize(("unit", "scale"), [("mm", 1000.0), ("m", 1.0), ("cm", 100.0)])
    def test_units_are_converted(self, tmp_path, kind, unit, scale):
        joints = tracks()
        got = read(kind, WRITERS[kind](tmp_path / f"a.{kind}", joints[:, 0], unit=unit, scale=scale))
        np.testing.assert_allclose(got.joints, joints, atol=1e-6)
        assert got.skeleton.joints == NAMES

    def test_one_file_for_each_person(self, tmp_path, kind):
        joints = tracks(people=2)
        paths = [WRITERS[kind](tmp_path / f"{k}.{kind}", joints[:, k], first=5 + k) for k in range(2)]
        got = read(kind, *paths)
        assert got.numbers.tolist() == [5, 6, 7, 8, 9]
        np.testing.assert_allclose(got.joints[:4, 0], joints[:, 0], atol=1e-6)
        np.testing.assert_allclose(got.joints[1:, 1], joints[:, 1], atol=1e-6)
        assert np.isnan(got.joints[4, 0]).all()
        assert np.isnan(got.joints[0, 1]).all()

    def test_undefined_markers_are_nan(self, tmp_path, kind):
        joints = tracks()
        joints[1, 0, 2] = np.nan
        got = read(kind, WRITERS[kind](tmp_path / f"a.{kind}", joints[:, 0])).joints
        np.testing.assert_allclose(got, joints, atol=1e-6)

    def test_y_up_becomes_z_up(self, tmp_path, kind):
        joints = tracks()
        path = WRITERS[kind](tmp_path / f"a.{kind}", joints[:, 0] @ Y_UP.T)
        np.testing.assert_allclose(read(kind, path, up="y").joints, joints, atol=1e-6)

    @pytest.mark.parametrize(("first", "counted"), [(0, True), (1, True), (298, False)])
    def test_a_first_frame_of_0_or_1_is_only_a_count(self, tmp_path, kind, first, counted):
        if (kind, first) == ("c3d", 0):
            pytest.skip("frames of C3D files count from 1")
        path = WRITERS[kind](tmp_path / f"a.{kind}", tracks()[:, 0], first=first)
        assert read(kind, path).numbers[0] == first  # 4 frames are not the 100 that are wanted
        assert read(kind, path, frames=range(300, 304)).numbers[0] == (300 if counted else first)

    def test_faults_are_named(self, tmp_path, kind):
        one, other = (
            WRITERS[kind](tmp_path / f"{k}.{kind}", tracks()[:, 0], names=names)
            for k, names in enumerate((NAMES, ("LHip", "RHip", "Tail")))
        )
        with pytest.raises(ValueError, match=rf"1\.{kind}: expected the markers of 0\.{kind}, LHip, RHip, Nose"):
            read(kind, one, other)
        with pytest.raises(ValueError, match=rf"2\.{kind}: .* must be one of m, .*, got .furlong."):
            read(kind, WRITERS[kind](tmp_path / f"2.{kind}", tracks()[:, 0], unit="furlong"))
        with pytest.raises(ValueError, match=rf"none\.{kind}: no such file"):
            read(kind, tmp_path / f"none.{kind}")
        (tmp_path / f"odd.{kind}").write_bytes(b"no such format")
        with pytest.raises(ValueError, match=rf"odd\.{kind}"):
            read(kind, tmp_path / f"odd.{kind}")


def test_a_truncated_c3d_file_is_refused(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", tracks()[:, 0])
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ValueError, match=r"a\.c3d: expected frames 1 to 4, got 3 frames"):
        read("c3d", path)


def test_a_word_among_the_numbers_of_a_trc_file_is_named(tmp_path):
    path = write_trc(tmp_path / "a.trc", tracks()[:, 0])
    path.write_text(path.read_text().replace("0.040", "0.040\tword"))
    with pytest.raises(ValueError, match=r"a\.trc, line 8: expected"):
        read("trc", path)


class TestNpz:
    def test_round_trip(self, tmp_path):
        joints = tracks(people=3)
        np.savez(tmp_path / "a.npz", joints=joints, names=np.array(NAMES), frames=np.array([2, 4, 5, 9]))
        got = read("npz", tmp_path / "a.npz")
        np.testing.assert_array_equal(got.joints, joints)
        assert (got.skeleton.joints, got.numbers.tolist()) == (NAMES, [2, 4, 5, 9])
        np.testing.assert_allclose(got.times, [0.08, 0.16, 0.2, 0.36])

    def test_without_numbers_rows_are_counted(self, tmp_path):
        np.savez(tmp_path / "a.npz", joints=tracks())
        skeleton = JointNames("declared", NAMES)
        got = read("npz", tmp_path / "a.npz", skeleton=skeleton)
        assert (got.skeleton.joints, got.numbers.tolist()) == (NAMES, [0, 1, 2, 3])
        assert read("npz", tmp_path / "a.npz", skeleton=skeleton, frames=range(7, 11)).numbers.tolist() == [7, 8, 9, 10]
        with pytest.raises(ValueError, match="does not name its joints"):
            read("npz", tmp_path / "a.npz")

    def test_a_file_states_times_or_a_rate_unless_the_user_does(self, tmp_path):
        path = tmp_path / "a.npz"
        for stated in ({"rate": 50.0}, {"times": np.arange(4) / 50}):
            np.savez(path, joints=tracks(), names=np.array(NAMES), **stated)
            np.testing.assert_allclose(read("npz", path).times, np.arange(4) / 50)
        np.savez(path, joints=tracks(), names=np.array(NAMES))
        with pytest.raises(ValueError, match="states neither the times of frames nor frames per second"):
            read("npz", path, rate=None)

    def test_faults_are_named(self, tmp_path):
        path = tmp_path / "a.npz"
        for arrays, message in (
            ({"points": tracks()}, "has no array 'joints'"),
            ({"joints": np.zeros((4, 3, 3))}, "joints must be"),
            ({"joints": tracks(), "frames": np.arange(3)}, "joints must be"),
            ({"joints": tracks(), "frames": np.array([0, 1, 1, 2])}, "frame numbers must increase"),
            ({"joints": tracks(), "names": np.array(["nose"])}, "has 3 joints, but skeleton a.npz has 1"),
        ):
            np.savez(path, **{"names": np.array(NAMES), **arrays})
            with pytest.raises(ValueError, match=rf"a\.npz: .*{message}"):
                read("npz", path)
        path.write_bytes(path.read_bytes()[:100])
        with pytest.raises(ValueError, match=r"a\.npz: cannot be read"):
            read("npz", path)


def test_people_of_one_file_need_one_file(tmp_path):
    for kind in ("npz", "panoptic", "actors-mat"):
        with pytest.raises(ValueError, match="expected one file"):
            read(kind, tmp_path / "a", tmp_path / "b")


def test_tracks_are_looked_up_by_frame():
    given = People([0.0, 0.1], [0], tracks(2), skeleton=skeleton_of(JointNames("three", NAMES)), numbers=[3, 5])
    got = given.at([2, 3, 4, 5, 6])
    np.testing.assert_array_equal(got[[1, 3]], given.joints)
    assert np.isnan(got[[0, 2, 4]]).all()
    assert given.numbered_from(10).numbers.tolist() == [10, 12]


def test_infinite_numbers_of_frames_and_people_are_refused(tmp_path):
    path = write_trc(tmp_path / "a.trc", tracks()[:, 0])
    path.write_text(path.read_text().replace("\n3\t", "\n1e999\t"))
    with pytest.raises(ValueError, match=r"a\.trc, line 9: expected numbers, got '1e999"):
        read("trc", path)
    file = tmp_path / "body3DScene_00000000.json"
    file.write_text('{"bodies": [{"id": 1e999, "joints19": []}]}')
    with pytest.raises(ValueError, match=r"00000000\.json: cannot convert float infinity"):
        read("panoptic", tmp_path)
