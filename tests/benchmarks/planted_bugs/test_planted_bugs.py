import ast
import dataclasses

import numpy as np
import pytest

from benchmarks.planted_bugs import report
from benchmarks.planted_bugs.catalogue import Bug, read_catalogue, unplantable
from benchmarks.planted_bugs.checkout import ROOT, Checkout
from benchmarks.planted_bugs.effects import effect
from benchmarks.planted_bugs.near_tests import run_tests
from benchmarks.planted_bugs.records import Outcome, Records
from benchmarks.planted_bugs.simulations import AFTER_DETECTION, first_stage
from benchmarks.planted_bugs.work import NEUTRAL

BUG = Bug("sign", "sums.py", (("a + b", "a - b"),), "sums are differences", ("tests",), "real")


class TestCatalogue:
    @pytest.mark.slow
    def test_every_bug_applies_to_the_code(self):
        """Where this fails the code has changed: write the edit of the named bug for the present code."""
        assert unplantable(read_catalogue(), ROOT) == []
        assert unplantable({"neutral": NEUTRAL}, ROOT) == []

    def test_it_has_forty_bugs_with_a_real_effect(self):
        assert sum(bug.effect == "real" for bug in read_catalogue().values()) >= 40

    def test_every_effect_that_is_not_real_has_a_reason(self):
        with pytest.raises(ValueError, match="expected a reason"):
            dataclasses.replace(BUG, effect="equivalent")

    def test_two_bugs_of_one_name_are_refused(self, tmp_path):
        entry = '[[bug]]\nid="x"\nfile="f"\nedits=[["a","b"]]\nbreaks="c"\ntests=["t"]\neffect="real"\n'
        (tmp_path / "c.toml").write_text(entry + entry)
        with pytest.raises(ValueError, match="two bugs are called 'x'"):
            read_catalogue(tmp_path / "c.toml")


class TestPlanting:
    def test_the_text_is_replaced(self):
        assert BUG.planted("def f(a, b):\n    return a + b\n") == "def f(a, b):\n    return a - b\n"

    @pytest.mark.parametrize("text", ["x = 1\n", "x = a + b\ny = a + b\n"])
    def test_a_text_that_is_not_there_once_no_longer_applies(self, text):
        with pytest.raises(ValueError, match=f"no longer applies: sums.py has its text {text.count('a + b')} times"):
            BUG.planted(text)

    def test_a_bug_that_changes_nothing_is_refused(self):
        with pytest.raises(ValueError, match="changes nothing"):
            dataclasses.replace(BUG, edits=(("a + b", "(a + b)"),)).planted("x = a + b\n")

    def test_a_bug_that_is_no_python_is_refused(self):
        with pytest.raises(ValueError, match="not valid Python"):
            dataclasses.replace(BUG, edits=(("a + b", "a +"),)).planted("x = a + b\n")

    def test_a_copy_with_a_bug_leaves_the_copy_without_it_as_it_is(self, tmp_path):
        root = tmp_path / "checkout"
        (root / "__pycache__").mkdir(parents=True)
        (root / "sums.py").write_text("x = a + b\n")
        kernel = root / "__pycache__" / "clean.nbk"
        kernel.write_text("compiled")
        with Checkout(root).planted(BUG) as planted:
            assert (planted.root / "sums.py").read_text() == "x = a - b\n"
            assert (root / "sums.py").read_text() == "x = a + b\n"
            seen = planted.root / "__pycache__" / "clean.nbk"
            assert seen.read_text() == "compiled"
            seen.unlink()
        assert not planted.root.exists()
        assert kernel.read_text() == "compiled"
        assert sorted(tmp_path.iterdir()) == [root]

    def test_programs_run_on_the_copy(self, tmp_path):
        package = tmp_path / "checkout" / "mvpose"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("")
        done = Checkout(tmp_path / "checkout").run(["-c", "import mvpose; print(mvpose.__file__)"], limit=60.0)
        assert (done.code, done.output.strip()) == (0, str(package / "__init__.py"))


class TestNearTests:
    def copy(self, tmp_path, body):
        (tmp_path / "test_it.py").write_text(
            f"import pytest\n\ndef test_first():\n    pass\n\ndef test_it():\n    {body}\n"
        )
        return Checkout(tmp_path)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("body", "limit", "caught", "what"),
        [
            ("pass", 120.0, False, ""),
            ("assert 1 == 2", 120.0, True, "test_it.py::test_it"),
            ("while True: pass", 4.0, True, "no end"),
        ],
    )
    def test_the_first_failure_is_named(self, tmp_path, body, limit, caught, what):
        outcome = run_tests(self.copy(tmp_path, body), ["test_it.py"], limit=limit)
        assert outcome.caught == caught
        assert outcome.what.startswith(what)
        assert bool(outcome.what) == caught

    @pytest.mark.slow
    def test_no_test_is_no_pass(self, tmp_path):
        (tmp_path / "test_none.py").write_text("")
        with pytest.raises(ValueError, match="no tests were run"):
            run_tests(Checkout(tmp_path), ["test_none.py"], limit=60.0)


