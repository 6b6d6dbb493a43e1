"""Audit of simulated trials: a correct trial passes, and every kind of fault is found."""

from dataclasses import replace

import numpy as np
import pytest

from mvpose import Rig
from simharness.scenario.load import load_study
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.people_section import PeopleSection, PushSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import RenderingSection, Scenario
from simharness.study.study_run import run_study
from simharness.trial.audit import AuditError, audit, check_calibration, check_clocks, sampled_pictures
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import CaptureFrames
from simharness.types.views import Visibility
from simharness.world.rigs.faults import schedule_exposures
from simharness.world.scene.playback import simulate

ALL_FAULTS = FaultsSection(
    focal=0.01, center=3.0, rotation=0.3, translation=0.01, rotation_drift=0.5, translation_drift=0.02,
    clock_offset=0.05, clock_jitter=0.01, dropped=0.1, frozen=0.2, dead=(1,), swapped=((0, 2),),
)  # fmt: skip


def small(**sections) -> Scenario:
    defaults = {
        "people": PeopleSection(count=2, activities=("wave", "walk")),
        "cameras": CamerasSection(count=3, size=(320, 240)),
        "clutter": ClutterSection(boxes=1),
    }
    return Scenario(name="small", seed=5, duration=0.6, rate=10.0, **{**defaults, **sections})


class Ready:
    def __init__(self, scenario):
        self.scenario = scenario
        trial = build_trial(scenario)
        self.scene, self.exposures = trial.scene, trial.exposures
        self.sequence = simulate(trial.scene)
        self.views = CaptureFrames(scenario, trial.scene, trial.exposures, frozenset())(range(scenario.frames))

    def audit(self, **changed):
        parts = {
            "scene": self.scene,
            "exposures": self.exposures,
            "sequence": self.sequence,
            "views": self.views,
        } | changed
        audit(self.scenario, **parts)


@pytest.fixture(scope="module")
def ready() -> Ready:
    return Ready(small())


def test_a_correct_trial_passes(ready):
    ready.audit()
    assert (ready.views.visibility == Visibility.VISIBLE).sum() > 100  # or it would pass for want of joints


@pytest.mark.slow
@pytest.mark.parametrize(
    "sections",
    [
        {"faults": ALL_FAULTS},
        {"faults": FaultsSection(rolling_shutter=0.03)},
        {"cameras": CamerasSection(count=3, size=(320, 240), distortion=(-0.3, 0.1, 0.001, -0.001, 0.0))},
        {"rendering": RenderingSection(renderer="rays")},
        {"people": PeopleSection(count=0)},
        {"people": PeopleSection(count=2, playback="dynamic", push=PushSection(time=0.0, impulse=120.0))},
    ],
    ids=["faults", "rolling shutter", "distortion", "rays", "nobody", "pushed"],
)
def test_every_kind_of_scenario_passes(sections):
    Ready(small(**sections)).audit()


def test_a_truth_with_an_error_of_a_pixel_is_found(ready):
    with pytest.raises(AuditError, match=r"projection: frame 0, view 0, person \d, joint \d+ is at .* OpenCV"):
        ready.audit(views=replace(ready.views, pixels=ready.views.pixels + 1.0))


def test_a_person_in_the_place_of_another_is_found(ready):
    swapped = replace(ready.views, pixels=ready.views.pixels[:, :, ::-1], visibility=ready.views.visibility[:, :, ::-1])
    with pytest.raises(AuditError, match="projection"):
        ready.audit(views=swapped)


def test_hidden_joints_that_are_labelled_visible_are_found(ready):
    inside = ready.views.visibility != Visibility.OUTSIDE
    labels = np.where(inside, Visibility.VISIBLE, Visibility.OUTSIDE).astype(np.int8)
    with pytest.raises(AuditError, match=r"pictures: of \d+ visible joints .* only \d+ lie where"):
        ready.audit(views=replace(ready.views, visibility=labels))


