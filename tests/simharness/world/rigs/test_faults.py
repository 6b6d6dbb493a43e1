import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mvpose.camera import Rig
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.world.rigs.faults import MAX_CLOCK_ERROR, ExposureSchedule, schedule_exposures
from simharness.world.rigs.layouts import build_rig

TIME = np.arange(40) / 10
RIG = build_rig(CamerasSection(count=5))
MANY = build_rig(CamerasSection(count=64, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0)))

FAULTS = {
    "focal": 0.01,
    "center": 4.0,
    "rotation": 0.5,
    "translation": 0.02,
    "rotation_drift": 5.0,
    "translation_drift": 0.1,
    "clock_offset": 0.05,
    "clock_jitter": 0.01,
    "dropped": 0.2,
    "frozen": 0.2,
    "dead": (1,),
    "swapped": ((0, 2),),
    "rolling_shutter": 0.02,
}


def fields(exposures):
    cameras = [
        [exposures.camera(t, v) for v in range(len(exposures.believed_rig))] for t in range(0, len(exposures), 7)
    ]
    return [
        exposures.believed_rig.packed,
        exposures.time,
        exposures.source,
        np.array([Rig(row).packed for row in cameras]),
        np.array(exposures.readout),
    ]


def same(one, two):
    return [np.array_equal(a, b) for a, b in zip(fields(one), fields(two), strict=True)]


def test_without_faults_the_schedule_is_ideal():
    assert all(same(schedule_exposures(RIG, FaultsSection(), TIME, seed=5), ExposureSchedule.ideal(RIG, TIME)))


@pytest.mark.parametrize(
    ("fault", "touched"),
    [
        ("focal", "believed"),
        ("center", "believed"),
        ("rotation", "believed"),
        ("translation", "believed"),
        ("rotation_drift", "true"),
        ("translation_drift", "true"),
        ("clock_offset", "time"),
        ("clock_jitter", "time"),
        ("dropped", "source"),
        ("dead", "source"),
        ("rolling_shutter", "readout"),
    ],
)
def test_a_fault_changes_nothing_else(fault, touched):
    unlike = [
        not equal
        for equal in same(
            schedule_exposures(RIG, FaultsSection(**{fault: FAULTS[fault]}), TIME, seed=0),
            ExposureSchedule.ideal(RIG, TIME),
        )
    ]
    assert unlike == [touched == name for name in ("believed", "time", "source", "true", "readout")]


def test_the_method_is_given_the_readout_of_a_rolling_shutter():
    faults = FaultsSection(rolling_shutter=0.02, rotation=1.0)
    without = schedule_exposures(RIG, FaultsSection(rotation=1.0), TIME, seed=0).believed_rig
    believed = schedule_exposures(RIG, faults, TIME, seed=0).believed_rig
    assert [camera.readout for camera in believed] == [0.02] * len(RIG)
    assert [camera.readout for camera in without] == [0.0] * len(RIG)
    np.testing.assert_array_equal(believed.packed, without.packed)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_among_others_changes_nothing_else(fault):
    """With all other faults present: their draws do not shift."""
    rest = {key: value for key, value in FAULTS.items() if key != fault and key not in ("swapped", "frozen")}
    without, with_fault = (
        schedule_exposures(RIG, FaultsSection(**rest, **extra), TIME, seed=2) for extra in ({}, {fault: FAULTS[fault]})
    )
    if fault in ("focal", "center", "rotation", "translation"):
        assert same(without, with_fault) == [False, True, True, True, True]
        others = {"focal": "tR", "center": "tR", "rotation": "cK", "translation": "RK"}[fault]
        for a, b in zip(without.believed_rig, with_fault.believed_rig, strict=True):
            if "K" in others:
                np.testing.assert_array_equal(a.K, b.K)
            if "R" in others:
                np.testing.assert_allclose(a.R, b.R, atol=1e-12)
            if "c" in others or "t" in others:
                np.testing.assert_allclose(a.center, b.center, atol=1e-12)
    elif fault in ("clock_offset", "clock_jitter"):
        assert same(without, with_fault)[0:3] == [True, False, True]
    else:
        assert same(without, with_fault)[0]


