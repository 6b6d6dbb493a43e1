import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mvpose.camera import Rig
from simharness.scenario.sections.scenario import Cameras, Faults
from simharness.world.rigs.faults import FARTHEST, shoot
from simharness.world.rigs.layouts import build_rig
from simharness.world.rigs.shots import Shots

TIME = np.arange(40) / 10
RIG = build_rig(Cameras(count=5))
MANY = build_rig(Cameras(count=64, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0)))

DIALS = {
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


def fields(shots):
    cameras = [[shots.camera(t, v) for v in range(len(shots.believed))] for t in range(0, len(shots), 7)]
    return [
        shots.believed.packed,
        shots.time,
        shots.source,
        np.array([Rig(row).packed for row in cameras]),
        np.array(shots.readout),
    ]


def same(one, two):
    return [np.array_equal(a, b) for a, b in zip(fields(one), fields(two), strict=True)]


def test_no_faults_is_the_ideal_exactly():
    assert all(same(shoot(RIG, Faults(), TIME, seed=5), Shots.ideal(RIG, TIME)))


@pytest.mark.parametrize(
    ("dial", "touched"),
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
def test_a_dial_changes_its_own_thing_alone(dial, touched):
    unlike = [
        not equal for equal in same(shoot(RIG, Faults(**{dial: DIALS[dial]}), TIME, seed=0), Shots.ideal(RIG, TIME))
    ]
    assert unlike == [touched == name for name in ("believed", "time", "source", "true", "readout")]


@pytest.mark.parametrize("dial", DIALS)
def test_every_dial_beside_others_changes_only_what_it_should(dial):
    """All others turned up: the draws of none of them shift."""
    rest = {key: value for key, value in DIALS.items() if key != dial and key not in ("swapped", "frozen")}
    without, with_it = (shoot(RIG, Faults(**rest, **extra), TIME, seed=2) for extra in ({}, {dial: DIALS[dial]}))
    if dial in ("focal", "center", "rotation", "translation"):
        assert same(without, with_it) == [False, True, True, True, True]
        others = {"focal": "tR", "center": "tR", "rotation": "cK", "translation": "RK"}[dial]
        for a, b in zip(without.believed, with_it.believed, strict=True):
            if "K" in others:
                np.testing.assert_array_equal(a.K, b.K)
            if "R" in others:
                np.testing.assert_allclose(a.R, b.R, atol=1e-12)
            if "c" in others or "t" in others:
                np.testing.assert_allclose(a.center, b.center, atol=1e-12)
    elif dial in ("clock_offset", "clock_jitter"):
        assert same(without, with_it)[0:3] == [True, False, True]
    else:
        assert same(without, with_it)[0]


@given(seed=st.integers(0, 10**6), lower=st.floats(0, 1), more=st.floats(0, 1))
def test_a_chance_turned_up_adds_to_what_there_was(seed, lower, more):
    higher = lower + (1 - lower) * more
    few, many = (shoot(RIG, Faults(dropped=chance), TIME, seed=seed).delivered for chance in (lower, higher))
    assert not (many & ~few).any()
    fresh = [
        shoot(RIG, Faults(frozen=chance), TIME, seed=seed).source == np.arange(len(TIME))[:, None]
        for chance in (lower, higher)
    ]
    assert not (fresh[1] & ~fresh[0]).any()


def test_errors_scale_with_their_dials():
    """The same directions, twice as far."""
    for dial, of in (
        ("translation", lambda rig: rig.centers - RIG.centers),
        ("center", lambda rig: np.array([a.K[:2, 2] - b.K[:2, 2] for a, b in zip(rig, RIG, strict=True)])),
        ("focal", lambda rig: np.array([np.log(a.K[0, 0] / b.K[0, 0]) for a, b in zip(rig, RIG, strict=True)])),
        ("rotation", lambda rig: rotations(rig, RIG)),
    ):
        once, twice = (of(shoot(RIG, Faults(**{dial: size}), TIME, seed=1).believed) for size in (0.01, 0.02))
        assert np.abs(once).min() > 0
        np.testing.assert_allclose(twice, 2 * once, rtol=1e-6)


def test_one_camera_and_some_frames_more_change_none_of_the_others():
    faults = Faults(**{key: value for key, value in DIALS.items() if key not in ("dead", "swapped")})
    few = shoot(RIG, faults, TIME, seed=3)
    more = shoot(Rig([*RIG, MANY[0]]), faults, np.arange(50) / 10, seed=3)
    for a, b in zip(fields(few), fields(more), strict=True):
        if a.ndim:
            np.testing.assert_array_equal(a, b[tuple(slice(n) for n in a.shape)])


def rotations(rig, other):
    pairs = zip(rig, other, strict=True)
    return np.array([Rotation.from_matrix(a.R @ b.R.T).as_rotvec() for a, b in pairs])


def test_errors_have_the_spread_that_is_asked():
    """Over 64 cameras and 4 seeds: within 4 standard errors of the standard deviation, 4 / sqrt(2 n)."""
    faults = Faults(focal=0.01, center=3.0, rotation=0.2, translation=0.008, clock_offset=0.05)
    found = {"focal": [], "center": [], "rotation": [], "translation": [], "clock_offset": []}
    for seed in range(4):
        shots = shoot(MANY, faults, TIME[:2], seed=seed)
        for believed, true in zip(shots.believed, MANY, strict=True):
            assert believed.K[1, 1] / believed.K[0, 0] == pytest.approx(true.K[1, 1] / true.K[0, 0])
            assert believed.distortion.tolist() == true.distortion.tolist()
            found["focal"].append(believed.K[0, 0] / true.K[0, 0] - 1)
            found["center"] += list(believed.K[:2, 2] - true.K[:2, 2])
            found["translation"] += list(believed.center - true.center)
        found["rotation"] += list(np.degrees(rotations(shots.believed, MANY)).ravel())
        found["clock_offset"] += list(shots.time[0] - TIME[0])
        np.testing.assert_allclose(shots.time[1] - shots.time[0], 0.1)  # offsets are constant
    for dial, draws in found.items():
        asked, bound = getattr(faults, dial), 4 / np.sqrt(2 * len(draws))
        assert np.std(draws) == pytest.approx(asked, rel=bound), dial
        assert abs(np.mean(draws)) < 4 * asked / np.sqrt(len(draws)), dial


def test_faults_and_cameras_are_independent_of_each_other():
    """No two of them are correlated by more than 4.5 standard errors, 1 / sqrt(n)."""
    faults = Faults(rotation=0.2, translation=0.008, rotation_drift=3.0, translation_drift=0.1, clock_offset=0.05)
    shots = shoot(MANY, faults, np.arange(300.0), seed=0)
    moves = np.array([a.center - b.center for a, b in zip(shots.believed, MANY, strict=True)])
    turns = rotations(shots.believed, MANY)
    constant = np.column_stack([moves, turns, shots.turn, shots.travel, shots.time[0]])
    assert (np.abs(np.corrcoef(constant.T) - np.eye(13)) < 4.5 / np.sqrt(64)).all()
    time = np.arange(300.0)
    dropped = shoot(RIG, Faults(dropped=0.5), time, seed=0).delivered
    frozen = shoot(RIG, Faults(frozen=0.5), time, seed=0).source != np.arange(300)[:, None]
    jitter = shoot(RIG, Faults(clock_jitter=0.1), time, seed=0).time - time[:, None]
    of_pictures = np.column_stack([dropped, frozen, jitter])
    assert (np.abs(np.corrcoef(of_pictures.T) - np.eye(15)) < 4.5 / np.sqrt(300)).all()


def test_drift_grows_with_time_and_has_its_spread_after_a_minute():
    time = np.array([0.0, 30.0, 60.0])
    shots = shoot(MANY, Faults(rotation_drift=3.0, translation_drift=0.05), time, seed=0)
    still, half, whole = ([shots.camera(t, v) for v in range(64)] for t in range(3))
    assert all(a is b for a, b in zip(still, MANY, strict=True))
    turns = np.degrees(rotations(whole, MANY))
    assert turns.std() == pytest.approx(3.0, rel=4 / np.sqrt(2 * turns.size))
    np.testing.assert_allclose(np.degrees(rotations(half, MANY)), turns / 2, atol=1e-9)
    moves = np.array([a.center - b.center for a, b in zip(whole, MANY, strict=True)])
    assert moves.std() == pytest.approx(0.05, rel=4 / np.sqrt(2 * moves.size))
    assert shots.believed is MANY


def test_clocks_stay_within_what_motions_last():
    shots = shoot(MANY, Faults(clock_offset=5.0, clock_jitter=1.0), TIME, seed=0)
    off = shots.time - TIME[:, None]
    assert np.abs(off).max() <= FARTHEST + 1e-12
    assert (np.abs(off) > 0.85).any()


def test_jitter_is_drawn_for_every_picture():
    off = shoot(MANY, Faults(clock_jitter=0.01), TIME, seed=0).time - TIME[:, None]
    assert off.std() == pytest.approx(0.01, rel=4 / np.sqrt(2 * off.size))
    assert abs(np.corrcoef(off[:-1].ravel(), off[1:].ravel())[0, 1]) < 4 / np.sqrt(off.size)


@given(seed=st.integers(0, 10**6), dropped=st.floats(0, 1), frozen=st.floats(0, 1))
def test_a_frozen_camera_repeats_the_last_picture_that_arrived(seed, dropped, frozen):
    """Frame by frame, as a camera would."""
    shots = shoot(RIG, Faults(dropped=dropped, frozen=frozen, clock_jitter=0.01), TIME, seed=seed)
    lost = ~shoot(RIG, Faults(dropped=dropped), TIME, seed=seed).delivered
    own = shoot(RIG, Faults(clock_jitter=0.01), TIME, seed=seed).time
    stuck = shoot(RIG, Faults(frozen=frozen), TIME, seed=seed).source != np.arange(len(TIME))[:, None]
    for view in range(len(RIG)):
        last = -1
        for frame in range(len(TIME)):
            source = shots.source[frame, view]
            if lost[frame, view]:
                assert source == -1
                continue
            if stuck[frame, view] and last >= 0:
                assert source == last
            elif not stuck[frame, view] and frame:
                assert source == frame
            last = source
            assert shots.time[frame, view] == own[source, view]


def test_rates_of_loss_are_as_asked():
    time = np.arange(400) / 30
    shots = shoot(RIG, Faults(dropped=0.1, frozen=0.3), time, seed=0)
    lost = ~shots.delivered
    repeated = shots.delivered & (shots.source < np.arange(400)[:, None])
    assert lost.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 2000))
    assert repeated.mean() == pytest.approx(0.27, abs=4 * np.sqrt(0.2 / 2000))
    assert not shoot(RIG, Faults(dropped=1.0, frozen=1.0), time, seed=0).delivered.any()


