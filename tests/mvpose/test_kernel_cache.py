"""Cache of compiled kernels: never stale, never damaged, shared by processes, and free of old entries."""

import cProfile
import gc
import hashlib
import importlib
import json
import os
import pickle
import pkgutil
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.extending import is_jitted

import mvpose
import simharness
from mvpose.kernel_code import UnknownDependencyError, code_digest
from mvpose.kernels import njit

ROOT = Path(__file__).parents[2]

# outer -> middle -> inner, each in a file of its own, with constants of every kind from a fourth.
TOY = {
    "__init__.py": "",
    "constants.py": """
import enum
import numpy as np
GAIN = 2.0
WEIGHTS = np.array([1.0, 10.0])
SIZES = (3, 4)
class Kind(enum.IntEnum):
    NEAR = 100
""",
    "inner.py": """
from mvpose.kernels import njit
from toy import constants
from toy.constants import GAIN, SIZES, WEIGHTS, Kind
@njit(cache=True)
def inner(x, offset=0.0):
    return GAIN * x + WEIGHTS[1] + (SIZES[0] + Kind.NEAR) + constants.GAIN + offset
@njit(cache=True)
def neighbour(x):
    return x + 7.0
""",
    "middle.py": """
from mvpose.kernels import njit
from toy.inner import inner
@njit(cache=True)
def middle(x):
    return inner(x) + 1000.0
""",
    "outer.py": """
from mvpose.kernels import njit
from toy import middle
@njit(cache=True, error_model="numpy")
def outer(x):
    return middle.middle(x) + 1.0 / (x - 1.0)
""",
}
VALUE = 2.0 * 5.0 + 10.0 + 3 + 100 + 2.0 + 1000.0 + 0.25  # of outer(5.0)


class Toy:
    """Package in a folder; every start imports it anew, as a new process does."""

    def __init__(self, folder):
        self.folder = folder / "toy"
        self.folder.mkdir()
        for name, text in TOY.items():
            (self.folder / name).write_text(text, encoding="utf-8")

    def start(self):
        for name in [each for each in sys.modules if each.partition(".")[0] == "toy"]:
            del sys.modules[name]
        importlib.invalidate_caches()
        return importlib.import_module("toy.outer")

    def edit(self, file, old, new):
        path = self.folder / file
        text = path.read_text(encoding="utf-8")
        assert text.count(old) == 1
        status = path.stat()
        path.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # neither its time nor, mostly, its size tells

    @property
    def entries(self):
        return sorted((self.folder / "__pycache__").glob("*.nbk"))


@pytest.fixture
def toy(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr("numba.config.CACHE_DIR", "")
    monkeypatch.syspath_prepend(tmp_path)
    yield Toy(tmp_path)
    for name in [each for each in sys.modules if each.partition(".")[0] == "toy"]:
        del sys.modules[name]


def compiled(kernel):
    """Whether a kernel was compiled in this start; False if it came from the cache."""
    hits, misses = (sum(each.values()) for each in (kernel.stats.cache_hits, kernel.stats.cache_misses))
    assert hits + misses == 1
    return misses == 1


def test_the_next_start_compiles_nothing(toy):
    first = toy.start()
    assert first.outer(5.0) == VALUE
    assert compiled(first.outer)
    assert len(toy.entries) == 1
    second = toy.start()
    assert second.outer is not first.outer
    assert second.outer(5.0) == VALUE
    assert not compiled(second.outer)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "old", "new", "difference"),
    [
        ("inner.py", "GAIN * x", "GAIN / x", 0.4 - 10.0),
        ("inner.py", "GAIN * x", "x", -5.0),
        ("inner.py", "offset=0.0", "offset=0.5", 0.5),
        ("middle.py", "1000.0", "2000.0", 1000.0),
        ("outer.py", "x - 1.0", "x + 3.0", -0.125),
        ("constants.py", "GAIN = 2.0", "GAIN = 3.0", 6.0),
        ("constants.py", "10.0]", "20.0]", 10.0),
        ("constants.py", "(3, 4)", "(6, 4)", 3.0),
        ("constants.py", "NEAR = 100", "NEAR = 200", 100.0),
    ],
)
def test_an_edit_of_anything_the_code_is_made_of_is_seen(toy, file, old, new, difference):
    assert toy.start().outer(5.0) == VALUE
    count = len(toy.entries)
    toy.edit(file, old, new)
    assert toy.start().outer(5.0) == pytest.approx(VALUE + difference, rel=1e-15)
    assert not compiled_again(toy)
    assert len(toy.entries) == count  # those of the old code are gone


