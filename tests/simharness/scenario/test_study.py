"""Studies: which settings a scenario file makes, and what is refused."""

import itertools
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.load import ScenarioError, StudyTooLarge, load, load_study, read_plan
from simharness.scenario.sweep import Sweep
from simharness.study.study_folder import document

SHIPPED = sorted((Path(__file__).parents[3] / "scenarios").glob("*.toml"))


@pytest.fixture
def study_file(tmp_path):
    def write(text: str, name: str = "study.toml") -> Path:
        path = tmp_path / name
        path.write_text(f'name = "study"\n{text}', encoding="utf-8")
        return path

    return write


def refusal(path, **options) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_study(path, **options)
    return str(caught.value)


def values(study, key) -> list:
    return [setting.factors[key] for setting in study.settings]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_scenario_is_a_study(path):
    study = load_study(path)
    assert study.name == path.stem
    assert study.trials == read_plan(path).trials >= 1
    assert len({setting.scenario for setting in study.settings}) == len(study.settings)


def test_a_scenario_is_a_study_of_one_trial(study_file):
    path = study_file('seed = 5\n[gate]\nlevel = 0.01\n[method]\nvariants = ["fast"]')
    study = load_study(path)
    assert (study.trials, study.seeds, study.variants, study.factors) == (1, (5,), ("fast",), ())
    assert study.settings[0].scenario == study.base == load(path)
    assert (study.settings[0].case, study.settings[0].varied, study.settings[0].factors) == ("", "", {})
    assert study.gate.level == 0.01


class TestGrids:
    TEXT = "[sweep]\ncameras.count = [2, 3]\npeople.count = [1, 2, 4]\n"

    def test_a_sweep_is_every_combination_in_order(self, study_file):
        study = load_study(study_file(self.TEXT))
        assert study.factors == ("cameras.count", "people.count")
        assert [tuple(s.factors.values()) for s in study.settings] == list(itertools.product([2, 3], [1, 2, 4]))
        for setting in study.settings:
            assert setting.scenario.cameras.count == setting.factors["cameras.count"]
            assert setting.scenario.people.count == setting.factors["people.count"]
            assert setting.varied == ""

    def test_settings_differ_in_their_factors_alone(self, study_file):
        study = load_study(study_file(self.TEXT))
        for setting in study.settings:
            data = setting.scenario.model_dump()
            data["cameras"]["count"], data["people"]["count"] = study.base.cameras.count, study.base.people.count
            assert data == study.base.model_dump()

    def test_pairs_go_together_and_are_combined_with_the_rest(self, study_file):
        study = load_study(
            study_file(
                "[sweep]\npeople.count = [1, 2]\n[[sweep.paired]]\n"
                "cameras.count = [3, 5]\ncameras.radius = { from = 3, to = 4, steps = 2 }"
            )
        )
        assert study.factors == ("people.count", "cameras.count", "cameras.radius")
        assert [tuple(s.factors.values()) for s in study.settings] == [
            (1, 3, 3.0),
            (1, 5, 4.0),
            (2, 3, 3.0),
            (2, 5, 4.0),
        ]

    def test_every_case_is_run_with_every_setting(self, study_file):
        study = load_study(study_file(self.TEXT + "[cases.plain]\n[cases.tall]\nroom.size = [8.0, 8.0, 4.0]"))
        assert [s.case for s in study.settings] == ["plain"] * 6 + ["tall"] * 6
        assert [s.scenario.room.size[2] for s in study.settings] == [3.0] * 6 + [4.0] * 6
        assert values(study, "people.count") == [1, 2, 4] * 4

    def test_lists_words_and_presets_are_swept_too(self, study_file):
        study = load_study(
            study_file(
                '[sweep]\npeople.activities = [["walk"], ["walk", "run"]]\nroom.walls = [true, false]\n'
                'detector.profile = ["poor", "perfect"]\n[detector.phantoms]\nrate = 0.0'
            )
        )
        assert values(study, "people.activities")[::4] == [("walk",), ("walk", "run")]
        assert values(study, "room.walls")[:4] == [True, True, False, False]
        assert [s.scenario.detector.name for s in study.settings[:2]] == ["poor, changed", "perfect, changed"]
        assert {s.scenario.detector.phantoms.rate for s in study.settings} == {0.0}

    def test_presets_go_under_other_factors_whatever_their_order(self, study_file):
        text = "[sweep]\ncameras.{} = {}\ncameras.{} = {}"
        count, rig = ("count", "[2, 4]"), ("rig", '["ring8", "dome12"]')
        for order in [(*count, *rig), (*rig, *count)]:
            study = load_study(study_file(text.format(*order)))
            assert {(s.scenario.cameras.layout, s.scenario.cameras.count) for s in study.settings} == set(
                itertools.product(["ring", "dome"], [2, 4])
            )

    def test_a_number_for_all_joints_is_a_value(self, study_file):
        study = load_study(study_file("[sweep]\ndetector.keypoints.miss = { from = 0.1, to = 0.3, steps = 3 }"))
        assert values(study, "detector.keypoints.miss") == [0.1, 0.2, 0.3]
        assert [s.scenario.detector.keypoints.miss.hips for s in study.settings] == [0.1, 0.2, 0.3]

    def test_files_are_relative_to_the_study_and_those_of_the_command_line_are_not(self, study_file):
        path = study_file('[cameras]\nlayout = "file"\n[sweep]\ncameras.file = ["a.json", "b.json"]')
        assert values(load_study(path), "cameras.file") == [str(path.parent / name) for name in ("a.json", "b.json")]
        assert values(load_study(path, overrides=['sweep.cameras.file=["c.json"]']), "cameras.file") == ["c.json"]
        study = load_study(study_file('[cases.a]\ncameras = { layout = "file", file = "a.json" }'))
        assert study.settings[0].scenario.cameras.file == str(path.parent / "a.json")


