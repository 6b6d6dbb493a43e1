"""Scenes, arithmetic and command line of the benchmark; nothing is timed here."""

import json
import math
import os
import shlex
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from benchmarks.method import curve, published, reid, stages
from benchmarks.method.__main__ import main
from benchmarks.method.hard import pairs, ratio
from benchmarks.method.measure import exponent, interleaved, report
from benchmarks.method.published import OTHERS, SIZES, others_at
from benchmarks.method.report import WIDTH, against, bar, encodable, figure, table
from benchmarks.method.scenes import CLEARANCE, HARD, LIVE, Conditions, Task, film, frames, ring
from mvpose import COCO17

EXACT = Conditions(noise=0.0, joints_missing=0.0, people_missed=0.0)


def same(one, other):
    return np.array_equal(one.keypoints, other.keypoints, equal_nan=True) and np.array_equal(one.scores, other.scores)


@pytest.mark.parametrize("people", [1, 4, 10, 30])
def test_neighbours_stand_0p8_to_1p2_metres_apart(people):
    for scene in frames(2, people, 20):
        hips = scene.joints[:, [COCO17.index("left_hip"), COCO17.index("right_hip")], :2].mean(axis=1)
        distance = np.linalg.norm(hips[:, None] - hips, axis=2) + 1e9 * np.eye(people)
        if people > 1:
            nearest = distance.min(axis=1)
            assert nearest.min() >= 0.8 - 1e-9
            assert nearest.max() <= 1.2 + 1e-9


def test_people_have_the_bones_of_adults_and_stand_on_the_floor():
    joints = np.concatenate([scene.joints for scene in frames(2, 10, 20)])
    ankles, nose = joints[:, [15, 16], 2], joints[:, COCO17.index("nose"), 2]
    assert 0.055 < ankles.min() < ankles.min(axis=1).max() < 0.08
    assert 1.2 < nose.min() < nose.max() < 1.8
    shin = np.linalg.norm(joints[:, 13] - joints[:, 15], axis=1)
    np.testing.assert_allclose(shin, np.linalg.norm(joints[:, 14] - joints[:, 16], axis=1))
    assert 0.38 < shin.min() < shin.max() < 0.47


@pytest.mark.parametrize(("views", "people"), [(2, 1), (5, 4), (31, 10), (31, 30)])
def test_every_camera_is_2_to_2p5_metres_high_and_sees_all_people(views, people):
    rig = ring(views, people)
    assert 2.0 - 1e-9 < rig.centers[:, 2].min() <= rig.centers[:, 2].max() <= 2.5
    for seed in range(20):
        joints = film(rig, people, seed=seed).joints
        assert all(camera.inside(camera.project(joints)).all() for camera in rig)


def test_a_larger_rig_contains_the_smaller_and_no_two_cameras_coincide_or_face_each_other():
    rig = ring(31, 10)
    np.testing.assert_array_equal(ring(5, 10).centers, rig.centers[:5])
    bearing = np.unwrap(np.sort(np.arctan2(rig.centers[:, 1], rig.centers[:, 0])))
    gaps = np.diff(bearing, append=bearing[0] + 2 * np.pi)
    assert gaps.min() > 0.3 * 2 * np.pi / 31
    few = np.arctan2(rig.centers[:5, 1], rig.centers[:5, 0])
    apart = np.abs((few[:, None] - few + np.pi) % (2 * np.pi) - np.pi)
    assert apart.max() < np.radians(175)


@pytest.mark.parametrize("conditions", [LIVE, HARD])
def test_keypoints_have_the_requested_noise_and_misses(conditions):
    offsets, detected = [], []
    for scene in frames(6, 8, 8, conditions=conditions):
        real = scene.person >= 0
        true = scene.rig.project(scene.joints)[scene.detections.view[real], scene.person[real]]
        offsets.append((scene.detections.keypoints[real] - true).reshape(-1, 2))
        detected.append(scene.detections.detected.ravel())
        assert ((scene.detections.scores == 0) | (scene.detections.scores >= 0.5)).all()
    offset, seen = np.concatenate(offsets), np.concatenate(detected)
    offset = offset[np.isfinite(offset).all(axis=1)]
    np.testing.assert_allclose(offset.std(axis=0), conditions.noise, rtol=4 / np.sqrt(2 * len(offset)))
    np.testing.assert_allclose(offset.mean(axis=0), 0.0, atol=4 * conditions.noise / np.sqrt(len(offset)))
    assert binomtest(int((~seen).sum()), seen.size, conditions.joints_missing).pvalue > 1e-4