def compiled_again(toy):
    module = toy.start()
    module.outer(5.0)
    return compiled(module.outer)


def test_a_profiler_changes_no_entry(toy):
    """In a profiled thread numba writes into the code objects of the kernels that are called."""
    toy.start().outer(5.0)
    entries = toy.entries
    for _ in range(2):
        with cProfile.Profile():
            profiled = toy.start().outer
            profiled(5.0)  # loads it
            profiled(5.0)  # calls it
        assert not compiled(profiled)
        profiled(np.float32(5.0))  # one more entry of the same code
        entries = sorted({*entries, *toy.entries})
        assert toy.entries == entries
    assert len(entries) > 1


def test_options_of_a_callee_are_seen(toy):
    toy.edit("inner.py", "GAIN * x", "GAIN / (x - 5.0)")
    toy.edit("inner.py", "@njit(cache=True)\ndef inner", '@njit(cache=True, error_model="python")\ndef inner')
    with pytest.raises(ZeroDivisionError):
        toy.start().outer(5.0)
    toy.edit("inner.py", '"python"', '"numpy"')
    assert toy.start().outer(5.0) == np.inf


@pytest.mark.parametrize("caller_first", [False, True])
def test_a_kernel_does_not_inherit_the_options_of_who_compiles_it(toy, caller_first):
    toy.edit("inner.py", "GAIN * x", "GAIN / (x - 5.0)")
    toy.edit("outer.py", 'error_model="numpy"', 'error_model="python", fastmath=True')
    module = toy.start()
    inner = importlib.import_module("toy.inner").inner
    for kernel in (module.outer, inner) if caller_first else (inner, module.outer):
        assert kernel(5.0) == np.inf
    (code,) = inner.inspect_llvm().values()
    assert " fast " not in code


def test_fields_of_a_named_tuple_that_change_places_are_seen(toy):
    pairs = toy.folder / "pairs.py"
    for fields, difference in (("first: float\n    second: float", -3.0), ("second: float\n    first: float", 3.0)):
        pairs.write_text(
            f"from typing import NamedTuple\nfrom mvpose.kernels import njit\nclass Pair(NamedTuple):\n    {fields}\n"
            "@njit(cache=True)\ndef difference(pair, pairs):\n    return pairs[0].first - pair.second\n",
            encoding="utf-8",
        )
        toy.start()
        module = importlib.import_module("toy.pairs")
        pair = module.Pair(2.0, 5.0)
        assert module.difference(pair, (pair, pair)) == difference
        assert compiled(module.difference)
        toy.start()
        again = importlib.import_module("toy.pairs")
        pair = again.Pair(2.0, 5.0)
        assert again.difference(pair, (pair, pair)) == difference
        assert not compiled(again.difference)


def test_what_a_kernel_calls_is_part_of_it(toy):
    module = toy.start()
    assert module.outer(5.0) == VALUE
    assert [each.name.partition(".")[0] for each in toy.entries] == ["outer"]
    middle = module.middle.middle
    assert middle(5.0) == VALUE - 0.25
    assert middle(np.float32(5.0)) == VALUE - 0.25
    assert [each.name.partition(".")[0] for each in toy.entries] == ["middle", "middle", "outer"]
    assert module.outer(5.0) == VALUE
    later = toy.start()
    for kernel, value in ((later.middle.middle, VALUE - 0.25), (later.outer, VALUE)):
        assert kernel(5.0) == value
        assert not compiled(kernel)


def test_a_callee_is_compiled_once_for_all_values_of_an_argument():
    @njit
    def total(x, k):
        return x + k

    @njit
    def product(x, k):
        return total(x, 1) * total(x, 2) * total(x, k) * total(k=3, x=x)

    assert product(3.0, 0) == 4.0 * 5.0 * 3.0 * 6.0
    assert [tuple(map(str, each)) for each in total.signatures] == [("float64", "int64")]