class TestOneAtATime:
    def test_the_base_comes_first_then_every_value_that_is_not_its(self, study_file):
        study = load_study(
            study_file(
                "[people]\ncount = 2\n[sweep]\none_at_a_time = true\npeople.count = [1, 2, 3]\ncameras.fov = [60, 90]"
            )
        )
        assert [(s.varied, *s.factors.values()) for s in study.settings] == [
            ("", 2, 75.0),
            ("people.count", 1, 75.0),
            ("people.count", 3, 75.0),
            ("cameras.fov", 2, 60.0),
            ("cameras.fov", 2, 90.0),
        ]
        assert study.settings[0].scenario == study.base
        for setting in study.settings:
            assert setting.scenario.cameras.fov == setting.factors["cameras.fov"]

    def test_the_bases_values_are_those_of_its_presets(self, study_file):
        path = study_file(
            "[sweep]\none_at_a_time = true\ndetector.phantoms.rate = [0.0, 5.0]\ndetector.profile = ['poor']\n"
            "cameras.rig = ['ring8']\ndetector.keypoints.miss = [0.5]\nclutter.coverage = [0.5]"
        )
        base, *others = load_study(path).settings
        assert base.factors == {
            "detector.phantoms.rate": base.scenario.detector.phantoms.rate,
            "detector.profile": "typical",
            "detector.keypoints.miss": None,  # joints differ
            "cameras.rig": "",
            "clutter.coverage": None,
        }
        assert base.factors["detector.phantoms.rate"] > 0.0
        assert len(others) == 6

    def test_pairs_are_one_factor(self, study_file):
        text = (
            "[sweep]\none_at_a_time = true\n[[sweep.paired]]\npeople.count = [4, 6, 5]\npeople.area = [2.0, 3.0, 2.0]"
        )
        study = load_study(study_file(text))
        assert [(s.varied, *s.factors.values()) for s in study.settings] == [
            ("", 4, 2.0),
            ("people.count", 6, 3.0),
            ("people.count", 5, 2.0),
        ]

    def test_the_base_of_a_case_is_the_case(self, study_file):
        text = "[sweep]\none_at_a_time = true\ndetector.phantoms.rate = [0.0, 1.0]\n"
        study = load_study(study_file(text + "[cases.a]\ndetector.profile = 'perfect'\n[cases.b]"))
        assert values(study, "detector.phantoms.rate") == [0.0, 1.0, study.base.detector.phantoms.rate, 0.0, 1.0]


