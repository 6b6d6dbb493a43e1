"""Overview picture of the README: it shows the data of the run and of the digest, at the right positions."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mvpose import Detections
from mvpose.report.palette import css, person_color
from simharness.outputs.run.result_folder import run
from simharness.outputs.study.skeleton_view_3d import Replay
from simharness.scenario.load import load
from simharness.scenario.shipped import shipped_folder
from simharness.trial.run_folder import read_run
from simharness.trial.stages.build_trial import build_trial
from tools.readme_picture import picture as module
from tools.readme_picture.breaking_chart import VARIANTS, breaking_chart
from tools.readme_picture.picture import Tile, joined, main, overview
from tools.readme_picture.room_view import RoomView

RESULTS = shipped_folder().parent / "results"
DIGEST = json.loads((RESULTS / "crowd" / "digest.json").read_text(encoding="utf-8"))
SMALL = ["duration=0.4", "rate=5.0", "people.count=3", "cameras.size=[160,160]", 'method.variants=["full"]']
FRAME, VIEWS = 1, (4, 3, 2)
SVG = "{http://www.w3.org/2000/svg}"
NUMBER = re.compile(r"-?\d+\.?\d*")
MIN_LETTERS = 22  # pixels in a picture 1660 wide: 11 at the 830 of a README


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Small run of the scene of the picture."""
    out = tmp_path_factory.mktemp("runs")
    return run(load(shipped_folder() / "overview.toml", overrides=SMALL), out=out)


@pytest.fixture(scope="module")
def record(folder):
    return read_run(folder)


@pytest.fixture(scope="module")
def drawn(record):
    return ET.fromstring(overview(record, DIGEST, frame=FRAME, views=VIEWS))


@pytest.fixture(scope="module")
def room(record):
    replay = Replay(
        build_trial(record.scenario), "full", record.time, record.truth, record.detections, record.estimates["full"]
    )
    return RoomView(replay, FRAME, (800, 300))


def panel(svg, name):
    (group,) = (each for each in svg.iter(f"{SVG}g") if each.get("id") == name)
    return group


def classed(element, tag, *names):
    return [each for each in element.iter(SVG + tag) if set(names) <= set((each.get("class") or "").split())]


def points(path):
    return np.array([float(number) for number in NUMBER.findall(path.get("d"))]).reshape(-1, 2)


def tiles(record):
    return module._tiles(record, VIEWS)


def test_five_panels_stand_in_the_order_of_the_story_each_with_its_package(drawn):
    names = [each.get("id") for each in drawn.iter(f"{SVG}g") if each.get("id")]
    assert names == ["simulate", "detect", "match", "reconstruct", "score"]
    for number, name in enumerate(names, 1):
        heading = "".join(panel(drawn, name).find(f"{SVG}text").itertext())
        assert heading.startswith(f"{number}{name}")
    bars = [(float(each.get("y")), float(each.get("x")), each.text) for each in classed(drawn, "text", "bar")]
    assert [package for *_, package in sorted(bars)] == ["simharness", "mvpose", "mvpose", "simharness"]


def test_captions_are_short_and_letters_large_enough_for_a_readme(drawn):
    captions = module._panels([Tile(0, (4, 4), 0, 0)] * 5)
    assert len(captions) == 5
    assert all(1 <= len(each["caption"].split()) <= 6 for each in captions.values())
    sizes = [float(size) for size in re.findall(r'font-size[=:]\s*"?([\d.]+)', ET.tostring(drawn, encoding="unicode"))]
    assert sizes
    assert min(sizes) >= MIN_LETTERS
    assert float(drawn.get("width")) == 1660


class TestTile:
    """A tile shows the middle square of a picture."""

    def test_the_edges_of_a_square_picture_are_those_of_the_tile(self):
        tile = Tile(0, (720, 720), 40, 100)
        np.testing.assert_allclose(
            tile.place([[-0.5, -0.5], [719.5, 719.5]]), [[40, 100], [40 + module._SIDE, 100 + module._SIDE]]
        )

    def test_of_a_wide_picture_the_sides_are_cut_alike(self):
        tile = Tile(0, (800, 600), 0, 0)
        np.testing.assert_allclose(tile.place([[99.5, -0.5], [699.5, 599.5]]), [[0, 0], [module._SIDE, module._SIDE]])