@pytest.mark.parametrize("conditions", [LIVE, HARD])
def test_people_are_missed_at_the_requested_rate_and_detected_once_per_view(conditions):
    seen = 0
    for scene in frames(10, 10, 20, conditions=conditions):
        count = Counter(zip(scene.detections.view.tolist(), scene.person.tolist(), strict=True))
        real = {key: times for key, times in count.items() if key[1] >= 0}
        assert set(real.values()) == {1}
        seen += len(real)
    assert binomtest(2000 - seen, 2000, conditions.people_missed).pvalue > 1e-4


def test_every_view_has_a_phantom_away_from_all_people():
    exact = Conditions(noise=0.0, joints_missing=0.0, people_missed=0.5, phantoms=1)
    for scene in frames(5, 6, 10, conditions=exact):
        nobody = scene.person == -1
        assert sorted(scene.detections.view[nobody]) == list(range(5))
        for view, seen in zip(scene.detections.view[nobody], scene.detections.keypoints[nobody], strict=True):
            np.testing.assert_allclose(seen, scene.rig[view].project(scene.phantoms[view, 0]))
        middle, real = (joints[..., 11:13, :2].mean(axis=-2) for joints in (scene.phantoms[:, 0], scene.joints))
        assert np.linalg.norm(middle[:, None] - real, axis=2).min() >= CLEARANCE


def test_phantoms_and_noise_change_no_other_draw():
    clean, noisy = film(ring(4, 3), 3, conditions=EXACT), film(ring(4, 3), 3)
    np.testing.assert_array_equal(clean.joints, noisy.joints)
    haunted = film(ring(4, 3), 3, conditions=Conditions(0.0, 0.0, 0.0, phantoms=2))
    np.testing.assert_array_equal(clean.joints, haunted.joints)
    assert (haunted.person == -1).sum() == 8


def test_a_seed_gives_the_same_scene_and_another_seed_another():
    one, again, other = (film(ring(5, 4), 4, seed=seed, conditions=HARD) for seed in (3, 3, 4))
    assert same(one.detections, again.detections)
    np.testing.assert_array_equal(one.person, again.person)
    assert not same(one.detections, other.detections)
    assert same(frames(5, 4, 2, conditions=HARD, seed=2)[1].detections, one.detections)


def test_detections_come_by_view_and_in_no_order_of_people():
    scene = film(ring(3, 10), 10, conditions=EXACT)
    assert (np.diff(scene.detections.view) >= 0).all()
    assert not (np.diff(scene.person[scene.detections.view == 0]) > 0).all()


@given(st.floats(-1, 3), st.floats(0.01, 100), st.integers(3, 8))
def test_the_exponent_of_a_power_law_is_recovered(power, scale, count):
    sizes = 1.5 ** np.arange(1, count + 1)
    assert exponent(sizes, scale * sizes**power) == pytest.approx(power, abs=1e-9)


def test_the_exponent_is_that_of_the_larger_half():
    sizes = np.array([1, 2, 4, 8, 16, 32, 64])
    cost = np.where(sizes < 8, 500.0, sizes**2.0)  # overhead, then a square law
    assert exponent(sizes, cost) == pytest.approx(2.0)
    assert exponent(sizes[::-1], cost[::-1]) == pytest.approx(2.0)


@pytest.mark.parametrize(("sizes", "costs"), [([1, 2, 3], [0, 1, 2]), ([5, 5], [1, 2]), ([4], [1]), ([], [])])
def test_an_exponent_that_does_not_exist_is_refused(sizes, costs):
    with pytest.raises(ValueError, match=r"exponent"):
        exponent(sizes, costs)


def test_pairs_of_a_hand_made_case():
    person = [0, 0, 0, 1, 1, -1, -1]
    labels = [0, 0, 1, 1, -1, 1, -1]
    # taken for one: 01, 23, 25, 35; truly one: 01, 02, 12, 34
    assert pairs(labels, person) == (1, 4, 4)
    assert pairs(person, person) == (4, 4, 4)
    assert pairs([-1] * 7, person) == (0, 0, 4)
    assert (ratio(1, 4), ratio(0, 0)) == (0.25, 1.0)