@given(seed=st.integers(0, 10**6), lower=st.floats(0, 1), more=st.floats(0, 1))
def test_a_higher_chance_only_adds_events(seed, lower, more):
    higher = lower + (1 - lower) * more
    few, many = (
        schedule_exposures(RIG, FaultsSection(dropped=chance), TIME, seed=seed).delivered for chance in (lower, higher)
    )
    assert not (many & ~few).any()
    fresh = [
        schedule_exposures(RIG, FaultsSection(frozen=chance), TIME, seed=seed).source == np.arange(len(TIME))[:, None]
        for chance in (lower, higher)
    ]
    assert not (fresh[1] & ~fresh[0]).any()


def test_errors_scale_with_their_parameters():
    """The same directions, twice as far."""
    for fault, of in (
        ("translation", lambda rig: rig.centers - RIG.centers),
        ("center", lambda rig: np.array([a.K[:2, 2] - b.K[:2, 2] for a, b in zip(rig, RIG, strict=True)])),
        ("focal", lambda rig: np.array([np.log(a.K[0, 0] / b.K[0, 0]) for a, b in zip(rig, RIG, strict=True)])),
        ("rotation", lambda rig: rotations(rig, RIG)),
    ):
        once, twice = (
            of(schedule_exposures(RIG, FaultsSection(**{fault: size}), TIME, seed=1).believed_rig)
            for size in (0.01, 0.02)
        )
        assert np.abs(once).min() > 0
        np.testing.assert_allclose(twice, 2 * once, rtol=1e-6)


def test_another_camera_and_more_frames_change_no_draws():
    faults = FaultsSection(**{key: value for key, value in FAULTS.items() if key not in ("dead", "swapped")})
    few = schedule_exposures(RIG, faults, TIME, seed=3)
    more = schedule_exposures(Rig([*RIG, MANY[0]]), faults, np.arange(50) / 10, seed=3)
    for a, b in zip(fields(few), fields(more), strict=True):
        if a.ndim:
            np.testing.assert_array_equal(a, b[tuple(slice(n) for n in a.shape)])


def rotations(rig, other):
    pairs = zip(rig, other, strict=True)
    return np.array([Rotation.from_matrix(a.R @ b.R.T).as_rotvec() for a, b in pairs])


def test_errors_have_the_requested_spread():
    """Over 64 cameras and 4 seeds: within 4 standard errors of the standard deviation, 4 / sqrt(2 n)."""
    faults = FaultsSection(focal=0.01, center=3.0, rotation=0.2, translation=0.008, clock_offset=0.05)
    found = {"focal": [], "center": [], "rotation": [], "translation": [], "clock_offset": []}
    for seed in range(4):
        exposures = schedule_exposures(MANY, faults, TIME[:2], seed=seed)
        for believed, true in zip(exposures.believed_rig, MANY, strict=True):
            assert believed.K[1, 1] / believed.K[0, 0] == pytest.approx(true.K[1, 1] / true.K[0, 0])
            assert believed.distortion.tolist() == true.distortion.tolist()
            found["focal"].append(believed.K[0, 0] / true.K[0, 0] - 1)
            found["center"] += list(believed.K[:2, 2] - true.K[:2, 2])
            found["translation"] += list(believed.center - true.center)
        found["rotation"] += list(np.degrees(rotations(exposures.believed_rig, MANY)).ravel())
        found["clock_offset"] += list(exposures.time[0] - TIME[0])
        np.testing.assert_allclose(exposures.time[1] - exposures.time[0], 0.1)  # offsets are constant
    for fault, draws in found.items():
        requested, bound = getattr(faults, fault), 4 / np.sqrt(2 * len(draws))
        assert np.std(draws) == pytest.approx(requested, rel=bound), fault
        assert abs(np.mean(draws)) < 4 * requested / np.sqrt(len(draws)), fault