class TestRanges:
    def of(self, study_file, text: str) -> list:
        return values(load_study(study_file(f"[sweep]\npeople.area = {text}")), "people.area")

    @given(
        first=st.floats(0.01, 100.0), last=st.floats(0.01, 100.0), steps=st.integers(2, 20), log=st.sampled_from([0, 1])
    )
    def test_steps_are_even_and_ends_exact(self, tmp_path_factory, first, last, steps, log):
        if math.isclose(first, last, rel_tol=1e-6):
            return
        scale = ', scale = "log"' if log else ""
        path = tmp_path_factory.mktemp("range") / "x.toml"
        path.write_text(
            f'name = "x"\n[sweep]\npeople.area = {{ from = {first!r}, to = {last!r}, steps = {steps}{scale} }}'
        )
        found = values(load_study(path), "people.area")
        assert (len(found), found[0], found[-1]) == (steps, first, last)
        scaled = [math.log(value) for value in found] if log else found
        steps_between = [after - before for before, after in itertools.pairwise(scaled)]
        assert max(steps_between) - min(steps_between) < 1e-8 * max(1.0, *map(abs, scaled))

    def test_decimals_are_those_that_people_write(self, study_file):
        assert self.of(study_file, "{ from = 0.1, to = 1.1, steps = 11 }")[:4] == [0.1, 0.2, 0.3, 0.4]

    @pytest.mark.parametrize(
        ("text", "found"),
        [
            ("{ from = 2, to = 8, steps = 4 }", [2, 4, 6, 8]),
            ("{ from = 8, to = 2, steps = 3 }", [8, 5, 2]),
            ('{ from = 1, to = 64, steps = 4, scale = "log" }', [1, 4, 16, 64]),
        ],
    )
    def test_whole_numbers_stay_whole(self, study_file, text, found):
        study = load_study(study_file(f"[sweep]\ncameras.count = {text}"))
        assert values(study, "cameras.count") == found
        assert all(type(value) is int for value in values(study, "cameras.count"))

    @pytest.mark.parametrize(
        ("text", "part"),
        [
            ("{ start = 0, stop = 2, num = 5 }", "start, stop, num is not a key of a range; write a list, [2, 3"),
            ("{ from = 0, to = 2 }", "a range needs from, to and steps"),
            ("{ from = 0, to = 2, steps = 2.5 }", "expected 2 to 10000 steps, got 2.5"),
            ("{ from = 0, to = 2, steps = 1 }", "expected 2 to 10000 steps, got 1"),
            ("{ from = 0, to = 2, steps = 1000000000 }", "expected 2 to 10000 steps, got 1000000000"),
            ("{ from = 0, to = inf, steps = 3 }", "expected a number for to"),
            ("{ from = true, to = 2, steps = 3 }", "expected a number for from, got true"),
            ('{ from = 0, to = 2, steps = 3, scale = "log" }', "needs from and to above 0, got 0 and 2"),
            ('{ from = 1, to = 2, steps = 3, scale = "cubic" }', 'expected scale = "linear" or "log", got "cubic"'),
            ("{ from = 2, to = 2, steps = 3 }", "is a single value; write a list, [2]"),
            ("2.0", "expected values to sweep over, got 2.0; write a list"),
            ("[]", "expected at least one value, got an empty list"),
            ("[1.0, 2.0, 1.0]", "1.0 is in the list twice"),
            ("[{ a = 1 }]", "expected numbers, words"),
        ],
    )
    def test_what_is_no_range_says_how_to_write_one(self, study_file, text, part):
        path = study_file(f"[sweep]\npeople.area = {text}")
        message = refusal(path)
        assert message.startswith(f"{path}, [sweep]: people.area: ")
        assert part in message


