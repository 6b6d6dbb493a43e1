"""The doctor on people who walk: planted faults are named, nothing where nothing is wrong, and what it cannot tell."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import look_at
from scipy.spatial.transform import Rotation

from mvpose import Detections, Rig
from mvpose.calibration import diagnose

_FRAMES, _PERIOD = 60, 0.1
_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9), (1.6, -4.1, 2.4))


_SPARSE_PERIOD = 0.1
_SPARSE_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9))


def uneven(count):
    """A rig without symmetry: no turn or mirroring of the world maps its cameras to each other."""
    return Rig([look_at(np.array(_PLACES[v]), np.array([0.1 * v, 0.0, 1.0]), name=f"c{v}") for v in range(count)])


@pytest.fixture(scope="module")
def recording():
    rig = uneven(5)
    frames, _ = film(rig, walk(3, frames=_FRAMES, period=_PERIOD), noise=3.0)
    return rig, frames


def alarms(rig, frames):
    diagnosis = diagnose(rig, frames, period=_PERIOD)
    return diagnosis, [(each.kind, each.view) for each in diagnosis.alarms]


def with_camera(rig, view, **changes):
    cameras = list(rig)
    cameras[view] = replace(cameras[view], **changes)
    return Rig(cameras)


def test_nothing_is_wrong_with_a_right_rig(recording):
    diagnosis, found = alarms(*recording)
    assert found == []
    assert diagnosis.verdict == "fine"
    assert diagnosis.residuals.max() < 8.0
    assert diagnosis.evidence


@pytest.mark.slow
def test_the_camera_that_moved_is_named_with_its_size(recording):
    rig, frames = recording
    camera = rig[3]
    turn = np.radians(1.5) * np.array([0.6, 0.64, 0.48])
    R, center = Rotation.from_rotvec(turn).as_matrix() @ camera.R, camera.center + [0.05, 0.0, -0.05]
    diagnosis, found = alarms(with_camera(rig, 3, R=R, t=-R @ center), frames)
    assert found == [("moved-camera", 3)]
    low, high = diagnosis.alarms[0].interval["degrees"]
    assert low < 1.5 < high
    low, high = diagnosis.alarms[0].interval["metres"]
    assert low < 0.0707 < high


@pytest.mark.slow
@pytest.mark.parametrize("views", [(2,), (0, 1, 2, 3, 4)])
def test_inverted_extrinsics_are_named_for_one_camera_and_for_all(recording, views):
    rig, frames = recording
    cameras = [replace(c, R=c.R.T, t=c.center) if v in views else c for v, c in enumerate(rig)]
    diagnosis, found = alarms(Rig(cameras), frames)
    assert found == [("extrinsics-inverted", 2 if len(views) == 1 else None)]
    assert diagnosis.alarms[0].probability > 0.95


@pytest.mark.slow
def test_exchanged_cameras_are_named(recording):
    rig, frames = recording
    cameras = list(rig)
    cameras[1], cameras[3] = cameras[3], cameras[1]
    diagnosis, found = alarms(Rig(cameras), frames)
    assert [kind for kind, _ in found] == ["cameras-swapped"]
    assert diagnosis.alarms[0].view in (1, 3)


def test_centimetres_are_named_by_the_size_of_people(recording):
    rig, frames = recording
    small = Rig([replace(c, t=10.0 * c.t) for c in rig])
    diagnosis, found = alarms(small, frames)
    assert found == [("wrong-unit", None)]
    assert 8.0 < diagnosis.alarms[0].size["times_adults"] < 13.0


def test_people_who_stand_still_do_not_determine_a_calibration():
    rig = uneven(5)
    frames, _ = film(rig, walk(1, frames=_FRAMES, period=_PERIOD, still=True), noise=3.0)
    diagnosis, found = alarms(rig, frames)
    assert diagnosis.verdict == "cannot tell"
    assert found == []
    assert "stood still" in diagnosis.findings[0].text


def test_errors_of_two_cameras_are_not_determined(recording):
    rig, frames = recording
    pair = [each.select(each.view < 2) for each in frames]
    diagnosis, found = alarms(Rig([rig[0], rig[1]]), pair)
    assert (diagnosis.verdict, found) == ("cannot tell", [])


def test_cameras_that_look_at_different_people_cannot_be_compared():
    rig = uneven(4)
    only = [{v} for v in range(4)]
    frames, _ = film(rig, walk(4, frames=_FRAMES, period=_PERIOD), only=only)
    diagnosis, found = alarms(rig, frames)
    assert (diagnosis.verdict, found) == ("cannot tell", [])


@pytest.mark.slow
def test_one_camera_that_sees_somebody_else_and_one_without_detections_are_named():
    rig = uneven(5)
    only = [{0, 1}, {0, 1}, {0, 1}, {2}, set()]
    frames, _ = film(rig, walk(3, frames=_FRAMES, period=_PERIOD), only=only)
    _, found = alarms(rig, frames)
    assert sorted(found) == [("other-people", 3), ("silent-view", 4)]


def test_no_detections_are_no_error(recording):
    rig, frames = recording
    diagnosis = diagnose(rig, [each.select(each.view < 0) for each in frames])
    assert diagnosis.verdict == "cannot tell"
    assert np.isnan(diagnosis.residuals).all()


@pytest.mark.slow
def test_a_camera_that_was_turned_far_is_no_crop_and_a_crop_is_no_turned_camera(recording):
    rig, frames = recording
    camera = rig[2]
    R = Rotation.from_rotvec(np.radians([2.0, 9.0, 1.0])).as_matrix() @ camera.R
    turned, found = alarms(with_camera(rig, 2, R=R, t=-R @ camera.center), frames)
    assert found == [("moved-camera", 2)]
    assert abs(turned.alarms[0].size["degrees"] - np.sqrt(86.0)) < 0.5
    K = camera.K + [[0.0, 0.0, 200.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    _, found = alarms(with_camera(rig, 2, K=K), frames)
    assert ("image-cropped", 2) in found


@pytest.mark.slow
def test_cameras_that_are_all_off_have_moved_and_have_no_other_mistake(recording):
    rig, frames = recording
    _, found = alarms(disturbed(rig, 2.0, 0.2, seed=5), frames)
    assert len(found) >= len(rig) - 2
    assert {kind for kind, _ in found} == {"moved-camera"}


@pytest.mark.slow
def test_distortion_that_no_camera_of_the_calibration_has_is_one_finding():
    right = Rig([replace(each, distortion=np.array([-0.25, 0.08, 0.0, 0.0, 0.0])) for each in uneven(4)])
    frames, _ = film(right, walk(3, frames=_FRAMES, period=_PERIOD, radius=2.0), noise=3.0)
    diagnosis, found = alarms(uneven(4), frames)
    assert found == [("distortion-ignored", None)]
    assert -0.35 < diagnosis.alarms[0].size["k1"] < -0.15
    assert alarms(right, frames)[1] == []


@pytest.mark.slow
def test_a_view_of_another_time_sees_other_people(recording):
    rig, frames = recording
    late = [*frames[_FRAMES // 2 :], *frames[: _FRAMES // 2]][::-1]
    mixed = [_with_view(each, other, 1) for each, other in zip(frames, late, strict=True)]
    _, found = alarms(rig, mixed)
    assert found == [("other-people", 1)]


def test_a_view_that_sees_a_shared_person_in_part_and_a_bystander_whole_sees_no_other_people():
    rig = rig_of(4)
    frames, people = film(rig, walk(2, frames=_FRAMES, period=_PERIOD), only=[{0, 1}, {0, 1}, {0}, {0}])
    for k, (frame, person) in enumerate(zip(frames, people, strict=True)):
        hidden = ((frame.view == 1) & (person == 0))[:, None] & (np.arange(17) >= 7)
        frames[k] = Detections.from_keypoints(frame.view, frame.keypoints, np.where(hidden, 0.0, frame.scores))
    assert "other-people" not in {each.kind for each in diagnose(rig, frames, period=_PERIOD).findings}


def _with_view(frame, other, view):
    rest, taken = frame.select(frame.view != view), other.select(other.view == view)
    columns = [np.concatenate([getattr(rest, key), getattr(taken, key)]) for key in ("view", "keypoints", "scores")]
    return Detections.from_keypoints(*columns)


def rig_of(count):
    return Rig([look_at(_SPARSE_PLACES[v], (0.1 * v, 0.0, 1.0), name=f"c{v}") for v in range(count)])


RECORDINGS = {
    "two cameras": lambda: (rig_of(2), walk(2, frames=50, period=_SPARSE_PERIOD), None),
    "different people": lambda: (rig_of(4), walk(4, frames=50, period=_SPARSE_PERIOD), [{v} for v in range(4)]),
    "one person stands still": lambda: (rig_of(4), walk(1, frames=50, period=_SPARSE_PERIOD, still=True), None),
}


@pytest.mark.parametrize("degrees", [0.0, 1.0])
@pytest.mark.parametrize("name", RECORDINGS)
def test_the_doctor_cannot_tell(name, degrees):
    rig, joints, only = RECORDINGS[name]()
    frames, _ = film(rig, joints, noise=3.0, only=only)
    diagnosis = diagnose(disturbed(rig, degrees, 0.05 * degrees, seed=3), frames, period=_SPARSE_PERIOD)
    assert diagnosis.verdict == "cannot tell"
    assert diagnosis.alarms == ()
    assert any(each.kind == "cannot-tell" and each.camera is None and each.mend for each in diagnosis.findings)