class TestDetect:
    """The second panel."""

    def test_every_detection_of_the_view_stands_about_its_box_and_phantoms_are_red(self, drawn, record):
        tile = tiles(record)[1]
        detections, truth = record.detections[FRAME], record.truth[FRAME]
        indices = np.flatnonzero(detections.view == VIEWS[0])
        expected = {
            tuple(np.round(tile.place(box[:2]), 1)): person
            for box, person in zip(detections.boxes[indices], truth.person[indices], strict=True)
        }
        assert {-1} < set(expected.values())  # a phantom, and people
        found = {}
        for kind, person in (("detection", 0), ("phantom", -1)):
            for group in classed(panel(drawn, "detect"), "g", kind):
                _, box, *_ = group.iter(f"{SVG}path")
                found[tuple(points(box)[0])] = person
                assert (box.get("stroke") == module._WRONG) == (person < 0)
        assert {corner: min(0, person) for corner, person in expected.items()} == found

    def test_people_who_are_visible_but_not_detected_are_marked(self, record):
        """All detections of the view are removed, and their truth with them."""
        detections, truth = record.detections[FRAME], record.truth[FRAME]
        kept = detections.view != VIEWS[0]
        fields = ("view", "keypoints", "scores", "boxes", "box_scores")
        fewer = Detections(*(getattr(detections, key)[kept] for key in fields), detections.skeleton)
        blind = dataclasses.replace(truth, person=truth.person[kept], error=truth.error[kept])
        replay = Replay(None, "full", record.time[:1], (blind,), (fewer,), ())
        tile = tiles(record)[1]
        visible = np.flatnonzero((truth.visibility[VIEWS[0]] == 0).sum(axis=-1) >= module._MIN_VISIBLE)
        assert len(visible)
        marked = list(module._missed(replay, 0, tile))
        corners = [tuple(float(number) for number in NUMBER.findall(each["box"])[:2]) for each in marked]
        assert corners == [tuple(np.round(tile.place(truth.boxes[VIEWS[0], k, :2]), 1)) for k in visible]
        whole = Replay(None, "full", record.time[:1], (truth,), (detections,), ())
        assert len(list(module._missed(whole, 0, tile))) < len(marked)


class TestMatch:
    """The third panel."""

    def test_lines_join_the_middles_of_boxes_that_the_estimate_labels_alike(self, drawn, record):
        detections, labels = record.detections[FRAME], record.estimates["full"][FRAME].matching.labels
        place = {tile.view: tile.place for tile in tiles(record)[2:]}
        middles = {
            k: place[int(detections.view[k])](detections.boxes[k, :2] + detections.boxes[k, 2:] / 2)
            for k in range(len(detections))
            if detections.view[k] in VIEWS
        }
        joins = []
        for path in classed(panel(drawn, "match"), "path", "join"):
            corners = points(path)
            ends = []
            for corner in (corners[0], corners[-1]):
                (k,) = (k for k, middle in middles.items() if np.abs(middle - corner).max() <= 0.051)
                ends.append(k)
            joins.append(tuple(ends))
            assert labels[ends[0]] == labels[ends[1]] >= 0
        expected = Counter(int(labels[k]) for k in middles if labels[k] >= 0)
        assert max(expected.values()) == len(VIEWS)
        assert Counter(int(labels[one]) for one, _ in joins) == Counter(
            {label: count - 1 for label, count in expected.items() if count > 1}
        )
        assert len(set(joins)) == len(joins)

    def test_one_estimate_has_one_colour_in_all_views_and_in_the_room(self, drawn, record, room):
        owners = room.replay.owners(FRAME)
        colors = {css(person_color(int(owner))) for owner in owners}
        assert len(colors) >= 3
        joins = {path.get("stroke") for path in classed(panel(drawn, "match"), "path", "join")}
        estimates = [path.get("stroke") for path in classed(panel(drawn, "reconstruct"), "path", "estimate")]
        assert len(estimates) == len(owners)
        assert joins <= set(estimates) == colors

    def test_views_without_the_person_are_skipped_and_unmatched_detections_are_not_joined(self):
        view = np.array([0, 0, 1, 2, 2, 2, 3])
        labels = np.array([0, -1, 1, 0, 1, -1, 0])
        assert joined(labels, view, [0, 1, 2]) == [(0, 3), (2, 4)]
        assert joined(labels, view, [2, 1, 0]) == [(3, 0), (4, 2)]
        assert joined(labels, view, [3, 0, 1]) == [(6, 0)]


