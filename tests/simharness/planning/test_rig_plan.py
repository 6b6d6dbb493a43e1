"""Plan of a rig: its value against the method, its files, its command line."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.report.rig_plots import shared_area, write_labels
from simharness.cli import app
from simharness.outputs.planning import plan_plots
from simharness.outputs.planning.plan_page import render_preview
from simharness.outputs.planning.plan_plots import room_from_side
from simharness.planning.candidates import candidates_in
from simharness.planning.plan_rig import PlanEffort, plan_rig
from simharness.planning.planned_room import Room
from simharness.planning.rig_comparison import corner_rig, layer_of, rig_of, ring_rig
from simharness.planning.rig_file import CALIBRATION, write_rig
from simharness.planning.rig_value import RigValue, SightingOdds
from simharness.planning.room_file import make_room, read_room
from simharness.planning.room_keys import RoomKeys
from simharness.planning.search import Ledger
from simharness.scenario.load import load
from simharness.world.rigs.layouts import build_rig, look_at


def small_room(**keys: Any) -> Room:
    values: dict[str, Any] = {
        "name": "small",
        "room": {"size": (6.0, 5.0, 3.0)},
        "volume": {"size": (2.5, 2.5)},
        "lenses": [{"name": "one", "size": (800, 600), "fov": 60.0}],
        "people": {"count": 2},
    }
    return make_room(RoomKeys.model_validate({**values, **keys}))


@pytest.fixture(scope="module")
def valued() -> RigValue:
    room = small_room()
    layer = layer_of(room, places=9, repeats=4)
    cameras = [each.camera(room, name=f"c{k}") for k, each in enumerate(candidates_in(room, most=40)[::5])]
    return RigValue(room, layer, SightingOdds.measure(layer, cameras))


def test_one_camera_places_nothing_and_more_cameras_never_lose(valued: RigValue) -> None:
    terms = [valued.terms(each) for each in corner_rig(valued.room, 5)]
    pcp = [float(valued.maps(terms[:count]).pcp.mean()) for count in range(1, 6)]
    assert pcp[0] == 0.0
    assert all(after >= before - 0.5 for before, after in itertools.pairwise(pcp))
    assert pcp[-1] > 80.0


def test_two_cameras_at_one_place_place_nothing(valued: RigValue) -> None:
    one = valued.terms(corner_rig(valued.room, 2)[0])
    assert valued.maps([one, one]).pcp.max() == 0.0


def test_cameras_that_look_away_see_nobody(valued: RigValue) -> None:
    each = corner_rig(valued.room, 1)[0]
    away = type(each)(each.mount, each.lens, each.place, each.bearing + np.pi, each.tilt)
    assert valued.maps([valued.terms(away)]).seen.max() == 0.0


def test_lengths_of_parts_are_those_of_the_score_for_uneven_shoulders_and_hips() -> None:
    """The torso goes from midway between the hips to midway between the shoulders, and no side counts more."""
    from simharness.planning.rig_value import _lengths

    body = np.random.default_rng(3).uniform(-1, 1, (2, 15, 3))  # nose, ears, shoulders, elbows, wrists, hips, ...
    sides = [0, 2, 1, *np.arange(3, 15).reshape(-1, 2)[:, ::-1].ravel()]
    lengths, exchanged = _lengths(body), _lengths(body[:, sides])
    middle = body[:, [[3, 4], [9, 10]]].mean(axis=2)
    np.testing.assert_allclose(lengths[:, 8], np.linalg.norm(middle[:, 0] - middle[:, 1], axis=1))
    np.testing.assert_allclose(lengths[:, 0], np.linalg.norm(body[:, 3] - body[:, 5], axis=1))  # left upper arm
    np.testing.assert_allclose(lengths, exchanged[:, [1, 0, 3, 2, 5, 4, 7, 6, 8, 9]])


def test_error_is_that_of_the_information_of_both_rays(valued: RigValue) -> None:
    pair = [valued.terms(each) for each in ring_rig(valued.room, 4)[:2]]
    both = (pair[0][..., 4] > 0.5) & (pair[1][..., 4] > 0.5)
    m, j = np.argwhere(both)[0]
    total = np.zeros((3, 3))
    for each in pair:
        way, weight, right = each[m, j, :3].astype(float), float(each[m, j, 3]), float(each[m, j, 4])
        total += right * weight * (np.eye(3) - np.outer(way, way))
    from simharness.planning.rig_value import _error

    inverse = np.linalg.inv(total)
    found = _error(np.array([*np.diag(total), total[0, 1], total[0, 2], total[1, 2]]))
    assert found == pytest.approx(np.sqrt(np.trace(inverse)), rel=1e-6)


def test_a_camera_beside_another_is_worth_less_than_one_elsewhere() -> None:
    """Where all sets reach the target everywhere, they differ in the error and in cameras to spare alone."""
    room = small_room(target={"pcp": 1.0, "error": 100.0})
    layer = layer_of(room, places=9, repeats=4)
    corners = corner_rig(room, 4)
    odds = SightingOdds.measure(layer, [each.camera(room, name=f"c{k}") for k, each in enumerate(corners)])
    value = RigValue(room, layer, odds)
    *three, last = [value.terms(each) for each in corners]
    for k in range(3):
        near = corners[k]
        x, y, z = near.place
        twin = type(near)(near.mount, near.lens, (x * 0.95, y * 0.95, z), near.bearing, near.tilt)
        assert value.value([*three, value.terms(twin)]) < value.value([*three, last]) - 0.05


def test_values_with_each_camera_are_those_of_the_sets(valued: RigValue) -> None:
    terms = [valued.terms(each) for each in corner_rig(valued.room, 4)]
    together = valued.values_with(terms[:2], terms[2:])
    assert together == pytest.approx([valued.value([*terms[:2], each]) for each in terms[2:]])


def test_failing_cameras_count_after_the_worst_failure(valued: RigValue) -> None:
    room = small_room(objective={"kind": "mean", "failing": 1})
    failing = RigValue(room, valued.layer, valued.odds)
    whole = RigValue(small_room(objective={"kind": "mean"}), valued.layer, valued.odds)
    terms = [failing.terms(each) for each in corner_rig(room, 4)]
    worst = min(whole.value(terms[:k] + terms[k + 1 :]) for k in range(4))
    assert failing.value(terms) == pytest.approx(worst + 0.05 * whole.value(terms))


def test_value_agrees_with_the_method_on_the_order_of_rigs(valued: RigValue) -> None:
    room, layer, rng = valued.room, valued.layer, np.random.default_rng(0)
    candidates = candidates_in(room, most=200)
    figures = []
    for size in (2, 2, 3, 3, 4, 5):
        chosen = [candidates[k] for k in rng.choice(len(candidates), size, replace=False)]
        predicted = layer.predict([layer.terms(each) for each in rig_of(room, chosen)], variant="fast")
        figures.append(
            (valued.maps([valued.terms(each) for each in chosen]).pcp.mean(), predicted.summary()["pcp"].mean)
        )
    ranks = np.argsort(np.argsort(np.array(figures), axis=0), axis=0)
    assert np.corrcoef(ranks.T)[0, 1] > 0.7


@pytest.mark.parametrize("lenses", [[{"fov": 60.0}], [{"name": "a", "fov": 60.0}, {"name": "b", "fov": 90.0}]])
def test_rig_file_is_read_back_by_scenarios(lenses: list[dict[str, Any]], tmp_path: Path) -> None:
    room = small_room(lenses=lenses)
    chosen = corner_rig(room, 2) + corner_rig(room, 3, lens=len(lenses) - 1)[2:]
    rig = rig_of(room, chosen)
    write_rig(rig, room, tmp_path / "planned.toml", comments=["A comment."])
    assert (tmp_path / CALIBRATION).exists() == (len(lenses) > 1)
    (tmp_path / "film.toml").write_text('extends = "quickstart"\n[cameras]\nrig = "planned.toml"\n', encoding="utf-8")
    read = build_rig(load(tmp_path / "film.toml").cameras)
    same_cameras(read, rig)


def same_cameras(read: Rig, rig: Rig) -> None:
    assert [each.size for each in read] == [each.size for each in rig]
    for one, other in zip(read, rig, strict=True):
        assert pytest.approx(other.K) == one.K
        assert one.center == pytest.approx(other.center, abs=1e-3)
        assert pytest.approx(other.R, abs=1e-3) == one.R


@pytest.mark.parametrize("make", [corner_rig, ring_rig])
def test_usual_rigs_hang_where_cameras_may(make: Any) -> None:
    lab = read_room("lab")
    rig = make(lab, 6)
    assert len({each.place for each in rig}) == 6
    assert all(lab.may_hang(lab.mounts[each.mount], np.array(each.place)) for each in rig)


@pytest.mark.slow
def test_nobody_visible() -> None:
    low = [{"center": (0.0, 0.0), "size": (3.4, 3.4, 0.2), "base": 2.2}]
    walls = [
        {"center": (x, y), "size": size}
        for x, y, size in (
            (-1.65, 0.0, (0.1, 3.4, 2.2)), (1.65, 0.0, (0.1, 3.4, 2.2)),
            (0.0, -1.65, (3.4, 0.1, 2.2)), (0.0, 1.65, (3.4, 0.1, 2.2)),
        )
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no camera at any place sees anybody"):
        plan_rig(small_room(obstacles=low + walls), 2, effort=PlanEffort(candidates=12, starts=1, scenes=0, curve=()))


def test_command_line_reports_mistakes(tmp_path: Path) -> None:
    runner = CliRunner()
    for arguments, message in (
        (["plan", "nowhere"], "nowhere: no such room; expected a TOML file, or the name of a shipped room: lab"),
        (["plan", "lab", "--cameras", "1"], "--cameras = 1: one camera gives no positions in space"),
        (["plan", "lab", "--lens", "tele"], "--lens tele: no such lens; expected one of standard, wide"),
        (["plan", "lab", "--people", "99"], "--people: people.count"),
    ):
        result = runner.invoke(app, [*arguments, "--out", str(tmp_path)])
        assert result.exit_code == 2, result.output
        assert message in " ".join(result.stderr.split())


@pytest.mark.slow
def test_the_key_of_a_drawing_names_only_what_is_drawn() -> None:
    empty, lab = render_preview(small_room()), render_preview(read_room("lab"))
    for word in ("Blue", "Green", "Grey", "Yellow", "Orange", "Violet"):
        assert (f"{word}:" in lab) == (word in ("Grey", "Yellow", "Green")) or word == "Blue"
        assert (f"{word}:" in empty) == (word == "Green") or word == "Blue"
    hangs = small_room(fixed=[{"position": (2.5, 2.0, 2.5), "aim": (0.0, 0.0, 1.0)}])
    assert "Violet:" in render_preview(hangs)


@pytest.mark.parametrize("axis", [0, 1])
def test_labels_of_cameras_in_one_corner_do_not_touch_from_the_side(axis: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cameras at one height behind each other, as rigs on walls have them: the names would lie on each other."""
    boxes = []

    def kept(*given: Any, **more: Any) -> list[tuple[np.ndarray, np.ndarray]]:
        boxes.extend(write_labels(*given, **more))
        return boxes

    monkeypatch.setattr(plan_plots, "write_labels", kept)
    lab = read_room("lab")
    centers = [(7.8, 4.7), (6.4, 6.3), (1.4, 6.3), (0.2, 4.8), (0.15, 0.15), (7.0, 0.15), (7.6, 4.6), (7.7, 0.2)]
    cameras = [look_at((x, y, 2.8), (4, 3, 1), K=lab.lenses[0].K, size=(1280, 960), name=f"cam{k}")
               for k, (x, y) in enumerate(centers)]  # fmt: skip
    room_from_side("side", lab, axis=axis, cameras=cameras)
    assert len(boxes) == len(cameras)
    for one, other in itertools.combinations(boxes, 2):
        assert shared_area(one, other) == 0.0


