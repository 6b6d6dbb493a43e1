"""What ships: studies can be read and built, every factor changes something, and settings share their other draws."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from trials import measured

from simharness.detector.detect import Detected
from simharness.scenario.load import Setting, Study, load_study
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import Trial, build_trial, true_rig
from simharness.types.sequence import Sequence
from simharness.world.rigs.faults import schedule_exposures

SCENARIOS = Path(__file__).parents[3] / "scenarios"
SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
STUDIES = [
    "angle",
    "calibration",
    "clocks",
    "clutter",
    "crowd",
    "detector",
    "failure_modes",
    "look_alike",
    "panoptic",
    "phantoms",
    "stress",
    "sync",
    "tracking",
    "views",
    "views_corners",
    "views_side",
]
LONGER = {"tracking": 150, "clocks": 90}  # frames: who is who shows over time, and times of pictures at video rate
assert set(LONGER) <= set(STUDIES)


@cache
def shipped(name: str) -> Study:
    return load_study(SCENARIOS / f"{name}.toml")


def setting(study: str, factors: Mapping[str, object], case: str | None = None) -> Setting:
    """The setting of a shipped study with these factors, the others where they are not varied or come first."""
    return next(
        each
        for each in shipped(study).settings
        if case in (None, each.case) and all(each.factors[key] == value for key, value in factors.items())
    )


@dataclass(frozen=True)
class Seen:
    trial: Trial
    sequence: Sequence
    detected: list[Detected]

    @property
    def things(self) -> list[tuple[str, tuple[float, ...]]]:
        return [(solid.name, tuple(solid.hull.center)) for solid in self.trial.scene.solids if solid.kind == "clutter"]

    @property
    def visibility(self) -> np.ndarray:
        return np.stack([frame.truth.visibility for frame in self.detected])

    @property
    def false(self) -> int:
        return sum(int((frame.truth.person < 0).sum()) for frame in self.detected)

    @property
    def real(self) -> dict[tuple[int, int, int], list[bytes]]:
        """Every bit of the detections of real people, by frame, view and person."""
        result: dict[tuple[int, int, int], list[bytes]] = {}
        for t, frame in enumerate(self.detected):
            given = frame.detections
            for k in np.flatnonzero(frame.truth.person >= 0):
                parts = (given.keypoints[k], given.scores[k], given.boxes[k], given.box_scores[k])
                key = (t, int(given.view[k]), int(frame.truth.person[k]))
                result.setdefault(key, []).append(b"".join(part.tobytes() for part in parts))
        return {key: sorted(each) for key, each in result.items()}


def see(chosen: Setting, *, seed: int = 0) -> Seen:
    """A second of a setting."""
    result = run_trial(chosen.scenario.model_copy(update={"seed": seed, "duration": 1.0, "rate": 6.0}), until="detect")
    seen = Seen(result.trial, result.simulation.sequence, list(result.detected.frames))
    assert len(seen.real) > 20, "hardly anybody was seen"
    return seen


class TestFiles:
    def test_all_that_is_promised_ships(self):
        single, suites = (
            {"quickstart", "gathering", "passage", "pushed", "campus", "shelf"},
            {"ci", "ci_tracking", "ci_repair"},
        )
        assert single | suites | {*STUDIES} <= set(SHIPPED)

    @pytest.mark.parametrize("name", SHIPPED)
    def test_it_is_named_as_its_file_and_says_what_it_is_in_one_line(self, name):
        study = shipped(name)
        assert study.name == name
        said = study.description
        assert said[0].isupper() or said[0].isdigit()
        assert "\n" not in said
        assert said[-1] not in ". "
        assert len(said) <= 120

    @pytest.mark.parametrize("name", SHIPPED)
    def test_its_first_line_tells_a_reader_what_it_is_for(self, name):
        first = (SCENARIOS / f"{name}.toml").read_text(encoding="utf-8").splitlines()[0]
        assert first.startswith("# ")
        assert first[-1] in ".?"

    @pytest.mark.parametrize("name", STUDIES)
    def test_a_study_has_scenes_to_average_over_needs_no_pictures_and_takes_minutes(self, name):
        study = shipped(name)
        assert len(study.seeds) >= 20
        assert len(study.variants) >= 3
        assert study.trials <= 600
        for each in study.settings:
            assert each.scenario.rendering.renderer == "rays"
            assert each.scenario.appearance.source != "pictures"
            assert each.scenario.frames <= LONGER.get(name, 20)


class TestSettings:
    @pytest.mark.parametrize("name", SHIPPED)
    def test_no_two_settings_are_the_same_scenario(self, name):
        settings = shipped(name).settings
        assert len({each.scenario.model_dump_json() for each in settings}) == len(settings)

    @pytest.mark.parametrize("name", STUDIES)
    def test_every_factor_changes_the_scenario_by_itself(self, name):
        study = shipped(name)
        assert study.factors
        for factor in study.factors:
            assert len({each.factors[factor] for each in study.settings}) >= 2
        paired = not study.one_at_a_time and len(study.settings) < 2 ** len(study.factors)
        for each in study.settings:
            for other in study.settings:
                changed = [key for key in study.factors if each.factors[key] != other.factors[key]]
                if each is not other and paired:
                    assert changed == list(study.factors)
                if each.case == other.case and len(changed) == 1:
                    assert each.scenario != other.scenario

    @pytest.mark.slow
    @pytest.mark.parametrize("name", SHIPPED)
    def test_the_ends_of_every_factor_can_be_built(self, name):
        study = shipped(name)
        ends = {each.varied: each for each in study.settings} if study.one_at_a_time else {}
        built = set()
        for chosen in {id(each): each for each in (study.settings[0], *ends.values(), study.settings[-1])}.values():
            scenario = study.at(chosen, study.seeds[0])
            if scenario.detector.networks:  # which need not be on this machine
                scenario = scenario.model_copy(update={"detector": DetectorSection()})
            scene = scenario.model_dump_json(exclude={"faults", "detector"})
            if scene in built:  # the rest concerns pictures of what stands there already
                schedule_exposures(true_rig(scenario), scenario.faults, np.arange(scenario.frames), seed=scenario.seed)
            else:
                assert len(build_trial(scenario).scene.bodies) == scenario.people.count
                built.add(scene)
        assert built

    @pytest.mark.slow
    def test_the_dial_of_stress_goes_from_harmless_to_broken(self):
        settings = shipped("stress").settings
        low, high = (measured(each.scenario, ["fast"], blame=False)["fast"].scores["pcp"] for each in settings[::5])
        assert low is not None
        assert low > 90
        assert high is not None
        assert high < 40


class TestPairing:
    """Settings at one seed share every draw that their factors do not name."""

    @pytest.mark.slow
    def test_the_number_of_cameras_moves_neither_people_nor_things(self):
        # At this seed things would stand elsewhere for 12 cameras if those hung as low as in quickstart.
        few, many = (see(setting("views", {"cameras.count": count}), seed=3) for count in (2, 12))
        assert np.array_equal(few.sequence.joints, many.sequence.joints)
        assert few.things == many.things
        assert len(few.things) == 7

    @pytest.mark.slow
    def test_a_camera_more_changes_nothing_of_what_the_others_see(self):
        few, many = (see(setting("panoptic", {"cameras.preset": preset})) for preset in ("panoptic3", "panoptic7"))
        assert np.array_equal(few.sequence.joints, many.sequence.joints)
        assert few.real == {key: each for key, each in many.real.items() if key[1] < 3}
        assert len(many.real) > len(few.real)

    @pytest.mark.slow
    def test_phantoms_change_no_bit_of_what_is_seen_of_people(self):
        few, lasting, shared = (
            see(setting("phantoms", {"detector.phantoms.rate": rate}, case))
            for rate, case in ((0.5, "transient"), (4.0, "persistent"), (4.0, "persistent_in_all_views"))
        )
        assert few.real == lasting.real == shared.real
        assert 0 < few.false < min(lasting.false, shared.false)

    @pytest.mark.slow
    def test_one_person_more_changes_nobody_before(self):
        few, many = (see(setting("crowd", {"people.count": count})) for count in (3, 4))
        assert np.array_equal(few.sequence.joints, many.sequence.joints[:, :3])

    @pytest.mark.slow
    def test_things_change_only_what_is_seen_of_those_whom_they_hide(self):
        free, hidden = (see(setting("clutter", {"clutter.coverage": share})) for share in (0.0, 0.3))
        assert np.array_equal(free.sequence.joints, hidden.sequence.joints)
        alike = (free.visibility == hidden.visibility).all(axis=-1)
        assert 0.1 < alike.mean() < 0.9
        before, after = ({key: each for key, each in seen.real.items() if alike[key]} for seen in (free, hidden))
        assert before == after
        assert len(before) > 10

    @pytest.mark.slow
    def test_pictures_that_arrive_are_seen_alike_however_many_others_are_dropped(self):
        few, many = (see(setting("sync", {"faults.dropped": share})) for share in (0.1, 0.4))
        assert many.real == {key: few.real[key] for key in many.real}
        assert len(many.real) < len(few.real)

    @pytest.mark.slow
    def test_a_wrong_calibration_changes_no_picture(self):
        right, wrong = (see(setting("calibration", {"faults.rotation": degrees})) for degrees in (0.0, 4.0))
        assert np.array_equal(right.sequence.joints, wrong.sequence.joints)
        assert right.real == wrong.real
        for before, after in zip(right.detected, wrong.detected, strict=True):
            assert np.array_equal(before.truth.pixels, after.truth.pixels)
            assert np.array_equal(before.truth.visibility, after.truth.visibility)

    @pytest.mark.slow
    def test_detectors_look_at_the_same_people_among_the_same_things(self):
        good, bad = (see(setting("detector", {"detector.profile": profile})) for profile in ("perfect", "poor"))
        assert np.array_equal(good.sequence.joints, bad.sequence.joints)
        assert np.array_equal(good.visibility, bad.visibility)
        assert good.real != bad.real

    @pytest.mark.slow
    def test_clothes_move_nobody(self):
        apart, alike = (see(setting("look_alike", {"people.look_alike": dial})) for dial in (0.0, 1.0))
        assert np.array_equal(apart.sequence.joints, alike.sequence.joints)
        assert apart.things == alike.things