class TestRecords:
    def test_finished_results_are_kept_for_the_same_code_only(self, tmp_path):
        path = tmp_path / "records.jsonl"
        Records(path, "one").add("gate", "a", value=Outcome(False, "", 1.0))
        Records(path, "one").add("gate", "a", value=Outcome(True, "PCP", 2.0))
        assert Records(path, "one").outcome("gate", "a") == Outcome(True, "PCP", 2.0)
        assert Records(path, "two").outcome("gate", "a") is None

    def test_an_interrupted_line_is_ignored(self, tmp_path):
        path = tmp_path / "records.jsonl"
        Records(path, "one").add("gate", "a", value=Outcome(False, "", 1.0))
        path.write_text(path.read_text() + '{"code": "one", "ke')
        assert Records(path, "one").outcome("gate", "a") is not None


def imported(file):
    """Modules that a file imports, inside functions as well."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)


class TestFirstStage:
    @pytest.mark.slow
    def test_no_module_that_makes_detections_imports_a_later_stage(self):
        later = {each.removesuffix(".py").replace("/", ".") for each in AFTER_DETECTION}
        for each in AFTER_DETECTION:
            assert (ROOT / each).exists()
        files = [file for folder in ("world", "capture", "detector", "types") for file in
                 (ROOT / "simharness" / folder).rglob("*.py")]  # fmt: skip
        assert len(files) > 100
        used = {
            (str(file), module)
            for file in files
            for module in imported(file)
            if any(module == each or module.startswith(f"{each}.") for each in later)
        }
        assert used == set()

    @pytest.mark.parametrize(
        ("file", "stage"),
        [
            ("mvpose/matching/admm.py", "estimates"),
            ("mvpose/pipeline.py", "estimates"),
            ("simharness/scoring/pcp.py", "estimates"),
            ("simharness/detector/boxes.py", "detections"),
            ("mvpose/lens.py", "scenes"),
            ("mvpose/skeleton.py", "scenes"),
            ("simharness/world/humans/body.py", "scenes"),
        ],
    )
    def test_stages(self, file, stage):
        assert first_stage(file) == stage


class TestEffect:
    def scores(self, shift, seeds=12, case="base"):
        draws = np.random.default_rng(0).normal(size=(2, seeds))
        return {
            (name, seed, "full", "pcp"): float(90 + draws[k, seed] + (shift[seed] if name == case else 0.0))
            for k, name in enumerate(("base", "crowd"))
            for seed in range(seeds)
        }

    def test_equal_scores_are_identical(self):
        assert effect(self.scores(np.zeros(12)), self.scores(np.zeros(12))).identical

    def test_a_shift_of_one_case_at_all_seeds_is_clear(self):
        found = effect(self.scores(np.zeros(12)), self.scores(np.full(12, -1.0)))
        assert found.clear
        assert not found.identical
        # Two-sided over twelve seeds, and two tests: of the suite and of the case.
        assert found.p == pytest.approx(2 * 2 / 2**12)
        assert found.text.startswith("pcp -0.5 (-0.5 to -0.5), full, suite")

    @pytest.mark.slow
    def test_a_shift_at_all_of_many_seeds_is_clear_among_hundreds_of_scores(self):
        cases = [f"case{k}" for k in range(220)]
        before = {(case, seed, "full", "pcp"): 90.0 for case in cases for seed in range(24)}
        assert effect(before, {key: 89.0 - 0.001 * key[1] for key in before}).clear

    def test_changes_of_both_signs_are_not_clear(self):
        found = effect(self.scores(np.zeros(12)), self.scores(np.resize([1.0, -1.0], 12)))
        assert (found.identical, found.clear) == (False, False)

    def test_only_the_seeds_of_both_count(self):
        assert effect(self.scores(np.zeros(12)), self.scores(np.zeros(12), seeds=12)).seeds == 12
        few = {key: value for key, value in self.scores(np.zeros(12)).items() if key[1] < 6}
        assert effect(self.scores(np.zeros(12)), few).identical


class TestReport:
    def test_a_bug_that_neither_noticed_is_named(self):
        bugs = [dataclasses.replace(BUG, id=name) for name in ("a", "b", "c")]
        gate = {"a": Outcome(True, "worse PCP", 1.0), "b": Outcome(False, "", 1.0), "c": Outcome(False, "", 1.0)}
        tests = {"a": Outcome(False, "", 1.0), "b": Outcome(True, "t.py::f", 1.0), "c": Outcome(False, "", 1.0)}
        hunts = {"c": Outcome(True, "ghost", 1.0)}
        rows = report.rows(bugs, gate, tests, {})
        assert report.totals(rows) == "real: 3 bugs, caught by the gate 1, by tests 1, by hunts 0, by none 1: c"
        assert "| a | sums are differences | real | worse PCP | passed | not run |" in report.table(rows)
        rows = report.rows(bugs, gate, tests, {}, hunts)
        assert report.totals(rows) == "real: 3 bugs, caught by the gate 1, by tests 1, by hunts 1, by none 0"