@pytest.mark.slow
def test_preview_draws_the_room(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["plan", "lab", "--preview", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    page = (tmp_path / "lab" / "preview.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 3  # from above, and two sides
    assert "pillar" in page


@pytest.mark.slow
def test_plan_from_the_command_line_is_written_and_resumed(tmp_path: Path) -> None:
    room = tmp_path / "cell.toml"
    room.write_text(
        "[room]\nsize = [5.0, 4.5, 2.6]\n[volume]\nsize = [2.2, 2.2]\n[places.walls]\nheights = [2.2, 2.4]\n"
        "[[lenses]]\nsize = [640, 480]\nfov = 70.0\n[people]\ncount = 2\n",
        encoding="utf-8",
    )
    arguments = ["plan", str(room), "--cameras", "3", "--scenes", "1", "--out", str(tmp_path / "out")]
    runner = CliRunner()
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    folder = tmp_path / "out" / "cell"
    first = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    assert len(first["cameras"]) == 3
    assert (
        first["predicted"]["pcp"]["value"]
        >= max(
            each["predicted"]["pcp"]["value"] for each in first["alternatives"] if each["title"] in ("corners", "ring")
        )
        - 1.0
    )
    page = (folder / "plan.html").read_text(encoding="utf-8")
    assert "plan of 3 cameras" in page
    assert not re.search(r"-0(\.0+)?(?![.\d])", re.sub(r"<[^>]*>|<style.*?</style>", " ", page, flags=re.DOTALL))
    (folder / "plan.json").unlink()
    assert runner.invoke(app, arguments).exit_code == 0
    assert json.loads((folder / "plan.json").read_text(encoding="utf-8")) == first
    assert Ledger(folder / "search.json", "other").result("x", lambda: 3) == 3
