"""Times of pictures as the method is given them: clocks, phases of cameras without trigger, cameras of other rates."""

import numpy as np
import pytest

from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.world.rigs.faults import camera_phases, schedule_exposures
from simharness.world.rigs.layouts import build_rig

PERIOD = 1 / 30
TIME = np.arange(40) * PERIOD
RIG = build_rig(CamerasSection(count=5))
LATE = {"clock_offset": 0.05, "clock_jitter": 0.01}
FREE = CamerasSection(trigger="free")


def test_times_are_those_of_the_frames_where_nobody_knows_better():
    exposures = schedule_exposures(RIG, FaultsSection(**LATE, frozen=0.3), TIME, seed=3)
    assert np.abs(exposures.time - TIME[:, None]).max() > 0.02
    np.testing.assert_array_equal(exposures.known_time, np.broadcast_to(TIME[:, None], (40, 5)))


def test_there_is_no_time_where_no_picture_arrives():
    exposures = schedule_exposures(RIG, FaultsSection(**LATE, dropped=0.3, dead=(2,)), TIME, seed=3)
    assert 0 < exposures.delivered.sum() < 160
    np.testing.assert_array_equal(np.isfinite(exposures.known_time), exposures.delivered)


def test_known_clocks_give_the_times_at_which_pictures_were_taken():
    exposures = schedule_exposures(RIG, FaultsSection(**LATE, clocks_known=True, swapped=((0, 3),)), TIME, seed=3)
    np.testing.assert_array_equal(exposures.known_time, exposures.time)
    blind = schedule_exposures(RIG, FaultsSection(**LATE, swapped=((0, 3),)), TIME, seed=3)
    np.testing.assert_array_equal(blind.time, exposures.time)


def test_a_frozen_picture_seems_to_be_new():
    exposures = schedule_exposures(RIG, FaultsSection(**LATE, frozen=0.3, clocks_known=True), TIME, seed=3)
    frozen = exposures.source < np.arange(40)[:, None]
    late = exposures.known_time - exposures.time
    assert (late[frozen] > 0.5 * PERIOD).any()
    assert not late[~frozen].any()
    assert np.abs(exposures.known_time - TIME[:, None]).max() < 0.3


def test_phases_of_cameras_without_trigger_are_uniform_within_half_a_frame():
    phases = camera_phases(FREE, 2000, period=PERIOD, seed=0)
    assert np.abs(phases).max() <= 0.5 * PERIOD
    shares = np.histogram(phases, bins=10, range=(-0.5 * PERIOD, 0.5 * PERIOD))[0] / 2000
    assert np.abs(shares - 0.1).max() < 4 * np.sqrt(0.09 / 2000)
    np.testing.assert_array_equal(camera_phases(FREE, 5, period=PERIOD, seed=0), phases[:5])
    assert not np.intersect1d(camera_phases(FREE, 5, period=PERIOD, seed=1), phases).size
    assert not camera_phases(CamerasSection(), 5, period=PERIOD, seed=0).any()


def test_phases_are_known_and_errors_of_clocks_are_not():
    phases = camera_phases(FREE, 5, period=PERIOD, seed=3)
    free = schedule_exposures(RIG, FaultsSection(**LATE), TIME, seed=3, phases=phases)
    np.testing.assert_allclose(free.known_time, TIME[:, None] + phases, atol=1e-12)
    together = schedule_exposures(RIG, FaultsSection(**LATE), TIME, seed=3)
    np.testing.assert_allclose(free.time, together.time + phases, atol=1e-12)
    np.testing.assert_array_equal(free.source, together.source)


@pytest.mark.parametrize("frozen", [0.0, 0.5])
def test_cameras_of_other_rates_deliver_every_nth_picture(frozen):
    exposures = schedule_exposures(RIG, FaultsSection(frozen=frozen), TIME, seed=3, every=(1, 2, 3))
    for view, every in enumerate((1, 2, 3, 1, 2)):
        assert exposures.delivered[:, view].tolist() == [frame % every == 0 for frame in range(40)]
        source = exposures.source[exposures.delivered[:, view], view]
        assert (source % every == 0).all()
