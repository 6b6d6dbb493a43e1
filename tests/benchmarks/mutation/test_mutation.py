"""Mutants are valid, each differs from the code in one place, and the tests near a module are those that import it."""

import ast

import pytest

from benchmarks.mutation.__main__ import PACKAGES, Mutant, mutants_of, read_equivalent, scores, table
from benchmarks.mutation.near import near_tests
from benchmarks.mutation.operators import changes, mutations, sample
from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import ROOT
from benchmarks.planted_bugs.records import Outcome

SOURCE = '''"""Text of a module stays."""

LIMIT = 0.5  # declared: it stays


def f(a: int = 1, b=None):
    """Text stays."""
    if a < 2 and not b:
        raise ValueError(f"{a + 1} is no good")
    total = 0
    for k in range(a):
        if k == 3:
            continue
        total += min(k, -a) * 2
    b.fill(0.0)
    return total
'''


def mutants(source):
    return {each.applied(source) for each in mutations(source) if changes(source, each)}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("a < 2", "a <= 2"), ("a < 2", "a > 2"), ("2 and not b", "2 or not b"), ("not b", "b"), ("k == 3", "k != 3"),
        ("continue", "pass"), ("total += min", "total -= min"), ("min(", "max("), ("-a", "a"), (") * 2", ") / 2"),
        ("if k == 3", "if True"), ("if k == 3", "if False"), ("b.fill(0.0)", "pass"), ("total = 0", "total = 1"),
        ("total += min(k, -a) * 2", "pass"),
    ],
)  # fmt: skip
def test_each_kind_of_change_is_made(old, new):
    assert SOURCE.replace(old, new) in mutants(SOURCE)


def test_texts_errors_annotations_and_declared_values_stay():
    """What a mutant changes are the statements of the function, but for those that only raise an error."""
    found = [ast.parse(each) for each in mutants(SOURCE)]
    assert len(found) > 15
    original = ast.parse(SOURCE)
    for tree in found:
        assert [ast.dump(each) for each in tree.body[:2]] == [ast.dump(each) for each in original.body[:2]]
        function, before = tree.body[2], original.body[2]
        assert ast.dump(function.args) == ast.dump(before.args)
        assert ast.dump(function.body[0]) == ast.dump(before.body[0])
        assert ast.dump(function.body[1].body[0]) == ast.dump(before.body[1].body[0])


def test_a_smaller_sample_is_the_beginning_of_a_larger_one():
    files = {"a.py": SOURCE, "b.py": SOURCE.replace("3", "4")}
    assert list(sample(files, 5)) == list(sample(files, 12))[:5]
    assert len(set(sample(files, 10_000))) == len(mutants(files["a.py"])) + len(mutants(files["b.py"]))
    assert list(sample(files, 12, seed=1)) != list(sample(files, 12))


@pytest.mark.slow
@pytest.mark.parametrize("package", PACKAGES)
def test_mutants_of_the_packages_apply_and_have_tests(package):
    for each in mutants_of(package, 3, seed=5):
        text = (ROOT / each.file).read_text(encoding="utf-8")
        assert each.bug.planted(text) == each.mutation.applied(text)
        assert each.bug.tests
        assert all((ROOT / test).is_file() for test in each.bug.tests)


def test_the_first_tests_are_those_that_import_the_module():
    found = near_tests("mvpose/tracking/reappearance.py")
    imports = [
        "from mvpose.tracking.reappearance import" in (ROOT / each).read_text(encoding="utf-8") for each in found
    ]
    assert 2 <= sum(imports) < len(found)
    assert imports == sorted(imports, reverse=True)
    assert "tests/mvpose/tracking/test_smoothing.py" in found
    assert not [each for each in found if "simharness" in each]


def test_every_equivalent_mutant_has_a_reason_and_a_file():
    for (file, change), why in read_equivalent().items():
        assert (ROOT / file).is_file()
        assert "→" in change
        assert why


def test_equivalent_mutants_count_neither_as_killed_nor_as_survivors():
    bugs = [Bug(str(k), "mvpose/rays.py", (("a", "b"),), "b", ("t",), "outside", why="mutant") for k in range(4)]
    four = [
        Mutant("p", "mvpose/rays.py", mutations("x = a < b\n")[0], f"line 1, f: `change {k}`", bugs[k])
        for k in range(4)
    ]
    outcomes = {str(k): Outcome(k < 2, "", 1.0) for k in range(4)}
    equivalent = {("mvpose/rays.py", "f: `change 3`"): "no difference"}
    assert scores(four, outcomes, equivalent) == {"p": (2, 3)}
    lines = table(four, outcomes, equivalent).splitlines()
    assert "| `p` | 4 | 1 | 2 | 67 % |" in lines
    assert [line for line in lines if "change" in line and "survivor" not in line] == [
        "| `mvpose/rays.py` | line 1, f: `change 2` |  |",
        "| `mvpose/rays.py` | line 1, f: `change 3` | no difference |",
    ]  # fmt: skip
