"""State of a tracker: saved, restored, and bounded."""

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from people import look_at, ring
from walking_people import film

from mvpose import COCO17, SHELF14, Detections, Rig, preset
from mvpose.tracking import Tracker, TrackerState, TrackingModel, track

PATHS = [(-0.8, -0.5, 0.5, 0.2), (0.8, 0.6, -0.4, -0.3), (0.0, 1.2, 0.3, -0.5)]
RATE = 25.0


def _film(count=20, **options):
    """People of whom one is hidden from frame 6 to 15, with noise and lost pictures."""
    lost = np.random.default_rng(2).random((count, 5)) < 0.2
    return film(
        PATHS, np.arange(count) / RATE, noise=5.0, lost=lambda frame, view: lost[frame, view],
        hidden=lambda frame, view, person: person == 0 and 6 <= frame < 15, **options,
    )  # fmt: skip


def _tracker():
    return Tracker(preset("fast"))


def _bytes(estimates):
    return [
        (each.joints.tobytes(), each.covariance.tobytes(), each.scores.tobytes(), each.ids.tobytes(), each.time)
        for each in estimates
    ]


@pytest.fixture(scope="module")
def middle(tmp_path_factory):
    """Rig, later frames, their estimates without interruption, and the state before them in a file."""
    rig, frames, _ = _film()
    tracker = _tracker()
    for frame in frames[:12]:
        tracker.estimate(rig, frame)
    path = tmp_path_factory.mktemp("state") / "middle.npz"
    tracker.state().save(path)
    assert [each.name for each in path.parent.iterdir()] == ["middle.npz"]
    return rig, frames[12:], _bytes([tracker.estimate(rig, frame) for frame in frames[12:]]), path


def test_a_tracker_has_a_time_from_its_first_picture_on():
    rig, frames, _ = _film()
    tracker = _tracker()
    assert tracker.time is None
    dark = Detections.empty()
    tracker.estimate(rig, replace(dark, time=np.full(len(rig), np.nan)))
    assert tracker.time is None
    tracker.estimate(rig, frames[0])
    assert tracker.time == 0.0


def test_a_restored_tracker_goes_on_with_the_same_bytes(middle):
    rig, frames, expected, path = middle
    state = TrackerState.load(path)
    for given in (state, pickle.loads(pickle.dumps(state))):
        tracker = Tracker.restored(given, preset("fast"))
        assert tracker.time == pytest.approx(11 / RATE)
        assert _bytes([tracker.estimate(rig, frame) for frame in frames]) == expected


def test_saving_changes_neither_the_state_nor_the_tracker(middle, tmp_path):
    rig, frames, expected, path = middle
    tracker = Tracker.restored(TrackerState.load(path), preset("fast"))
    estimates = []
    for frame in frames:
        state = tracker.state()
        before = {name: value.tobytes() for name, value in state.arrays.items()}
        estimates.append(tracker.estimate(rig, frame))
        assert {name: value.tobytes() for name, value in state.arrays.items()} == before
    assert _bytes(estimates) == expected
    state.save(tmp_path / "again.npz")
    again = TrackerState.load(tmp_path / "again.npz")
    assert {name: value.tobytes() for name, value in again.arrays.items()} == before


@pytest.mark.slow
def test_another_process_goes_on_with_the_same_bytes(middle, tmp_path):
    rig, frames, expected, path = middle
    (tmp_path / "rest.pkl").write_bytes(pickle.dumps((rig, frames, str(path))))
    code = (
        "import pickle, sys; from mvpose import preset; from mvpose.tracking import Tracker, TrackerState\n"
        "rig, frames, path = pickle.load(open(sys.argv[1], 'rb'))\n"
        "tracker = Tracker.restored(TrackerState.load(path), preset('fast'))\n"
        "estimates = [tracker.estimate(rig, frame) for frame in frames]\n"
        "result = [(e.joints.tobytes(), e.covariance.tobytes(), e.scores.tobytes(), e.ids.tobytes(), e.time)"
        " for e in estimates]\n"
        "pickle.dump(result, open(sys.argv[1], 'wb'))\n"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path / "rest.pkl"], check=True)
    assert pickle.loads((tmp_path / "rest.pkl").read_bytes()) == expected


def test_a_lag_can_start_from_a_restored_tracker(middle):
    rig, frames, _, path = middle
    estimates = [
        list(track(Tracker.restored(TrackerState.load(path), preset("fast")), rig, frames, lag=lag))
        for lag in (0.0, 0.1)
    ]
    assert [len(each) for each in estimates] == [len(frames)] * 2