def test_a_kernel_that_borrows_arrays_counts_no_references():
    @njit
    def count(values):
        return len(np.zeros(len(values)))

    @njit(borrows=True)
    def shift(values):
        later = values[count(values) - 2 :]  # the first to compile the other kernel, which does make an array
        for k in range(len(later)):
            later[k] += 1.0
        return later[0]

    array = np.zeros(3)
    references = sys.getrefcount(array)
    assert [shift(array) for _ in range(3)] == [1.0, 2.0, 3.0]
    assert array.tolist() == [0.0, 3.0, 3.0]
    assert sys.getrefcount(array) == references
    (code,) = shift.inspect_llvm().values()
    assert "call void @NRT_incref" not in code


def test_a_kernel_that_borrows_arrays_cannot_make_one():
    @njit(borrows=True)
    def doubled(values):
        return (2.0 * values).sum()

    with pytest.raises((numba.core.errors.NumbaError, TypeError), match="NRT"):
        doubled(np.ones(3))


def test_only_callers_of_edited_code_are_compiled(toy):
    first = toy.start()
    first.middle.middle(5.0)
    first.outer(5.0)
    toy.edit("inner.py", "x + 7.0", "x + 8.0")
    toy.edit("inner.py", "@njit(cache=True)\ndef inner", "# moves the lines\n\n@njit(cache=True)\ndef inner")
    assert not compiled_again(toy)
    toy.edit("outer.py", "1.0 / (x", "2.0 / (x")
    module = toy.start()
    assert module.outer(5.0) == VALUE + 0.25
    assert compiled(module.outer)
    assert not compiled(module.middle.middle)


def test_a_renamed_module_is_compiled_again_without_a_warning(toy):
    toy.start().outer(5.0)
    (toy.folder / "inner.py").rename(toy.folder / "innermost.py")
    toy.edit("middle.py", "toy.inner", "toy.innermost")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert toy.start().outer(5.0) == VALUE
        assert not compiled_again(toy)


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "of another kernel"])
def test_a_damaged_entry_is_compiled_again(toy, damage):
    toy.start().outer(5.0)
    importlib.import_module("toy.inner").inner(5.0)
    (entry,) = (each for each in toy.entries if each.name.startswith("outer."))
    (other,) = (each for each in toy.entries if each.name.startswith("inner."))
    content = entry.read_bytes()
    entry.write_bytes(
        {
            "empty": b"",
            "cut": content[: len(content) // 2],
            "flipped": content[:-1] + bytes([content[-1] ^ 1]),
            "of another kernel": other.read_bytes(),
        }[damage]
    )
    module = toy.start()
    assert module.outer(5.0) == VALUE
    assert compiled(module.outer)
    assert not compiled_again(toy)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no owner here")
@pytest.mark.parametrize("distrusted", ["writable by others", "of another user"])
def test_code_that_others_may_have_written_is_not_loaded(toy, tmp_path, distrusted):
    """The entry has a right checksum and would create a file when it is loaded."""
    toy.start().outer(5.0)
    (entry,) = toy.entries
    proof = tmp_path / "ran"

    class Runs:
        def __reduce__(self):
            return Path.touch, (proof,)

    content = pickle.dumps((Runs(), None))
    entry.write_bytes(hashlib.sha256(content).digest() + content)
    if distrusted == "of another user":
        if os.geteuid():
            pytest.skip("only root gives files away")
        os.chown(entry, 12345, 12345)
    else:
        entry.chmod(0o666)
    with pytest.warns(UserWarning, match="others own entries in .*, or may write to them"):
        assert toy.start().outer(5.0) == VALUE
    assert not proof.exists()
    os.chown(entry, os.geteuid(), -1)
    entry.write_bytes(hashlib.sha256(content).digest() + content)
    entry.chmod(0o644)
    toy.start().outer(5.0)
    assert proof.exists()  # that is what the check keeps out


def test_code_that_arrives_as_an_argument_is_not_kept(toy):
    toy.edit("middle.py", "def middle(x):\n    return inner(x) + 1000.0", "def middle(f, x):\n    return f(x) + 1000.0")
    module = toy.start()
    inner = importlib.import_module("toy.inner")
    assert module.middle.middle(inner.inner, 5.0) == VALUE - 0.25
    assert module.middle.middle(inner.neighbour, 5.0) == 1012.0
    assert not [each for each in toy.entries if each.name.startswith("middle.")]


def test_an_unknown_dependency_is_compiled_each_time(toy):
    toy.edit("inner.py", "from toy import constants", "from toy import constants\nfrom toy.plain import plain")
    toy.edit("inner.py", "+ offset", "+ plain(offset)")
    plain = toy.folder / "plain.py"
    for value in (1.0, 2.0):
        plain.write_text(
            f"from numba.extending import register_jitable\n@register_jitable\ndef plain(x):\n    return x + {value}\n",
            encoding="utf-8",
        )
        with pytest.warns(UserWarning, match="not kept on disk: UnknownDependencyError: .*plain: a builtins.function"):
            assert toy.start().outer(5.0) == VALUE + value
        assert toy.entries == []


def test_a_package_that_cannot_be_written_uses_a_folder_of_the_user(toy, tmp_path, monkeypatch):
    (toy.folder / "__pycache__").write_text("in the way of a folder: even root cannot write there")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setenv("HOME", str(tmp_path / "user"))
    assert toy.start().outer(5.0) == VALUE
    assert len(list((tmp_path / "user").rglob("*.nbk"))) == 1
    assert not compiled_again(toy)


def test_without_any_folder_kernels_are_compiled(toy, monkeypatch):
    (toy.folder / "__pycache__").write_text("in the way")
    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, os.devnull)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        assert toy.start().outer(5.0) == VALUE
    (warning,) = {str(each.message) for each in caught}
    assert (
        warning
        == "compiled kernels are not kept on disk: no folder can be written; set NUMBA_CACHE_DIR to one that can"
    )