def test_tasks_are_interleaved_and_results_noted_in_order():
    calls = []

    def task(name):
        return Task(
            lambda case: calls.append((name, case)) or f"{name}{case}", lambda case, result: {"n": int(result[1:])}
        )

    samples = interleaved({"a": task("a"), "b": task("b")}, [1, 2], calls=4)
    once = [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    assert calls == 3 * once  # the first round is not timed
    for sample in samples.values():
        assert len(sample.wall) == 4
        assert sample.notes["n"].tolist() == [1, 2, 1, 2]
    hurried = interleaved({"a": task("a")}, [1, 2], calls=1000, seconds=0.0)
    assert len(hurried["a"].wall) == 3


def test_cells():
    assert [figure(x) for x in (0, 0.05213, 0.6, 9.996, 70.23, 5555.4)] == [
        "0", "0.0521", "0.600", "10.00", "70.2", "5555",
    ]  # fmt: skip
    assert against(0.5, 0.5) == ("✓", "0.5")
    assert against(0.51, 0.5) == ("✗", "0.5")
    assert against(0.5, None) == ("", "")
    assert table([["a", "b"], ["long", "1"]], "<>") == "a     b\n───────\nlong  1"


@given(st.floats(1, 1000), st.integers(1, 20))
def test_a_bar_is_full_at_the_top_and_grows_evenly_in_log(value, width):
    assert bar(1000, 1, 1000, width=width) == "█" * width
    assert bar(1, 1, 1000, width=width) == ""
    assert len(bar(value, 1, 1000, width=width)) == pytest.approx(width * np.log(value) / np.log(1000), abs=1)


def test_a_terminal_without_symbols_gets_ascii():
    text = "✓ ✗ ── █▍ 5×4"
    assert encodable(text, "utf-8") == text
    encodable(text, "ascii").encode("ascii")
    assert encodable(text, "ascii") == "+ ! -- ## 5x4"


@pytest.mark.slow
def test_peak_memory_is_that_of_the_process_only():
    """It excludes the memory of the parent process, which getrusage includes."""
    ballast = np.ones(40_000_000)  # 320 MB
    code = "from benchmarks.method.measure import peak_memory; print(peak_memory())"
    assert 10 < report(code) < 300 < ballast.nbytes / 1e6


def test_a_failing_process_raises_its_error_output():
    with pytest.raises(RuntimeError, match="no such luck"):
        report("raise SystemExit('no such luck')")


def numbers(value):
    """Every number in nested JSON."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [value] if isinstance(value, int | float) else []


@pytest.mark.slow
def test_the_command_line_prints_a_section_and_writes_its_figures(tmp_path):
    file = tmp_path / "hard.json"
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.method", "--quick", "--only", "hard", "--json", str(file)],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert "HARD" in done.stdout
    assert "STAGES" not in done.stdout
    result = json.loads(file.read_text())
    assert set(result) == {"command", "machine", "versions", "seconds", "quick", "hard"}
    assert set(result["machine"]) == {"cpu", "cores"}
    assert result["versions"]["numpy"] == np.__version__
    assert 0 < result["seconds"] < 600
    assert np.isfinite(numbers(result)).all()
    for row in result["hard"]:
        assert row["share"] <= 1 + 1e-9 or row["method"] == "truth"
        assert 0 <= row["f1"] <= 1
        assert (row["time_ms"] is None) == (row["method"] == "truth")
    assert {row["method"] for row in result["hard"]} == {"admm", "clustering", "hungarian", "truth"}


def likely(views, people, factor):
    """Milliseconds of both presets and their stages at a size, on a machine slower by ``factor``."""
    m = views * people
    totals = {"fast": factor * 0.04 * m**0.95, "full": factor * 0.2 * m**1.15}
    shares = {"total": 1.0, "affinity": 0.2, "matching": 0.5, "reconstruction": 0.3}
    ms = {preset: {cost: share * total for cost, share in shares.items()} for preset, total in totals.items()}
    return curve.Point(views, people, m, ms)


def likely_stages(views, people, factor):
    point = likely(views, people, factor)
    times = {f"{preset} {stage}": ms for preset, costs in point.ms.items() for stage, ms in costs.items()}
    times |= {preset: costs["total"] for preset, costs in point.ms.items()}
    times |= {f"{preset} p99": 3 * costs["total"] for preset, costs in point.ms.items()}
    times |= {"3dps": times["full reconstruction"], "admm": times["full matching"], "eigh": times["full matching"] / 7}
    times["admm in eigh"] = 7.0
    calls = {"fast": 600, "full": 600, "admm": 600}
    targets, released = stages.TARGETS[views, people], others_at((views, people))["released, matching + 3DPS"]
    return stages.Size(views, people, point.detections, calls, 0.99, times, 30, targets, released)


def likely_sweep(grows, sizes, factor):
    exponents = {preset: dict.fromkeys(curve.COSTS, -0.95) for preset in curve.PRESETS}
    return curve.Sweep(grows, [likely(*size, factor) for size in sizes], exponents)


@pytest.mark.parametrize("factor", [1 / 8, 1 / 3, 1, 10, 100])
def test_tables_fit_a_page_on_any_machine(factor):
    texts = [
        stages.table_of([likely_stages(*size, factor) for size in stages.SIZES]),
        published.table_of(
            [published.Comparison(likely(*size, factor), others_at(size), published.PAPER.get(size)) for size in SIZES]
        ),
        reid.table_of([reid.Crops(*size, math.prod(size), factor * math.prod(size), factor) for size in SIZES]),
        curve.table_of([likely_sweep(grows, sizes, factor) for grows, sizes in curve.SWEEPS.items()]),
    ]
    assert [max(map(len, text.splitlines())) <= WIDTH for text in texts] == [True] * 4


@pytest.mark.slow
def test_stages_and_curve_are_complete(tmp_path):
    file = tmp_path / "figures.json"
    assert main(["--quick", "--only", "stages", "curve", "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert np.isfinite(numbers(result)).all()
    (size,) = result["stages"]
    assert size["targets"].keys() <= size["times"].keys()
    spent = [size["times"][f"fast {stage}"] for stage in ("affinity", "matching", "reconstruction")]
    assert min(spent) > 0
    assert {sweep["grows"] for sweep in result["curve"]} == {"views", "people", "detections"}
    for sweep in result["curve"]:
        assert set(sweep["exponents"]) == {"fast", "full"}
        assert all(
            set(costs) == {"total", "affinity", "matching", "reconstruction"} for costs in sweep["exponents"].values()
        )


@pytest.mark.slow
def test_the_result_has_the_command_without_folders(tmp_path, capsys):
    file = tmp_path / "made" / "a name.json"
    options = ["--only", "reid", "published", "--quick", "--json"]
    assert main([*options, str(file)]) == 0
    text = file.read_text()
    assert shlex.split(json.loads(text)["command"]) == ["python", "-m", "benchmarks.method", *options, file.name]
    assert str(tmp_path) not in text


@pytest.mark.slow
def test_published_sizes_have_our_times_and_other_times_in_separate_columns(tmp_path):
    file = tmp_path / "figures.json"
    assert main(["--quick", "--only", "published", "reid", "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert np.isfinite(numbers(result)).all()
    rows = {(row["ours"]["views"], row["ours"]["people"]): row for row in result["published"]}
    assert set(rows) == {(3, 3), (5, 4)}
    for preset in ("fast", "full"):
        ms = rows[5, 4]["ours"]["ms"][preset]
        assert 0 < max(stage for name, stage in ms.items() if name != "total") < ms["total"]
    # Section "Running time" of the paper, and its repository as timed for this project.
    assert rows[5, 4]["paper"] == {"affinity": 25, "matching": 20, "reconstruction": 60}
    assert rows[3, 3]["paper"] is None
    assert rows[3, 3]["others"]["released, matching + 3DPS"] == 8.4
    assert rows[5, 4]["others"]["released, matching + 3DPS"] == 28
    for row in result["reid"]:
        assert 0.8 * row["views"] * row["people"] <= row["crops"] <= row["views"] * row["people"]
        assert row["crop"] * row["crops"] == pytest.approx(row["frame"], rel=0.5)


def test_other_times_are_at_the_size_at_which_they_were_measured():
    assert [others_at(size)["released, matching + 3DPS"] for size in SIZES] == [8.4, 28, 75, 328, 5555]
    assert {len(figures) for figures in OTHERS.values()} == {len(SIZES)}
    for size in SIZES:  # a constraint more costs more, in one language; matching alone costs less than with 3DPS
        times = others_at(size)
        assert times["released, matching"] < times["released, matching + 3DPS"]
        assert times["EasyMocap, matching, constrained"] < times["released, matching, constrained"]


def test_an_unknown_section_lists_the_known_ones(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--only", "speed"])
    assert stop.value.code == 2
    assert "stages" in capsys.readouterr().err
