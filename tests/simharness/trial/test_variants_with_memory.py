"""Variants with memory in trials: order of frames, processes, checks, times, archives, failures."""

import time

import numpy as np
import pytest
from moments import crowd, moment, ring

from mvpose import SHELF14, Detections, Estimate, preset
from mvpose.commands.errors import RunError
from simharness.scenario.load import load
from simharness.scoring.stage_blame import Stage
from simharness.trial.archive import pack_detected, pack_estimates, unpack_detected, unpack_estimates
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.estimation import track_frames
from simharness.trial.stages.estimators import UserEstimator, UserTracker, user_estimator

TRACKERS = """
import os
import time

import numpy as np

from mvpose import Estimate, preset


class Counting:
    # The score of everybody is the number of frames so far, in hundredths.
    def track(self, rig, frames):
        fast = preset("fast")
        for number, detections in enumerate(frames, start=1):
            joints = fast.estimate(rig, detections).joints
            yield Estimate.of_joints(joints, scores=np.full(len(joints), number / 100))


class Late:
    # Two frames of lag.
    def track(self, rig, frames):
        waiting = []
        for detections in frames:
            waiting.append(Estimate.of_joints(preset("fast").estimate(rig, detections).joints))
            if len(waiting) > 2:
                yield waiting.pop(0)
        yield from waiting


class Broken:
    def track(self, rig, frames):
        for number, detections in enumerate(frames):
            yield Estimate.of_joints([] if number < 3 else 1 / 0)  # BROKEN


class Few:
    def track(self, rig, frames):
        yield from (Estimate.of_joints([]) for number, _ in enumerate(frames) if number != 2)


class Lazy:
    def track(self, rig, frames):
        next(iter(frames))
        yield Estimate.of_joints([])


class Many:
    def track(self, rig, frames):
        for _ in frames:
            yield Estimate.of_joints([])
            yield Estimate.of_joints([])


class Wrong:
    def track(self, rig, frames):
        for number, _ in enumerate(frames):
            yield Estimate.of_joints([]) if number < 1 else {"joints": []}


class Both(Counting):
    def estimate(self, rig, detections):
        return Estimate.of_joints([])
"""
BROKEN_LINE = TRACKERS[: TRACKERS.index("# BROKEN")].count("\n") + 1
SCENE = """
name = "memory"
duration = 0.8
rate = 10
rendering.renderer = "rays"
people.count = 2
detector.profile = "typical"
"""
RIG = ring(4)
SEEN, TRUTH = moment(RIG, crowd(2, spacing=1.2))


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "trackers.py"
    path.write_text(TRACKERS)
    return path


@pytest.fixture
def scenario(file):
    def write(*variants, lines=""):
        path = file.with_name("memory.toml")
        own = [name for name in variants if name[0].isupper()]
        names = [name.lower() for name in variants]
        places = "\n".join(f'{name.lower()} = "trackers.py:{name}"' for name in own)
        path.write_text(f"{SCENE}variants = {names}\n{lines}\n[method.estimators]\n{places}\n".replace("'", '"'))
        return load(path)

    return write


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    path = tmp_path_factory.mktemp("tracked") / "tracked.toml"
    path.write_text(f'{SCENE}variants = ["track", "fast", "track-fast"]\nfaults.dropped = 0.2\n')
    return run_trial(load(path))


def of_bytes(estimates):
    return [(each.joints.tobytes(), each.scores.tobytes(), each.time) for each in estimates]


class TestOrder:
    def test_a_variant_with_memory_gets_all_frames_in_order(self, scenario):
        estimates = run_trial(scenario("Counting"), until="estimate").estimates["counting"]
        assert [round(100 * each.scores.max()) for each in estimates] == list(range(1, 9))

    @pytest.mark.slow
    def test_results_do_not_depend_on_the_number_of_processes(self, scenario):
        loaded = scenario("track-fast", "fast", "Counting", "track")
        one, two = (run_trial(loaded, until="estimate", workers=workers).estimates for workers in (1, 2))
        assert list(one) == list(two) == ["track-fast", "fast", "counting", "track"]
        for name in one:
            assert of_bytes(one[name]) == of_bytes(two[name]), name

    def test_the_detections_are_those_of_the_other_variants(self, scenario):
        estimates = run_trial(scenario("Late", "fast"), until="estimate").estimates
        for one, other in zip(estimates["late"], estimates["fast"], strict=True):
            np.testing.assert_array_equal(one.joints, other.joints)

    def test_the_presets_are_those_of_mvpose(self, tracked):
        recording = tracked.recording
        estimates = preset("track-fast", lag=0.2, period=0.1).track(recording.rig, recording.detections)
        assert of_bytes(estimates) == of_bytes(tracked.estimates["track-fast"])

    def test_the_lag_is_that_of_the_scenario(self, scenario):
        loaded = scenario("track-fast", lines="method.lag = 0.0")
        result = run_trial(loaded, until="estimate")
        estimator = preset("track-fast", lag=0.0, period=0.1)
        estimates = estimator.track(result.recording.rig, result.recording.detections)
        assert of_bytes(estimates) == of_bytes(result.estimates["track-fast"])