def test_recompile_deletes_the_entries(toy):
    module = toy.start()
    module.outer(5.0)
    module.outer.recompile()
    assert module.outer(5.0) == VALUE
    assert not compiled_again(toy)


def processes(count, code, folder, **environment):
    """Run code in some processes at once and return what each prints, as JSON."""
    path = os.pathsep.join([str(folder), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **environment}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", code], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for _ in range(count)
    ]
    answers = []
    for process in started:
        out, errors = process.communicate(timeout=300)
        assert process.returncode == 0, errors.decode()
        assert not errors
        answers.append(json.loads(out))
    return answers


@pytest.mark.slow
def test_processes_may_start_at_once(tmp_path):
    """In numba's own cache, two signatures may get one file, and a caller then runs the code of the other."""
    Toy(tmp_path)
    code = """
import json, random
from toy import outer, middle, inner
calls = [(kind, value) for kind in ("f", "i", "b") for value in (2, 3, 5)]
random.shuffle(calls)
results = {}
for kind, value in calls:
    argument = {"f": float, "i": int, "b": lambda x: x > 4}[kind](value)
    results[f"{kind}{value}"] = outer.outer(argument) if kind != "b" else middle.middle(argument)
by_value = {types: count for types, count in middle.middle.stats.cache_misses.items() if "bool" in str(types)}
misses = sum([*outer.outer.stats.cache_misses.values(), *by_value.values()])
print(json.dumps([dict(sorted(results.items())), misses]))
"""
    first = processes(4, code, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    results = [each for each, _ in first]
    assert results == [results[0]] * 4
    assert results[0]["f5"] == results[0]["i5"] == VALUE
    assert results[0]["b2"] == VALUE - 0.25 - 10.0
    assert processes(1, code, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache")) == [[results[0], 0]]
    files = [each for each in (tmp_path / "cache").rglob("*") if each.is_file()]
    assert {each.suffix for each in files} == {".nbk"}
    assert sum(misses for _, misses in first) == len(files)  # each process waits for what another one compiles


def every_kernel():
    for package in (mvpose, simharness):
        for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not each.name.endswith("__main__"):
                for name, value in vars(importlib.import_module(each.name)).items():
                    if is_jitted(value) and value.py_func.__module__ == each.name:
                        yield f"{each.name}.{name}", value


def test_all_kernels_can_be_kept():
    kernels = dict(every_kernel())
    assert {name.partition(".")[0] for name in kernels} == {"mvpose", "simharness"}
    for name, kernel in kernels.items():
        assert type(kernel._cache).__name__ == "KernelCache", name
        try:
            code_digest(kernel)
        except UnknownDependencyError as error:
            pytest.fail(f"{name}: {error}")
    assert len({code_digest(kernel) for kernel in kernels.values()}) == len(kernels)


def copy(folder):
    """Copy the package, with the kernels that are compiled where they are in it."""
    shutil.copytree(ROOT / "mvpose", folder / "mvpose", ignore=shutil.ignore_patterns("build", "*.egg-info"))


def replace(file, old, new):
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1
    file.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.slow
def test_a_lens_with_another_sign_changes_the_camera(tmp_path):
    copy(tmp_path)
    code = """
import json, numpy as np
from mvpose import Camera
K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
camera = Camera(K, np.eye(3), np.zeros(3), [-0.1, 0, 0, 0, 0], (640, 480))
print(json.dumps(camera.project([[0.5, 0.0, 1.0]]).tolist()))
"""
    assert processes(1, code, tmp_path, NUMBA_CACHE_DIR="") == [[[320 + 250 * 0.975, 240.0]]]
    lens = tmp_path / "mvpose" / "lens.py"
    text = lens.read_text(encoding="utf-8")
    lens.write_text(text.replace("r2 * (k1 + r2", "r2 * (-k1 + r2"), encoding="utf-8")
    assert processes(1, code, tmp_path, NUMBA_CACHE_DIR="") == [[[320 + 250 * 1.025, 240.0]]]


@pytest.mark.slow
def test_zeroed_evidence_changes_estimates(tmp_path):
    copy(tmp_path)
    code = """
import json, numpy as np
from mvpose import Camera, Detections, Rig, preset
K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
rig = Rig([Camera(K, np.eye(3), [x, 0, 4], size=(640, 480)) for x in (-1, 0, 1)])
rng = np.random.default_rng(0)
joints = np.column_stack([np.linspace(-0.3, 0.3, 17), np.linspace(-0.8, 0.8, 17), rng.normal(0.0, 0.2, 17)])
seen = Detections.from_keypoints([0, 1, 2], rig.project(joints) + rng.normal(0.0, 3.0, (3, 17, 2)), np.ones((3, 17)))
print(json.dumps(preset("fast").estimate(rig, seen).joints.tolist()))
"""
    (before,) = processes(1, code, tmp_path, NUMBA_CACHE_DIR="")
    assert processes(1, code, tmp_path, NUMBA_CACHE_DIR="") == [before]
    replace(
        tmp_path / "mvpose" / "reconstruction" / "likelihood.py",
        "responsibility = best / (best + floor)",
        "responsibility = 0.0 * best / (best + floor)",
    )
    (after,) = processes(1, code, tmp_path, NUMBA_CACHE_DIR="")
    assert len(before) == 1
    assert np.shape(after) != np.shape(before) or not np.allclose(after, before, atol=1e-3)


class _CollectorDuring(numba.core.event.Listener):
    """Whether the collector of cyclic garbage ran at the start of each compilation."""

    def __init__(self):
        self.enabled = []

    def on_start(self, event):
        self.enabled.append(gc.isenabled())

    def on_end(self, event):
        pass


def test_the_collector_of_garbage_rests_during_compilation_alone(toy):
    during = _CollectorDuring()
    with numba.core.event.install_listener("numba:compile", during):
        assert toy.start().outer(5.0) == VALUE
    assert during.enabled
    assert not any(during.enabled)
    assert gc.isenabled()


def test_the_collector_of_garbage_runs_again_after_an_error():
    kernel = njit(lambda x: x + "text")
    with pytest.raises(numba.TypingError):
        kernel(1.0)
    assert gc.isenabled()