class TestSeedsAndVariants:
    def test_a_count_goes_on_from_the_scenarios_seed(self, study_file):
        path = study_file("seed = 7\nseeds = 3")
        assert load_study(path).seeds == (7, 8, 9)
        assert load_study(path, seeds=2).seeds == (7, 8)
        assert load_study(path, overrides=["seed=1", "seeds=2"]).seeds == (1, 2)

    def test_a_list_is_taken_as_it_is(self, study_file):
        study = load_study(study_file("seed = 7\nseeds = [3, 1, 0]"))
        assert study.seeds == (3, 1, 0)
        assert study.base.seed == study.settings[0].scenario.seed == 3
        assert load_study(study.path, seeds=[8]).seeds == (8,)

    def test_a_trial_differs_from_its_setting_in_the_seed(self, study_file):
        study = load_study(study_file("seeds = 3\n[sweep]\npeople.count = [1, 2]"))
        assert study.trials == 6
        setting = study.settings[1]
        for seed in study.seeds:
            assert study.at(setting, seed).seed == seed
            assert study.at(setting, seed).model_copy(update={"seed": 0}) == setting.scenario

    def test_variants_are_those_of_every_setting(self, study_file):
        path = study_file('variants = ["full", "fast"]\n[sweep]\npeople.count = [1, 2]')
        assert load_study(path).variants == ("full", "fast")
        study = load_study(path, variants=["no-3dps"])
        assert [s.scenario.method.variants for s in study.settings] == [("no-3dps",)] * 2

    @pytest.mark.parametrize("seeds", ["0", "-1", "true", "2.5", "[]", "[1, -1]", '["a"]', '"all"'])
    def test_what_are_no_seeds_is_refused(self, study_file, seeds):
        path = study_file(f"seeds = {seeds}")
        assert refusal(path).startswith(
            f"{path}: seeds: expected a number of seeds, 1 to 1,000,000, or a list of seeds"
        )

    def test_seeds_without_effect_are_refused(self, study_file):
        assert "seeds: a seed is in the list twice" in refusal(study_file("seeds = [1, 1]"))
        message = refusal(study_file("seeds = [1, 2]"), overrides=["seed=3"])
        assert message.startswith("--set seed=3: the study has a list of seeds, seeds = [1, 2]")

    def test_unknown_variants_are_refused(self, study_file):
        path = study_file('variants = ["ful"]')
        assert refusal(path).startswith(
            f"{path}: variants: unknown variant 'ful'; did you mean full? expected one of full, "
        )
        assert refusal(path, variants=["best"]).startswith("--variant: variants: unknown variant 'best'")
        assert "a variant is listed twice" in refusal(path, variants=["full", "full"])
        assert "needs descriptors" in refusal(path, variants=["appearance"])
        drawn = load_study(path, variants=["appearance"], overrides=["appearance.source=drawn"])
        assert drawn.variants == ("appearance",)

    def test_user_defined_estimators_are_variants_and_not_presets(self, study_file):
        path = study_file('variants = ["full", "custom"]\n[method.estimators]\ncustom = "custom.py:Custom"')
        assert load_study(path).variants == ("full", "custom")
        assert "unknown variant 'custm'; did you mean custom? expected one of full, " in refusal(
            path, variants=["custm"]
        )
        clash = "method.estimators.full=custom.py:Custom"
        assert refusal(path, overrides=[clash]).startswith(
            f"--set {clash}: method.estimators.full: this is the name of a preset"
        )

    def test_a_study_with_a_user_defined_estimator_is_written_as_it_was_run(self, study_file, tmp_path):
        path = study_file(
            'variants = ["custom"]\n[method.estimators]\ncustom = "custom.py:Custom"\n[sweep]\nrate = [2, 3]'
        )
        study = load_study(path)
        written = tmp_path / "elsewhere" / "study.toml"
        written.parent.mkdir()
        written.write_text(document(study))
        assert load_study(written, folder=Path()).settings == study.settings


