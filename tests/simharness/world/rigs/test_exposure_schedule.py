from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.world.rigs.faults import ExposureSchedule, moved
from simharness.world.rigs.layouts import build_rig

TIME = np.arange(4) / 10
RIG = build_rig(CamerasSection(count=3))


def test_the_ideal_schedule_has_every_picture_at_its_frame():
    exposures = ExposureSchedule.ideal(RIG, TIME)
    assert len(exposures) == 4
    assert exposures.delivered.all()
    for frame in range(4):
        for view in range(3):
            assert exposures.time[frame, view] == TIME[frame]
            assert exposures.source[frame, view] == frame
            assert exposures.camera(frame, view) is RIG[view] is exposures.believed_rig[view]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.zeros((4, 2))}, r"time must be \(T, 3\), got \(4, 2\)"),
        ({"time": np.full((4, 3), np.nan)}, "time must be finite"),
        ({"source": np.ones((4, 3), int)}, "source must be -1 or a frame that is not later"),
        ({"source": np.full((4, 3), -2)}, "source must be -1 or a frame that is not later"),
        ({"known_time": np.full((4, 3), np.nan)}, "known_time must be finite where a picture arrives, and NaN"),
        ({"camera_of_view": [0, 1, 1]}, "camera_of_view must name each of 3 cameras once"),
        ({"rotation_rate": np.zeros((2, 3))}, "rotation_rate must be"),
        ({"velocity": np.full((3, 3), np.inf)}, "velocity must be finite"),
        ({"readout": -0.1}, "readout must be finite and not negative"),
        (
            {"true_cameras": build_rig(CamerasSection(count=4))},
            "expected as many true cameras as believed ones, 3, got 4",
        ),
    ],
)
def test_an_invalid_schedule_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(ExposureSchedule.ideal(RIG, TIME), **change)


def test_a_camera_turns_about_its_own_centre_and_axes():
    camera = RIG[0]
    turned = moved(camera, (0.0, np.radians(10), 0.0), (0.0, 0.0, 0.0))
    np.testing.assert_allclose(turned.center, camera.center, atol=1e-12)
    # Turned about its y axis, image down, its axis swings to its right, +x.
    assert turned.R[2] @ camera.R[2] == pytest.approx(np.cos(np.radians(10)))
    assert turned.R[2] @ camera.R[0] == pytest.approx(np.sin(np.radians(10)))
    angle = Rotation.from_matrix(turned.R @ camera.R.T).magnitude()
    assert angle == pytest.approx(np.radians(10))
    shifted = moved(camera, (0.0, 0.0, 0.0), (0.1, 0.2, 0.3))
    np.testing.assert_allclose(shifted.center - camera.center, (0.1, 0.2, 0.3), atol=1e-12)
    np.testing.assert_array_equal(shifted.R, camera.R)


def test_swapped_views_deliver_pictures_of_the_other_camera():
    exposures = replace(ExposureSchedule.ideal(RIG, TIME), camera_of_view=[1, 0, 2], rotation_rate=np.eye(3) * 0.1)
    assert exposures.camera(0, 0) is RIG[1]
    late = exposures.camera(3, 0)
    assert Rotation.from_matrix(late.R @ RIG[1].R.T).magnitude() == pytest.approx(0.03)
    assert late.center == pytest.approx(RIG[1].center)
