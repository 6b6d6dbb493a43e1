from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simharness.scenario.sections.scenario import Cameras
from simharness.world.rigs.layouts import build_rig
from simharness.world.rigs.shots import Shots, moved

TIME = np.arange(4) / 10
RIG = build_rig(Cameras(count=3))


def test_ideal_pictures_are_of_their_own_frame_and_camera():
    shots = Shots.ideal(RIG, TIME)
    assert len(shots) == 4
    assert shots.delivered.all()
    for frame in range(4):
        for view in range(3):
            assert shots.time[frame, view] == TIME[frame]
            assert shots.source[frame, view] == frame
            assert shots.camera(frame, view) is RIG[view] is shots.believed[view]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.zeros((4, 2))}, r"time must be \(T, 3\), got \(4, 2\)"),
        ({"time": np.full((4, 3), np.nan)}, "time has values that are not finite"),
        ({"source": np.ones((4, 3), int)}, "source must be -1 or a frame no later"),
        ({"source": np.full((4, 3), -2)}, "source must be -1 or a frame no later"),
        ({"taker": [0, 1, 1]}, "taker must name each of 3 cameras once"),
        ({"turn": np.zeros((2, 3))}, "turn must be"),
        ({"travel": np.full((3, 3), np.inf)}, "travel has values"),
        ({"readout": -0.1}, "readout must be finite and not negative"),
        ({"true": build_rig(Cameras(count=4))}, "expected as many true cameras as believed ones, 3, got 4"),
    ],
)
def test_what_is_no_rig_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(Shots.ideal(RIG, TIME), **change)


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


def test_swapped_views_deliver_the_other_camera():
    shots = replace(Shots.ideal(RIG, TIME), taker=[1, 0, 2], turn=np.eye(3) * 0.1)
    assert shots.camera(0, 0) is RIG[1]
    late = shots.camera(3, 0)
    assert Rotation.from_matrix(late.R @ RIG[1].R.T).magnitude() == pytest.approx(0.03)
    assert late.center == pytest.approx(RIG[1].center)