class TestUserDefined:
    def test_an_object_with_track_is_a_variant_with_memory(self, file):
        for name in ("Counting", "Both"):
            assert type(user_estimator("own", f"{file}:{name}")) is UserTracker
        assert len(user_estimator("own", f"{file}:Counting").estimate(RIG, SEEN)) == 2
        assert len(user_estimator("own", f"{file}:Both").estimate(RIG, SEEN)) == 0
        other = file.with_name("others.py")
        other.write_text(TRACKERS.replace("def track", "def other"))
        assert type(user_estimator("own", f"{other}:Both")) is UserEstimator

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("Broken", rf"frame 3: own .*: ZeroDivisionError: .*line {BROKEN_LINE}"),
            ("Few", "frame 4: own .*: track yielded 4 estimates for 5 frames, expected one for each frame, in order"),
            ("Lazy", "frame 1: own .*: track yielded 1 estimates for 5 frames"),
            ("Many", "frame 1: own .*: track yielded 2 estimates after it took 1 frames"),
            ("Wrong", r"frame 1: own .*: track yielded dict, expected mvpose\.Estimate"),
        ],
    )  # fmt: skip
    def test_wrong_estimates_are_reported_with_their_frame(self, file, name, message):
        with pytest.raises(RunError, match=f"^{message}"):
            track_frames(UserTracker("own", f"{file}:{name}"), RIG, [SEEN] * 5)

    def test_a_failed_trial_names_stage_frame_and_estimator(self, scenario):
        with pytest.raises(RunError, match=r"^estimate: frame 3: broken \(.*trackers\.py:Broken\): ZeroDivisionError"):
            run_trial(scenario("Broken"))


class Sleeper:
    """Tracker that takes a known time for each frame, and passes estimates on one frame late."""

    def estimate(self, rig, detections):
        raise NotImplementedError

    def track(self, rig, frames):
        earlier = 0
        for number, _ in enumerate(frames):
            time.sleep(0.02 * (number == 2))
            if number:
                yield Estimate.of_joints([])
                earlier += 1
        time.sleep(0.02)
        yield Estimate.of_joints([])


def test_a_frame_takes_the_time_until_the_next_is_taken():
    def frames():
        for _ in range(5):
            time.sleep(0.05)  # to make detections is no part of it
            yield SEEN

    seconds = [each.timings["total"] for each in track_frames(Sleeper(), RIG, frames())]
    assert [value >= 0.02 for value in seconds] == [False, False, True, False, True]
    assert max(seconds) < 0.05


class Reader:
    """Tracker that reads the whole recording, then takes a known time."""

    def estimate(self, rig, detections):
        raise NotImplementedError

    def track(self, rig, frames):
        count = len(list(frames))
        time.sleep(0.05)
        yield from [Estimate.of_joints([])] * count


def test_the_time_after_the_last_frame_is_shared_by_the_frames_that_waited_for_it():
    seconds = [each.timings["total"] for each in track_frames(Reader(), RIG, [SEEN] * 5)]
    assert sum(seconds) >= 0.05
    np.testing.assert_allclose(seconds, 0.01, rtol=0.5)


def test_an_error_of_a_preset_names_the_frame():
    frames = [Detections.empty(), Detections.empty(SHELF14)]
    with pytest.raises(RunError, match=r"^frame 1: ValueError: a tracker serves one rig and one skeleton"):
        track_frames(preset("track-fast"), RIG, frames)


class TestArchives:
    def test_identities_and_times_are_restored(self, tracked):
        detected = unpack_detected(pack_detected(tracked.detected), tracked.scenario)
        for name, estimates in tracked.estimates.items():
            restored = unpack_estimates(pack_estimates(estimates), detected)
            for one, other in zip(restored, estimates, strict=True):
                assert one.time == other.time
                assert (one.ids is None) == (other.ids is None) == (name == "fast")
                if one.ids is not None:
                    assert one.ids.tobytes() == other.ids.tobytes()

    def test_times_of_pictures_are_restored(self, tracked):
        restored = unpack_detected(pack_detected(tracked.detected), tracked.scenario)
        for one, other in zip(restored.frames, tracked.detected.frames, strict=True):
            np.testing.assert_array_equal(one.detections.time, other.detections.time)


class TestFailures:
    def test_each_has_a_stage_to_blame(self, tracked):
        for name in ("track", "fast"):
            result = tracked.results[name]
            assert len(result.failures)
            assert result.failures["stage"].is_not_null().all()
            assert result.failures["matching_alone"].is_null().all() == (name == "track")
            assert sum(result.scores[f"blame_{stage}"] or 0.0 for stage in Stage) == pytest.approx(100.0)