class TestReconstruct:
    """The fourth panel."""

    def test_people_and_cameras_are_where_a_pinhole_outside_of_the_room_sees_them(self, drawn, record, room):
        group = panel(drawn, "reconstruct")
        (image,) = group.iter(f"{SVG}image")
        corner = np.array([float(image.get("x")), float(image.get("y"))]) + 0.5
        true = [points(path) for path in classed(group, "path", "truth")]
        assert len(true) == len(record.truth[FRAME].joints)
        for drawn_limbs, joints in zip(true, record.truth[FRAME].joints, strict=True):
            left_hip = room.eye.project(joints[11]) + corner
            assert np.abs(drawn_limbs - left_hip).max(axis=1).min() <= 0.051
        apexes = [points(path)[0] for path in classed(group, "path", "camera")]
        np.testing.assert_allclose(apexes, room.eye.project(record.rig.centers) + corner, atol=0.051)
        places = np.concatenate([*apexes, *true], axis=None).reshape(-1, 2) - corner
        assert (places > 0).all()
        assert (places < room.size).all()

    def test_the_walls_in_the_way_are_left_out_and_no_others(self, room):
        eye = room.eye.center
        walls = [solid for solid in room.replay.trial.scene.solids if solid.name.startswith("wall")]
        hidden = [solid.name for solid in walls if room._hides_room(solid.mesh.vertices)]
        middles = {solid.name: solid.mesh.vertices[:, :2].mean(axis=0) for solid in walls}
        nearest = sorted(middles, key=lambda name: np.linalg.norm(middles[name] - eye[:2]))[:2]
        assert len(walls) == 4
        assert sorted(hidden) == sorted(nearest)

    def test_beyond_the_floor_the_paper_is_white(self, room):
        rgb = room.picture(finer=1).rgb
        assert rgb.shape == (300, 800, 3)
        x, y = np.round(room.eye.project([0.0, 0.0, 0.0])).astype(int)
        assert rgb[y, x].min() < 230
        assert (rgb[-1, [0, -1]] == 255).all()


class TestScore:
    """The fifth panel."""

    def axes(self, drawn):
        """Return the scales of both axes, from value to position, fitted to the ticks."""
        score = panel(drawn, "score")
        across = [(float(tick.text), float(tick.get("x"))) for tick in classed(score, "text", "along")]
        down = [(float(tick.text), float(tick.get("y"))) for tick in classed(score, "text", "down")]
        assert len(across) == len(DIGEST["factors"][0]["values"])
        x = np.polynomial.Polynomial.fit(*np.transpose(across), 1)
        lines = [each for each in score.iter(f"{SVG}line") if not each.get("stroke-dasharray")]
        y = np.polynomial.Polynomial.fit([value for value, _ in down], [float(line.get("y1")) for line in lines], 1)
        return x, y

    def test_points_and_intervals_are_those_of_the_digest_at_their_places(self, drawn):
        (factor,) = DIGEST["factors"]
        x, y = self.axes(drawn)
        for variant in VARIANTS:
            (curve,) = classed(panel(drawn, "score"), "g", "curve", variant)
            mean, low, high = np.array(factor["scores"][variant]["pcp"]).T
            dots = [[float(each.get("cx")), float(each.get("cy"))] for each in curve.iter(f"{SVG}circle")]
            plain = np.array(dots)[: len(mean)]
            np.testing.assert_allclose(plain, np.transpose([x(np.array(factor["values"])), y(mean)]), atol=0.11)
            band, line = list(curve.iter(f"{SVG}path"))[:2]
            np.testing.assert_allclose(points(line), plain)
            np.testing.assert_allclose(points(band)[:, 1], y(np.concatenate([low, high[::-1]])), atol=0.11)

    def test_rings_stand_where_the_mean_passes_the_threshold(self, drawn):
        x, y = self.axes(drawn)
        for variant in VARIANTS:
            (point,) = (
                each
                for each in DIGEST["breaking"]
                if each["variant"] == variant and (each["factor"], each["score"]) == ("people.count", "pcp")
            )
            (curve,) = classed(panel(drawn, "score"), "g", "curve", variant)
            (ring,) = classed(curve, "circle", "breaks")
            place = [float(ring.get("cx")), float(ring.get("cy"))]
            np.testing.assert_allclose(place, [x(point["value"]), y(point["threshold"])], atol=0.11)
            label = "".join(curve.find(f"{SVG}text").itertext())
            assert label == f"{variant} breaks above {point['value']:.1f}"

    def test_a_study_of_one_seed_has_no_intervals_and_one_that_holds_does_not_break(self):
        digest = json.loads(json.dumps(DIGEST))
        for variant in VARIANTS:
            line = digest["factors"][0]["scores"][variant]["pcp"]
            line[:] = [None, *([mean, None, None] for mean, *_ in line[1:])]
        for each in digest["breaking"]:
            each.update(value=None, why="never")
        chart = breaking_chart(digest, at=(0, 0, 100, 100))
        assert chart["curves"]
        for curve in chart["curves"]:
            assert len(curve["points"]) == len(digest["factors"][0]["values"]) - 1
            assert curve["breaks"] is None
            assert curve["label"] == "does not break"

    def test_the_axis_reaches_down_to_the_worst_score(self):
        digest = json.loads(json.dumps(DIGEST))
        digest["factors"][0]["scores"]["full"]["pcp"][0] = [14.0, 12.0, 16.0]
        chart = breaking_chart(digest, at=(0, 0, 100, 200))
        (full,) = (curve for curve in chart["curves"] if curve["variant"] == "full")
        assert chart["down"][0] == {"value": 10, "at": 200.0}
        np.testing.assert_allclose(full["points"][0], (0, 200 * 86 / 90), atol=0.051)