def test_faults_and_cameras_are_independent_of_each_other():
    """No two of them are correlated by more than 4.5 standard errors, 1 / sqrt(n)."""
    faults = FaultsSection(
        rotation=0.2, translation=0.008, rotation_drift=3.0, translation_drift=0.1, clock_offset=0.05
    )
    exposures = schedule_exposures(MANY, faults, np.arange(300.0), seed=0)
    moves = np.array([a.center - b.center for a, b in zip(exposures.believed_rig, MANY, strict=True)])
    turns = rotations(exposures.believed_rig, MANY)
    constant = np.column_stack([moves, turns, exposures.rotation_rate, exposures.velocity, exposures.time[0]])
    assert (np.abs(np.corrcoef(constant.T) - np.eye(13)) < 4.5 / np.sqrt(64)).all()
    time = np.arange(300.0)
    dropped = schedule_exposures(RIG, FaultsSection(dropped=0.5), time, seed=0).delivered
    frozen = schedule_exposures(RIG, FaultsSection(frozen=0.5), time, seed=0).source != np.arange(300)[:, None]
    jitter = schedule_exposures(RIG, FaultsSection(clock_jitter=0.1), time, seed=0).time - time[:, None]
    of_pictures = np.column_stack([dropped, frozen, jitter])
    assert (np.abs(np.corrcoef(of_pictures.T) - np.eye(15)) < 4.5 / np.sqrt(300)).all()


def test_drift_grows_with_time_and_has_its_spread_after_a_minute():
    time = np.array([0.0, 30.0, 60.0])
    exposures = schedule_exposures(MANY, FaultsSection(rotation_drift=3.0, translation_drift=0.05), time, seed=0)
    still, half, whole = ([exposures.camera(t, v) for v in range(64)] for t in range(3))
    assert all(a is b for a, b in zip(still, MANY, strict=True))
    turns = np.degrees(rotations(whole, MANY))
    assert turns.std() == pytest.approx(3.0, rel=4 / np.sqrt(2 * turns.size))
    np.testing.assert_allclose(np.degrees(rotations(half, MANY)), turns / 2, atol=1e-9)
    moves = np.array([a.center - b.center for a, b in zip(whole, MANY, strict=True)])
    assert moves.std() == pytest.approx(0.05, rel=4 / np.sqrt(2 * moves.size))
    assert exposures.believed_rig is MANY


def test_clock_errors_stay_within_the_planned_motions():
    exposures = schedule_exposures(MANY, FaultsSection(clock_offset=5.0, clock_jitter=1.0), TIME, seed=0)
    off = exposures.time - TIME[:, None]
    assert np.abs(off).max() <= MAX_CLOCK_ERROR + 1e-12
    assert (np.abs(off) > 0.85).any()


def test_jitter_is_drawn_for_every_picture():
    off = schedule_exposures(MANY, FaultsSection(clock_jitter=0.01), TIME, seed=0).time - TIME[:, None]
    assert off.std() == pytest.approx(0.01, rel=4 / np.sqrt(2 * off.size))
    assert abs(np.corrcoef(off[:-1].ravel(), off[1:].ravel())[0, 1]) < 4 / np.sqrt(off.size)