@pytest.mark.parametrize(
    ("actual", "expected", "message"),
    [
        (FaultsSection(clock_offset=0.1), FaultsSection(), "clocks: the picture of view .* ms late"),
        (FaultsSection(clock_jitter=0.1), FaultsSection(clock_jitter=0.001), "clocks: the picture of view"),
        (FaultsSection(dropped=0.5), FaultsSection(), "clocks: pictures are missing"),
        (
            FaultsSection(frozen=0.5),
            FaultsSection(dropped=0.5),
            "clocks: pictures are missing or repeated, but the scenario .* faults.frozen",
        ),
        (FaultsSection(), FaultsSection(dead=(1,)), "clocks: camera 1 delivers"),
    ],
)
def test_clocks_that_differ_from_the_scenario_are_found(ready, actual, expected, message):
    time = np.arange(30) / 10.0
    exposures = schedule_exposures(ready.exposures.true_cameras, actual, time, seed=0)
    check_clocks(actual, exposures, time)
    with pytest.raises(AuditError, match=message):
        check_clocks(expected, exposures, time)


@pytest.mark.parametrize(
    ("actual", "quantity"),
    [
        (FaultsSection(focal=0.01), "focal length"),
        (FaultsSection(center=2.0), "principal point"),
        (FaultsSection(rotation=0.2), "orientation"),
        (FaultsSection(translation=0.01), "position"),
        (FaultsSection(rotation_drift=3.0), "orientation"),
        (FaultsSection(translation_drift=0.1), "position"),
        (FaultsSection(swapped=((0, 1),)), "position"),
    ],
)
def test_a_calibration_that_differs_from_the_scenario_is_found(ready, actual, quantity):
    exposures = schedule_exposures(ready.exposures.true_cameras, actual, np.arange(30) / 10.0, seed=0)
    check_calibration(actual, exposures)
    with pytest.raises(
        AuditError, match=f"calibration: camera .* differs in .*{quantity if quantity != 'position' else ''}"
    ):
        check_calibration(FaultsSection(), exposures)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_errors_of_focal_length_pass_up_to_the_allowed_size(ready, share):
    """The error is log-normal: three deviations up are more than three down."""
    time = np.arange(3) / 10.0
    faults = FaultsSection(focal=share)
    for seed in range(150):
        check_calibration(faults, schedule_exposures(ready.exposures.true_cameras, faults, time, seed=seed))
    exposures = schedule_exposures(ready.exposures.true_cameras, FaultsSection(), time, seed=0)
    for length in np.exp([7 * share, -7 * share]):
        scale = np.diag([length, length, 1.0])
        wide = Rig([replace(camera, K=camera.K @ scale) for camera in exposures.believed_rig])
        with pytest.raises(AuditError, match="focal length"):
            check_calibration(faults, replace(exposures, believed_rig=wide))


def moved_projections(monkeypatch, pixels):
    """Add an error of some pixels to the truth in the pictures, as from a wrong projection."""
    captured = CaptureFrames.__call__

    def wrong(self, frames):
        views = captured(self, frames)
        return replace(views, pixels=views.pixels + pixels)

    monkeypatch.setattr(CaptureFrames, "__call__", wrong)


@pytest.mark.slow
def test_a_wrong_projection_fails_the_trials_of_a_study(tmp_path, monkeypatch):
    path = tmp_path / "tiny.toml"
    path.write_text(
        'extends = "quickstart"\nname = "tiny"\nseeds = 2\nduration = 0.4\nrate = 5.0\nvariants = ["fast"]\n'
        'rendering.renderer = "rays"\npeople.count = 2\n'
    )
    study = load_study(path)
    moved_projections(monkeypatch, 0.5)
    results = run_study(study, out=tmp_path / "out")
    assert len(results.info["failed"]) == 2
    assert all(failed["error"].startswith("audit: projection: frame ") for failed in results.info["failed"])
    assert results.trials.is_empty()
    monkeypatch.undo()
    assert run_study(study, out=tmp_path / "out").info["failed"] == []


@pytest.mark.parametrize("until", ["detect", "estimate", "score", "classify", "blame"])
def test_every_goal_is_audited(monkeypatch, until):
    scenario = small(rendering=RenderingSection(renderer="rays"))
    moved_projections(monkeypatch, 0.5)
    with pytest.raises(AuditError, match=r"^audit: projection"):
        run_trial(scenario, until=until)


def test_pictures_are_sampled_by_the_seed_and_in_all_frames(ready):
    chosen = [sampled_pictures(ready.exposures, seed) for seed in range(200)]
    assert chosen[3] == sampled_pictures(ready.exposures, 3)
    assert {len(pictures) for pictures in chosen} == {3}
    assert {picture for pictures in chosen for picture in pictures} == set(
        map(tuple, np.argwhere(ready.exposures.delivered).tolist())
    )