class TestFile:
    """The command, and the picture that it made for the README."""

    def test_the_command_writes_what_is_drawn(self, folder, record, tmp_path):
        out = tmp_path / "overview.svg"
        digest = RESULTS / "crowd" / "digest.json"
        assert main([str(folder), str(digest), str(out), "--frame", str(FRAME), "--views", "4,3,2"]) == 0
        assert out.read_text(encoding="utf-8") == overview(record, DIGEST, frame=FRAME, views=VIEWS)

    @pytest.mark.parametrize(
        ("options", "digest", "message"),
        [
            (["--frame", "2"], "crowd", "--frame 2: the run has frames 0 to 1"),
            (["--views", "0,1"], "crowd", "--views 0,1: expected three different views of 0 to 4"),
            (["--views", "0,1,1"], "crowd", "--views 0,1,1: expected three different"),
            (["--views", "0,1,5"], "crowd", "--views 0,1,5: expected three different"),
            ([], "views", "no pcp of full, no-3dps, no-matching against people.count"),
            ([], "none", "No such file"),
        ],
    )
    def test_bad_input_gets_a_message(self, folder, tmp_path, capsys, options, digest, message):
        out = tmp_path / "overview.svg"
        frame = [] if "--frame" in options else ["--frame", "0"]
        assert main([str(folder), str(RESULTS / digest / "digest.json"), str(out), *frame, *options]) == 2
        assert message in capsys.readouterr().err
        assert not list(tmp_path.iterdir())

    def test_a_digest_that_is_none_is_named(self, folder, tmp_path, capsys):
        for text in ("# views", "[1]"):
            (tmp_path / "table.md").write_text(text)
            assert main([str(folder), str(tmp_path / "table.md"), str(tmp_path / "overview.svg")]) == 2
            assert "table.md: not" in capsys.readouterr().err

    def test_the_picture_of_the_readme_is_small_stands_alone_and_has_the_curves_of_the_digest_beside_it(self):
        file = Path(RESULTS / "overview.svg")
        assert file.stat().st_size < 700_000
        svg = ET.fromstring(file.read_bytes())
        sources = [each.get("href") for each in svg.iter() if each.get("href")]
        assert sum(source.startswith("data:image/jpeg;base64,") for source in sources) == len(VIEWS) + 1
        ids = {f"#{each.get('id')}" for each in svg.iter() if each.get("id")}
        assert all(source.startswith("data:") or source in ids for source in sources)
        assert not list(svg.iter(f"{SVG}script"))
        for name in ("simulate", "detect", "match", "reconstruct", "score"):
            assert len(panel(svg, name))
        chart = breaking_chart(DIGEST, at=module._CHART)
        for curve in chart["curves"]:
            (group,) = classed(panel(svg, "score"), "g", "curve", curve["variant"])
            assert curve["line"] in {path.get("d") for path in group.iter(f"{SVG}path")}