def test_dead_cameras_deliver_nothing_and_the_others_everything():
    shots = shoot(RIG, Faults(dead=(1, 3)), TIME, seed=0)
    assert shots.delivered.all(axis=0).tolist() == [True, False, True, False, True]
    assert shots.delivered.any(axis=0).tolist() == [True, False, True, False, True]


def test_swapped_cameras_deliver_all_that_is_the_others():
    faults = {
        "clock_offset": 0.1,
        "clock_jitter": 0.01,
        "dropped": 0.2,
        "frozen": 0.2,
        "rotation_drift": 9.0,
        "dead": (4,),
    }
    own = shoot(RIG, Faults(**faults), TIME, seed=0)
    shots = shoot(RIG, Faults(**faults, swapped=((0, 4), (1, 2))), TIME, seed=0)
    for view, taker in enumerate((4, 2, 1, 3, 0)):
        np.testing.assert_array_equal(shots.time[:, view], own.time[:, taker])
        np.testing.assert_array_equal(shots.source[:, view], own.source[:, taker])
        np.testing.assert_array_equal(shots.camera(20, view).R, own.camera(20, taker).R)
    assert shots.believed is RIG
    assert not shots.delivered[:, 0].any()  # the dead camera's pictures are those that never come, under whatever name


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"dead": (5,)}, r"faults\.dead = \[5\] names camera 5, but the rig has 5 cameras: expected 0 to 4"),
        ({"swapped": ((0, 7),)}, r"faults\.swapped = \[\[0, 7\]\] names camera 7"),
        ({"swapped": ((1, 1),)}, r"faults\.swapped names camera 1 with itself"),
        ({"swapped": ((0, 1), (1, 2))}, r"faults\.swapped = .* swaps camera 1 twice"),
    ],
)
def test_cameras_that_are_not_there_are_named(faults, message):
    with pytest.raises(ValueError, match=message):
        shoot(RIG, Faults(**faults), TIME, seed=0)


def test_cameras_of_different_sizes_are_not_swapped():
    rig = Rig([RIG[0], build_rig(Cameras(size=(640, 480)))[1]])
    with pytest.raises(ValueError, match=r"faults\.swapped: .* different sizes, 800 x 600 and 640 x 480"):
        shoot(rig, Faults(swapped=((0, 1),)), TIME, seed=0)


def test_a_sequence_without_frames_has_no_pictures():
    shots = shoot(RIG, Faults(**DIALS), np.zeros(0), seed=0)
    assert shots.time.shape == shots.source.shape == (0, 5)
