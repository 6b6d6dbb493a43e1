import shutil

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.recording_file import read_recording
from simharness.scenario.shipped import shipped_folder
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import percent


@pytest.fixture(scope="module")
def shelf(shared_data):
    return read_recording("shelf", shared_data / "shelf")


@pytest.fixture
def copied(shared_data, tmp_path):
    """Copy the files of two frames, so that tests can damage them."""
    source, folder = shared_data / "shelf", tmp_path / "shelf"
    for view in range(5):
        (folder / "openpose" / str(view)).mkdir(parents=True)
        for frame in range(2):
            name = f"openpose/{view}/{view}_{frame:012d}_keypoints.json"
            shutil.copyfile(source / name, folder / name)
    for name in ("calibration_shelf.json", "actorsGT.mat"):
        shutil.copyfile(source / name, folder / name)
    shipped = (shipped_folder() / "recordings" / "shelf.toml").read_text()
    (folder / "recording.toml").write_text(shipped.replace("[[300, 599]]", "[[300, 301]]"))
    return folder


def test_the_published_frames(shelf):
    assert shelf.frames.tolist() == list(range(300, 600))
    assert len(shelf.rig) == 5
    assert all(camera.size == (1032, 776) for camera in shelf.rig)
    assert (shelf.name, shelf.rate, shelf.scored, shelf.kind) == ("shelf", 25.0, (0, 1, 2), "bottom-up")
    # Actors are annotated completely or not at all; the numbers were counted in the file.
    defined = np.isfinite(shelf.truth).all(axis=(2, 3))
    assert (defined == np.isfinite(shelf.truth).any(axis=(2, 3))).all()
    assert defined.sum(axis=0).tolist() == [279, 37, 161, 33]
    assert all(set(detections.view) == set(range(5)) for detections in shelf.detections[:10])


def test_detections_and_truth_belong_to_the_same_frames(shelf):
    """Published: limb joints to OpenPose, median 16.1 / 8.6 / 8.8 / 11.1 / 12.3 px for views 0 to 4."""
    nearest: list[list[float]] = [[] for _ in shelf.rig]
    for truth, detections in zip(shelf.truth, shelf.detections, strict=True):
        for person in truth[np.isfinite(truth).all(axis=(1, 2))]:
            for view, camera in enumerate(shelf.rig):
                keypoints = detections.keypoints[detections.view == view][:, _LIMBS]
                distance = np.linalg.norm(keypoints - camera.project(person[:12]), axis=-1)
                total = np.nanmean(np.where((~np.isnan(distance)).any(axis=1, keepdims=True), distance, 1e4), axis=1)
                if total.min(initial=np.inf) < 60:
                    nearest[view].extend(distance[total.argmin()])
    medians = [np.nanmedian(errors) for errors in nearest]
    np.testing.assert_allclose(medians, [16.1, 8.6, 8.8, 11.1, 12.3], atol=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("head", "actors", "average"), [("voxelpose", (99.5, 93.5, 98.5), 97.2), ("2019", (98.5, 91.9, 98.6), 96.3)]
)
def test_true_correspondences_reach_the_published_scores(shelf, head, actors, average):
    """The whole protocol: detections assigned to true people by projection, then score-weighted DLT."""
    frames = zip(shelf.truth, shelf.detections, strict=True)
    made = score_frames(shelf.truth, [_triangulate_true_people(shelf, *each) for each in frames], head=head)
    scores = [percent(made.parts[:, actor]) for actor in range(3)]
    np.testing.assert_allclose(scores, actors, atol=0.3)
    assert np.mean(scores) == pytest.approx(average, abs=0.3)
    if head == "voxelpose":
        assert 1000 * np.nanmedian(made.error) == pytest.approx(47, abs=1)


_LIMBS = [16, 14, 12, 11, 13, 15, 10, 8, 6, 5, 7, 9]  # COCO-17 joints of SHELF14's first twelve
_REACH = 60.0  # pixels between a detection and its person


def _triangulate_true_people(shelf, truth, detections):
    people = np.flatnonzero(np.isfinite(truth).all(axis=(1, 2)))
    true_person = np.full(len(detections), -1)
    for view, camera in enumerate(shelf.rig):
        rows_of_view = np.flatnonzero(detections.view == view)
        keypoints = detections.keypoints[rows_of_view][:, _LIMBS]
        distance = np.linalg.norm(camera.project(truth[people, None, :12]) - keypoints, axis=-1)
        count = np.isfinite(distance).sum(axis=-1)
        mean = np.where(count > 0, np.nansum(distance, axis=-1) / np.maximum(count, 1), np.inf)
        for row, column in zip(*linear_sum_assignment(np.minimum(mean, 2 * _REACH)), strict=True):
            if mean[row, column] < _REACH:
                true_person[rows_of_view[column]] = people[row]
    result = []
    for person in people:
        joints = np.full((17, 3), np.nan)
        for joint in range(17):
            rows = []
            for index in np.flatnonzero((true_person == person) & (detections.scores[:, joint] > 0)):
                P = shelf.rig.P[detections.view[index]]
                x, y = detections.keypoints[index, joint]
                rows += [
                    weighted
                    for weighted in detections.scores[index, joint] * np.stack([x * P[2] - P[0], y * P[2] - P[1]])
                ]
            if len(rows) >= 4:
                point = np.linalg.svd(np.array(rows))[2][-1]
                joints[joint] = point[:3] / point[3]
        result.append(joints)
    return np.array(result).reshape(-1, 17, 3)


def test_a_copy_of_two_frames_reads_the_same(copied, shelf):
    part = read_recording(copied)
    np.testing.assert_array_equal(part.truth, shelf.truth[:2])
    np.testing.assert_array_equal(part.detections[1].keypoints, shelf.detections[1].keypoints)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("actorsGT.mat", "the truth of Shelf or Campus"),
        ("calibration_shelf.json", "calibration.file"),
        ("openpose/3/3_000000000001_keypoints.json", "OpenPose"),
    ],
)
@pytest.mark.parametrize("kept", [None, 0, 0.1, 0.5])
def test_missing_and_truncated_files_are_named(copied, name, expected, kept):
    path = copied / name
    content = path.read_bytes()
    path.unlink()
    if kept is not None:
        path.write_bytes(content[: int(kept * len(content))])
    if kept is None and name.startswith("openpose"):
        path, reason, expected = path.parent, "has 1 pictures", "frame 301 is requested"
    else:
        empty = "not a known calibration" if name.startswith("calibration") else "cut off"
        reason = "no such file" if kept is None else "cut off" if kept else empty
    with pytest.raises(ValueError, match=reason) as raised:
        read_recording(copied)
    assert f"{copied / 'recording.toml'}: " in str(raised.value)
    assert str(path) in str(raised.value)
    assert expected in str(raised.value)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere: no such folder; expected the files .* calibration_shelf\.json"):
        read_recording("shelf", tmp_path / "nowhere")


def test_the_fields_must_fit(shelf):
    with pytest.raises(ValueError, match=r"truth must be \(300, A, 14, 3\), got \(299, 4, 14, 3\)"):
        AnnotatedRecording(shelf.rig, shelf.truth[1:], shelf.detections, shelf.frames)
    with pytest.raises(ValueError, match="expected detections of 300 frames, got 2"):
        AnnotatedRecording(shelf.rig, shelf.truth, shelf.detections[:2], shelf.frames)