class TestMistakes:
    @pytest.mark.parametrize(
        ("text", "part"),
        [
            ("cameras.cuont = [2]", "cameras.cuont is not a key; did you mean cameras.count? [cameras] has"),
            ("camera.count = [2]", "camera is not a key; did you mean cameras?"),
            ("detector.profil = ['poor']", "detector.profil is not a key; did you mean detector.profile?"),
            ("people.count = [1, -1]", "people.count (number of people): expected greater than or equal to 0, got -1"),
            (
                "people.count = { from = 1, to = 2, steps = 3 }",
                "people.count (number of people): expected a valid integer, got 1.5",
            ),
            ("people.activities = ['walk', 'run']", 'expected a list, e.g. ["walk"], got "walk"'),
            ("people = [1, 2]", "people: expected a section [people] with keys"),
            ("detector.profile = ['poor', 'tipical']", 'detector.profile = "tipical": no such profile'),
            ("seed = [1, 2]", "seed cannot be swept: write seeds = 20"),
            ("seeds = [1, 2]", "seeds cannot be swept: write seeds = 20"),
            ("name = ['a']", "name cannot be swept: write [cases.NAME]"),
            ("method.variants = [['full']]", 'method.variants cannot be swept: write variants = ["full", "fast"]'),
            ("method.estimators.custom = ['a.py:A']", "method.estimators cannot be swept: write variants = "),
            ("gate.level = [0.1]", "gate cannot be swept"),
            ("one_at_a_time = 1", "one_at_a_time: expected true, got 1"),
            ("pairwise = 1", "pairwise: expected true, got 1"),
            ("pairwise = true\none_at_a_time = true", "pairwise: does not go with one_at_a_time; remove one of them"),
            ("pairwise = true\nrefine = 2", "pairwise: does not go with refine; remove one of them"),
            (
                "pairwise = true\nrate = { from = 1.0, to = 9.0, steps = 30 }\n"
                "duration = { from = 1.0, to = 9.0, steps = 20 }",
                "pairwise: two keys have 20 x 30 pairs of values, more than 400; sweep over fewer values",
            ),
            ("paired = [1]", "paired: expected tables [[sweep.paired]], got [1]"),
            (
                "[[sweep.paired]]\npeople.count = [1, 2]\npeople.area = [1.0, 2.0, 3.0]",
                "must have the same length, got 2 of people.count, 3 of people.area",
            ),
            ("[[sweep.paired]]\npeople.count = [4, 5, 4]\npeople.area = [2, 1, 2]", "4 and 2 is in the list twice"),
            ("people.count = [1]\n[[sweep.paired]]\npeople.count = [2]", "people.count is swept twice"),
            (
                "detector.keypoints.miss = [0.1]\n[[sweep.paired]]\ndetector.keypoints.miss.hips = [0.1]",
                "detector.keypoints.miss.hips is swept twice, because detector.keypoints.miss is swept",
            ),
        ],
    )
    def test_of_a_sweep(self, study_file, text, part):
        path = study_file(f"[sweep]\n{text}")
        message = refusal(path)
        assert message.startswith(f"{path}, [sweep]: ")
        assert part in message
        assert len(message.splitlines()) == 1

    @pytest.mark.parametrize(
        ("text", "part"),
        [
            ("people.cuont = 2", "people.cuont is not a key; did you mean people.count?"),
            ("people.count = -2", "people.count (number of people): expected greater than or equal to 0, got -2"),
            ("seed = 2", "a case cannot change seed: write seeds = 20"),
            ("method.variants = ['full']", "a case cannot change method.variants"),
            ("method.estimators.custom = 'a.py:A'", "a case cannot change method.estimators"),
            ("room.size = [8.0, 8.0, 3.0]", "room.size is swept as well"),
        ],
    )
    def test_of_a_case(self, study_file, text, part):
        path = study_file(f"[sweep]\nroom.size = [[9.0, 9.0, 3.0]]\n[cases.a]\n{text}")
        message = refusal(path)
        assert message.startswith(f"{path}, [cases.a]: ")
        assert part in message

    def test_of_the_command_line(self, study_file):
        path = study_file("[sweep]\npeople.count = [1]")
        study = load_study(path, overrides=["sweep.people.count=[2, 3]", "sweep.cameras.count={from=2, to=4, steps=3}"])
        assert [tuple(s.factors.values()) for s in study.settings] == list(itertools.product([2, 3], [2, 3, 4]))
        for wrong in ("sweep.people.count=[-1]", "sweep.people.cuont=[1]", "sweep.people.count=3"):
            assert refusal(path, overrides=[wrong]).startswith(f"--set {wrong}: people.c")

    def test_tables_that_are_none(self, study_file):
        assert "sweep: expected a section [sweep]" in refusal(study_file("sweep = 3"))
        assert "cases: expected a section [cases.NAME]" in refusal(study_file("cases = 3"))
        assert "cases.A b: expected a name of lowercase letters" in refusal(study_file('[cases."A b"]'))
        assert "gate.levle is not a key; did you mean gate.level?" in refusal(study_file("[gate]\nlevle = 0.1"))

    def test_all_mistakes_are_named_at_once_and_each_once(self, study_file):
        path = study_file(
            "seeds = 0\nduratoin = 3\n[sweep]\npeople.count = [-1, 1, 2]\ncameras.fov = [60, 90, 400]\n"
            "people.area = []\n[cases.a]\n[cases.b]\nroom.colour = 'red'\n[gate]\nlevel = 2.0"
        )
        message = refusal(path)
        for key in ("seeds", "duratoin", "people.count", "cameras.fov", "people.area", "room.colour", "gate.level"):
            assert key in message, key
        assert message.startswith(f"{path}: 7 mistakes: ")
        assert message.count("\n") == 0
        assert len(message) <= 500

    def test_values_of_many_settings_are_refused_once(self, study_file):
        text = (
            "[sweep]\npeople.count = { from = 0, to = 50, steps = 51 }\ncameras.fov = [60, 400]\n[cases.a]\n[cases.b]"
        )
        path = study_file(text)
        expected = f"{path}, [sweep]: cameras.fov (horizontal field of view, degrees): expected less than 170, got 400"
        assert refusal(path) == expected


