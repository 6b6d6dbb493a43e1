import numpy as np
import pytest

from mvpose import Camera, Detections, Rig
from mvpose.heatmaps import Heatmaps
from simharness.reality.annotated_recording import AnnotatedRecording

VIEWS = 4


def recording(frames=(3, 4, 5, 9, 10), *, likelihoods=False, **fields):
    """Return a recording of two actors in random places, with random detections in every view."""
    random = np.random.default_rng(7)
    K = np.diag([500.0, 500.0, 1.0])
    rig = Rig([Camera(K, np.eye(3), np.array([x, 0.0, 5.0]), size=(640, 480), name=f"c{x}") for x in range(VIEWS)])
    detections = []
    for _ in frames:
        view = random.integers(VIEWS, size=9)
        keypoints, scores = random.uniform(0, 400, (9, 17, 2)), random.uniform(0.1, 1, (9, 17))
        made = Detections.from_keypoints(view, keypoints, scores)
        maps = Heatmaps(random.uniform(0, 1, (9, 17, 4, 3)), random.uniform(0, 9, (9, 2)), random.uniform(1, 2, (9, 2)))
        detections.append(
            Detections(
                *(made.view, made.keypoints, made.scores, made.boxes, made.box_scores),
                descriptors=random.normal(size=(9, 5)),
                likelihoods=maps if likelihoods else None,
            )
        )
    truth = random.normal(size=(len(frames), 2, 14, 3))
    return AnnotatedRecording(rig, truth, tuple(detections), np.array(frames), **fields)


def test_the_defaults():
    plain = recording()
    assert (plain.name, plain.rate, plain.actors, plain.kind) == ("recording", 25.0, None, "bottom-up")
    assert plain.scored == (0, 1)
    assert recording(actors=[1]).scored == (1,)


def test_time_is_the_frame_number_over_the_rate():
    np.testing.assert_allclose(recording(rate=10.0).time, [0.3, 0.4, 0.5, 0.9, 1.0])


@pytest.mark.parametrize("frames", [(3, 4, 5, 9, 10), (0,), (1, 3, 5), tuple(range(6))])
def test_segments_cover_all_rows_and_have_no_gap(frames):
    data = recording(frames)
    rows = np.concatenate([np.arange(len(data))[each] for each in data.segments])
    assert rows.tolist() == list(range(len(data)))
    for each in data.segments:
        assert (np.diff(data.frames[each]) == 1).all()
    for one, other in zip(data.segments, data.segments[1:], strict=False):
        assert data.frames[other][0] - data.frames[one][-1] > 1


def test_no_frames_have_no_segments():
    assert recording().during(np.zeros(5, bool)).segments == []


@pytest.mark.parametrize("likelihoods", [False, True])
@pytest.mark.parametrize("views", [[0, 1], [3, 1], [2, 0, 3], [0, 1, 2, 3]])
def test_a_subset_of_cameras_keeps_their_detections(views, likelihoods):
    whole = recording(likelihoods=likelihoods, name="hall", rate=30.0, actors=(1,), kind="top-down")
    part = whole.subset(views)
    assert [camera.name for camera in part.rig] == [f"c{view}" for view in views]
    assert (part.name, part.rate, part.actors, part.kind) == ("hall", 30.0, (1,), "top-down")
    np.testing.assert_array_equal(part.truth, whole.truth)
    for all_of_frame, left in zip(whole.detections, part.detections, strict=True):
        assert len(left) == np.isin(all_of_frame.view, views).sum()
        for new, old in enumerate(views):
            kept, given = left.view == new, all_of_frame.view == old
            for key in ("keypoints", "scores", "boxes", "box_scores", "descriptors"):
                np.testing.assert_array_equal(getattr(left, key)[kept], getattr(all_of_frame, key)[given])
            if likelihoods:
                for key in ("values", "origin", "stride"):
                    np.testing.assert_array_equal(
                        getattr(left.likelihoods, key)[kept], getattr(all_of_frame.likelihoods, key)[given]
                    )


@pytest.mark.parametrize("rows", [[0, 3], np.array([True, False, False, True, False])])
def test_frames_are_chosen_by_row_or_mask(rows):
    whole = recording(name="hall", rate=30.0)
    part = whole.during(rows)
    assert part.frames.tolist() == [3, 9]
    assert (part.name, part.rate) == ("hall", 30.0)
    np.testing.assert_array_equal(part.truth, whole.truth[[0, 3]])
    np.testing.assert_array_equal(part.detections[1].keypoints, whole.detections[3].keypoints)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: recording((3, 3)), "frames must increase, got 3 after 3"),
        (lambda: recording(rate=0.0), "rate must be above 0 Hz and finite, got 0.0"),
        (lambda: recording(actors=()), "one or more different indices"),
        (lambda: recording(actors=(0, 2)), r"actors must be indices from 0 to 1, .* got \[0, 2\]"),
        (lambda: recording().subset([0, 4]), r"views must be different indices from 0 to 3, got \[0, 4\]"),
        (lambda: recording().subset([1, 1]), r"views must be different .* got \[1, 1\]"),
        (lambda: recording().subset([1]), "at least 2 cameras"),
        (lambda: recording().during([0, 5]), "rows must be from 0 to 4, got 0 to 5"),
        (lambda: recording().during([1, 0]), "frames must increase"),
        (lambda: recording().during([True, False]), "mask of the frames must be"),
    ],
)
def test_faults_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_detections_of_a_view_without_camera_are_refused():
    whole = recording()
    rig = Rig(whole.rig.cameras[:2])
    with pytest.raises(ValueError, match=r"frame \d+: expected detections in views below 2"):
        AnnotatedRecording(rig, whole.truth, whole.detections, whole.frames)