def test_other_rigs_and_skeletons_are_refused(middle):
    rig, frames, _, path = middle
    moved = Rig([*list(rig)[:3], look_at([0.0, -5.0, 2.0], [0, 0, 1.0], name="moved"), rig[4]])
    for wrong, message in ((ring(6), "of 5 cameras, got 6"), (moved, r"camera 3 \('moved'\) has another calibration")):
        with pytest.raises(ValueError, match=message):
            Tracker.restored(TrackerState.load(path), preset("fast")).estimate(wrong, frames[0])
    with pytest.raises(ValueError, match="one rig and one skeleton, but the skeleton 'shelf14' of 14 joints"):
        Tracker.restored(TrackerState.load(path)).estimate(rig, Detections.empty(SHELF14))
    same = pickle.loads(pickle.dumps(rig))
    Tracker.restored(TrackerState.load(path), preset("fast")).estimate(same, frames[0])


def test_files_of_other_kinds_and_versions_are_refused(middle, tmp_path):
    *_, path = middle
    arrays = dict(TrackerState.load(path).arrays)
    cases = {
        "version of the layout must be 3, got 1": {**arrays, "version": np.array([1])},
        "there is no version": {name: value for name, value in arrays.items() if name != "version"},
        "missing or unknown: lost.found": {name: value for name, value in arrays.items() if name != "lost.found"},
        "missing or unknown: more": {**arrays, "more": np.zeros(3)},
        r"tracks.hits must be \(3, 5\)": {**arrays, "tracks.hits": np.zeros((3, 4))},
        "tracks.ids must be": {**arrays, "tracks.ids": np.zeros(3)},
    }
    for message, wrong in cases.items():
        np.savez(tmp_path / "wrong.npz", **wrong)
        with pytest.raises(ValueError, match=f"wrong.npz: expected the state of a tracker.*{message}"):
            TrackerState.load(tmp_path / "wrong.npz")
    np.savez(tmp_path / "objects.npz", version=np.array([{}]))
    np.save(tmp_path / "array.npy", np.zeros(3))
    (tmp_path / "text.npz").write_text("no archive")
    (tmp_path / "short.npz").write_bytes(path.read_bytes()[:-200])
    for name in ("objects.npz", "array.npy", "text.npz", "short.npz"):
        with pytest.raises(ValueError, match=f"{name}: expected the state of a tracker"):
            TrackerState.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        TrackerState.load(tmp_path / "none.npz")


def test_there_is_no_state_before_the_first_frame():
    with pytest.raises(ValueError, match="no state before its first frame"):
        _tracker().state()


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.0, 0.1])
def test_a_thousand_frames_of_people_who_come_and_go_leave_the_state_small(lag):
    """Two of eight people at a time, each for half a second, and false detections all over the place."""
    rng, count = np.random.default_rng(0), 1000
    paths = [(x, y, 0.0, 0.0) for x in (-1.5, -0.5, 0.5, 1.5) for y in (-1.0, 1.0)]
    rig, frames, _ = film(
        paths, np.arange(count) / 10.0, noise=1.0, hidden=lambda frame, view, person: (frame // 5) % 4 != person // 2
    )
    for k in range(0, count, 3):
        frame, views = frames[k], rng.permutation(5)[:2]
        ghost = rng.uniform([-2, -2, 0], [2, 2, 0]) + np.concatenate([[[0.0, 0.0, 1.0]], rng.normal(0, 0.4, (16, 3))])
        keypoints = np.concatenate([frame.keypoints, [rig[view].project(ghost) for view in views]])
        given = Detections.from_keypoints([*frame.view, *views], keypoints, np.full(keypoints.shape[:2], 0.9))
        frames[k] = Detections(
            given.view, given.keypoints, given.scores, given.boxes, given.box_scores, time=frame.time
        )
    tracker = Tracker(preset("fast"), model=TrackingModel())
    sizes, known = [], set()
    for estimate in track(tracker, rig, frames, lag=lag):
        known |= set(estimate.ids.tolist())
        sizes.append((tracker.state().nbytes, len(pickle.dumps(tracker))))
    assert len(known) >= 8
    first, later = np.array(sizes[50:300]).max(axis=0), np.array(sizes[300:]).max(axis=0)
    assert (later <= 1.5 * first).all()
    assert later[0] < 30 * 8 * len(COCO17) * 50


def test_a_clock_that_stands_still_holds_up_no_more_than_the_lag_at_a_thousand_frames_a_second():
    rig, frames, _ = film(PATHS[:1], [0.0])
    taken = 0

    def endless():
        nonlocal taken
        while True:
            taken += 1
            yield frames[0]

    estimates = track(_tracker(), rig, endless(), lag=0.02)
    for given in range(5):
        next(estimates)
        assert taken - given <= 23
