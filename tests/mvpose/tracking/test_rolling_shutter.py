"""Rolling shutter: people who move are placed as with a global one, if the cameras say their readout."""

from dataclasses import replace

import numpy as np
import pytest
from people import ring
from walking_people import walking

from mvpose import Detections, Rig, preset
from mvpose.tracking import Tracker

PATHS = [(-1.0, -0.6, 2.0, 0.0), (1.0, 0.6, -2.0, 0.0)]
READOUT = 0.03


def _seen(camera, time, readout):
    """Pixels of the joints of people, each at the time of its row, (n, 17, 2)."""
    joints = walking(time, paths=PATHS)
    velocity = (walking(time + 1e-3, paths=PATHS) - walking(time - 1e-3, paths=PATHS)) / 2e-3
    pixels = camera.project(joints)
    for _ in range(5):
        late = readout * ((pixels[..., 1] + 0.5) / camera.size[1] - 0.5)
        pixels = camera.project(joints + late[..., None] * velocity)
    return pixels


def _error(rig, readout):
    """Mean error of the joints after a while, metres."""
    tracker, errors = Tracker(preset("fast")), []
    for time in np.arange(20) / 25:
        pixels = np.concatenate([_seen(camera, time, readout) for camera in rig])
        view = np.repeat(np.arange(len(rig)), len(PATHS))
        given = Detections.from_keypoints(view, pixels, np.full((len(view), 17), 0.9))
        estimate = tracker.estimate(rig, replace(given, time=np.full(len(rig), time)))
        assert estimate.ids.tolist() == [0, 1]
        distance = np.linalg.norm(estimate.joints[:, None] - walking(time, paths=PATHS), axis=-1).mean(axis=-1)
        errors.append(distance.min(axis=1).mean())
    return np.mean(errors[10:])


def test_a_known_readout_costs_little_and_an_unknown_one_much():
    rig = ring(5)
    rolling = Rig([replace(camera, readout=READOUT) for camera in rig])
    whole, known, unknown = _error(rig, 0.0), _error(rolling, READOUT), _error(rig, READOUT)
    assert known < whole + 0.15 * (unknown - whole)
    assert unknown > 1.3 * whole


def test_cameras_of_one_rig_may_differ():
    rig = ring(5)
    some = Rig([replace(camera, readout=READOUT * (k == 2)) for k, camera in enumerate(rig)])
    assert _error(some, 0.0) > _error(rig, 0.0)  # a wrong readout of one camera moves its rays, and only its


@pytest.mark.parametrize("readout", [-0.01, np.inf, np.nan])
def test_a_readout_that_is_no_time_is_refused(readout):
    with pytest.raises(ValueError, match="readout must be 0 s or more and finite"):
        replace(ring(2)[0], readout=readout)