@given(seed=st.integers(0, 10**6), dropped=st.floats(0, 1), frozen=st.floats(0, 1))
def test_a_frozen_camera_repeats_the_last_picture_that_arrived(seed, dropped, frozen):
    """Compared with a frame-by-frame simulation of a camera."""
    exposures = schedule_exposures(
        RIG, FaultsSection(dropped=dropped, frozen=frozen, clock_jitter=0.01), TIME, seed=seed
    )
    lost = ~schedule_exposures(RIG, FaultsSection(dropped=dropped), TIME, seed=seed).delivered
    clock = schedule_exposures(RIG, FaultsSection(clock_jitter=0.01), TIME, seed=seed).time
    stuck = (
        schedule_exposures(RIG, FaultsSection(frozen=frozen), TIME, seed=seed).source != np.arange(len(TIME))[:, None]
    )
    for view in range(len(RIG)):
        last = -1
        for frame in range(len(TIME)):
            source = exposures.source[frame, view]
            if lost[frame, view]:
                assert source == -1
                continue
            if stuck[frame, view] and last >= 0:
                assert source == last
            elif not stuck[frame, view] and frame:
                assert source == frame
            last = source
            assert exposures.time[frame, view] == clock[source, view]


def test_loss_rates_are_as_requested():
    time = np.arange(400) / 30
    exposures = schedule_exposures(RIG, FaultsSection(dropped=0.1, frozen=0.3), time, seed=0)
    lost = ~exposures.delivered
    repeated = exposures.delivered & (exposures.source < np.arange(400)[:, None])
    assert lost.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 2000))
    assert repeated.mean() == pytest.approx(0.27, abs=4 * np.sqrt(0.2 / 2000))
    assert not schedule_exposures(RIG, FaultsSection(dropped=1.0, frozen=1.0), time, seed=0).delivered.any()


def test_dead_cameras_deliver_nothing_and_others_everything():
    exposures = schedule_exposures(RIG, FaultsSection(dead=(1, 3)), TIME, seed=0)
    assert exposures.delivered.all(axis=0).tolist() == [True, False, True, False, True]
    assert exposures.delivered.any(axis=0).tolist() == [True, False, True, False, True]


def test_swapped_cameras_deliver_pictures_times_and_losses_of_the_other():
    faults = {
        "clock_offset": 0.1,
        "clock_jitter": 0.01,
        "dropped": 0.2,
        "frozen": 0.2,
        "rotation_drift": 9.0,
        "dead": (4,),
    }
    unswapped = schedule_exposures(RIG, FaultsSection(**faults), TIME, seed=0)
    exposures = schedule_exposures(RIG, FaultsSection(**faults, swapped=((0, 4), (1, 2))), TIME, seed=0)
    for view, camera in enumerate((4, 2, 1, 3, 0)):
        np.testing.assert_array_equal(exposures.time[:, view], unswapped.time[:, camera])
        np.testing.assert_array_equal(exposures.source[:, view], unswapped.source[:, camera])
        np.testing.assert_array_equal(exposures.camera(20, view).R, unswapped.camera(20, camera).R)
    assert exposures.believed_rig is RIG
    assert not exposures.delivered[:, 0].any()  # the pictures of the dead camera are missing under any name


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"dead": (5,)}, r"faults\.dead = \[5\] names camera 5, but the rig has 5 cameras: expected 0 to 4"),
        ({"swapped": ((0, 7),)}, r"faults\.swapped = \[\[0, 7\]\] names camera 7"),
        ({"swapped": ((1, 1),)}, r"faults\.swapped names camera 1 with itself"),
        ({"swapped": ((0, 1), (1, 2))}, r"faults\.swapped = .* swaps camera 1 twice"),
    ],
)
def test_unknown_cameras_are_named(faults, message):
    with pytest.raises(ValueError, match=message):
        schedule_exposures(RIG, FaultsSection(**faults), TIME, seed=0)


def test_cameras_of_different_sizes_are_not_swapped():
    rig = Rig([RIG[0], build_rig(CamerasSection(size=(640, 480)))[1]])
    with pytest.raises(ValueError, match=r"faults\.swapped: .* different sizes, 800 x 600 and 640 x 480"):
        schedule_exposures(rig, FaultsSection(swapped=((0, 1),)), TIME, seed=0)


def test_a_sequence_without_frames_has_no_pictures():
    exposures = schedule_exposures(RIG, FaultsSection(**FAULTS), np.zeros(0), seed=0)
    assert exposures.time.shape == exposures.source.shape == (0, 5)