class TestLargeStudies:
    TEXT = "seeds = 100\n[sweep]\npeople.count = { from = 1, to = 100, steps = 100 }\npeople.area = [%s]"

    def test_a_million_trials_are_counted_and_not_made(self, study_file, monkeypatch):
        monkeypatch.setattr(Sweep, "settings", None)  # not callable
        path = study_file(self.TEXT % ", ".join(f"{k}.0" for k in range(1, 101)))
        with pytest.raises(StudyTooLarge, match=r"makes 1,000,000 trials \(10,000 x 100, settings x seeds\).*--yes"):
            load_study(path)
        assert read_plan(path).trials == 1_000_000

    def test_seeds_are_counted_too(self, study_file):
        with pytest.raises(StudyTooLarge, match=r"makes 1,000,000 trials \(1 x 1,000,000, settings x seeds\)"):
            load_study(study_file("seeds = 1000000"))

    def test_the_limit_is_an_argument(self, study_file):
        path = study_file("seeds = 4\n[sweep]\npeople.count = [1, 2, 3]")
        assert load_study(path, limit=12).trials == 12
        assert load_study(path, limit=None).trials == 12
        with pytest.raises(StudyTooLarge):
            load_study(path, limit=11)

    @pytest.mark.parametrize(
        ("sweep", "most"),
        [
            ("refine = 5\npeople.count = [1, 2]\ncameras.fov = [60, 70.0]", 4 * 7 * 7),
            ("refine = 5\none_at_a_time = true\npeople.count = [1, 2]\ncameras.fov = [60, 70.0]", 4 * (1 + 4 + 10)),
            ('refine = 5\npeople.count = [1, 2]\ndetector.profile = ["typical", "perfect"]', 4 * 7 * 2),
            ("refine = 5\n[[sweep.paired]]\npeople.count = [1, 2]\ncameras.count = [2, 3]", 4 * 2),
        ],
    )
    def test_values_that_a_run_may_add_count(self, study_file, sweep, most):
        """They are numbers between those of a single key."""
        path = study_file(f"seeds = 4\n[sweep]\n{sweep}")
        assert load_study(path, limit=most).plan.most_trials == most
        with pytest.raises(StudyTooLarge, match=rf"makes .* more than {most - 1}: .* --yes") as caught:
            load_study(path, limit=most - 1)
        assert (f"up to {most} with the values that sweep.refine = 5 may add" in str(caught.value)) == (
            "paired" not in sweep
        )

    def test_settings_share_the_sections_that_are_equal(self, study_file):
        study = load_study(study_file("[sweep]\npeople.count = [1, 2]\ncameras.count = [3, 4]"))
        first, second, *_ = (setting.scenario for setting in study.settings)
        assert first.detector is second.detector
        assert first.people is second.people
        assert first.cameras != second.cameras


class TestLoad:
    @pytest.mark.parametrize(
        "text", ["[sweep]\npeople.count = [1]", "[cases.a]\n[cases.b]", "seeds = 2", "seeds = [1, 2]"]
    )
    def test_a_study_is_not_one_scenario(self, study_file, text):
        path = study_file(text)
        with pytest.raises(ScenarioError) as caught:
            load(path)
        assert str(caught.value).startswith(f"{path}: is a study, not a single scenario: ")
        assert f"simharness study {path}" in str(caught.value)

    @pytest.mark.parametrize(("text", "seed"), [("seeds = 1", 4), ("seeds = [9]", 9), ("[gate]\nlevel = 0.1", 4)])
    def test_one_trial_is_a_scenario(self, study_file, text, seed):
        assert load(study_file(f"seed = 4\n{text}")).seed == seed
