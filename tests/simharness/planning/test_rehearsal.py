"""A whole rehearsal of a small rig: consistent figures, plain sentences, JSON, and its page."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from headless_browser import find_browser, run_browser
from typer.testing import CliRunner

import simharness.planning.rehearse_rig
from simharness.cli import app
from simharness.outputs.planning.rehearsal_page import render_rehearsal
from simharness.outputs.planning.rehearsal_plots import outline_of
from simharness.planning.floor_coverage import good_rectangle
from simharness.planning.rehearsal_result import HEIGHTS, sentences
from simharness.planning.rehearsal_scene import RehearsalSetup
from simharness.planning.rehearse_rig import RehearsalEffort, rehearse_rig
from simharness.planning.rig_file import read_rig
from simharness.scenario.presets import read_profile
from simharness.statistics.intervals import Interval
from simharness.trial.identity import provenance
from simharness.types.floor import Volume

pytestmark = pytest.mark.slow

TINY = RehearsalEffort(scenes=2, crowd_scenes=1, crowds=(1,), most=2, around=3)
VOLUME = Volume.box(2.0, 2.0)


@pytest.fixture(scope="module")
def rehearsal():
    setup = RehearsalSetup(VOLUME, read_profile("typical"), people=2)
    return rehearse_rig(read_rig("corners4"), setup, name="corners", effort=TINY)


def test_figures_of_one_rehearsal_agree(rehearsal):
    names = tuple(camera.name for camera in rehearsal.rig)
    assert set(rehearsal.cameras) == set(names)
    assert rehearsal.subsets[names].pcp == rehearsal.whole.pcp
    for name, each in rehearsal.cameras.items():
        rest = rehearsal.subsets[tuple(other for other in names if other != name)]
        assert each.worth.mean == pytest.approx(rehearsal.whole.pcp.mean - rest.pcp.mean)
    assert {crowd.people for crowd in rehearsal.crowds if crowd.pcp is not None} == {1, 2}
    assert rehearsal.extra.gain.mean == pytest.approx(rehearsal.extra.rig.pcp.mean - rehearsal.whole.pcp.mean)


def test_four_cameras_in_the_corners_are_good_in_the_middle(rehearsal):
    assert rehearsal.whole.pcp.mean > 95
    assert rehearsal.good_share > 0.7
    assert abs(rehearsal.whole.layer_pcp - rehearsal.whole.pcp.mean) < 6
    assert "4 cameras may be enough for 2 people" in rehearsal.sentences[0]  # two scenes say little


def test_the_json_is_plain_and_has_the_contract(rehearsal):
    content = json.loads(json.dumps(rehearsal.to_json(), allow_nan=False))
    assert {"pcp", "mpjpe_mm", "map", "cameras", "subsets"} <= content.keys()
    assert content["pcp"]["low"] <= content["pcp"]["mean"] <= content["pcp"]["high"]
    assert len(content["map"]["pcp"]) == len(content["map"]["places"])
    assert content["cameras"]["cam0"]["worth"]["mean"] == round(rehearsal.cameras["cam0"].worth.mean, 4)


def forecast(rehearsal, low, high):
    return replace(rehearsal, whole=replace(rehearsal.whole, pcp=Interval(low / 2 + high / 2, low, high, 2)))


def test_sentences_say_where_a_rig_is_not_enough(rehearsal):
    nowhere = replace(rehearsal, good=np.zeros_like(rehearsal.good))
    assert "4 cameras are not enough" in sentences(forecast(nowhere, 80.0, 90.0))[0]
    assert "4 cameras may not be enough" in sentences(forecast(nowhere, 80.0, 99.0))[0]
    assert "4 cameras may be enough" in sentences(forecast(rehearsal, 80.0, 99.0))[0]
    half = replace(rehearsal, good=rehearsal.prediction.places[:, 0] > 0)
    assert "within 1.0 by 2.0 m; 50 % of the volume" in sentences(half)[0]


def worths(rehearsal, *ends):
    costs = [Interval(low / 2 + high / 2, low, high, 2) for low, high in ends]
    named = zip(rehearsal.cameras.items(), costs, strict=True)
    return replace(rehearsal, cameras={name: replace(each, worth=cost) for (name, each), cost in named})


def test_cameras_are_ranked_only_where_their_intervals_are(rehearsal):
    told = worths(rehearsal, (5.0, 9.0), (1.0, 3.0), (1.0, 4.0), (2.0, 4.0))
    assert sentences(told)[2] == (
        "Camera cam0 matters most: its failure costs 7.0 (5.0 to 9.0) points of PCP; no camera can be spared."
    )
    untold = worths(rehearsal, (0.2, 12.0), (0.0, 5.0), (-1.0, 4.0), (-1.0, 1.5))
    assert sentences(untold)[2] == (
        "Which camera matters most cannot be told: the failure of one costs 0.0 to 12.0 points of PCP; camera cam3 "
        "could be spared: its failure costs less than 2 points of PCP."
    )


def test_cameras_are_spared_one_at_a_time(rehearsal):
    """No set of several cameras was tried, so that nothing is said of the failure of more than one."""
    ends = [(-1.0, 1.5), (-0.5, 1.0), (0.0, 1.9), (-1.0, 0.5)]
    assert sentences(worths(rehearsal, *ends))[2] == (
        "Any camera could be spared alone, not several at once: its failure costs less than 2 points of PCP."
    )
    assert (
        "any of cam0 and cam3 could be spared alone"
        in sentences(worths(rehearsal, ends[0], (1, 3), (1, 4), ends[3]))[2]
    )


def test_the_largest_rectangle_of_good_places():
    places = Volume.box(3.0, 2.0).places(0.5)
    low, high = good_rectangle(places, (places[:, 0] < 0.5) | (places[:, 1] > 0.6))
    assert np.allclose([*low, *high], [-1.5, -1.0, 0.5, 1.0])
    assert good_rectangle(places, np.zeros(len(places), bool)) is None


def test_the_line_around_good_places_has_their_perimeter():
    places = Volume.box(3.0, 2.0).places(0.5)
    chosen = (np.abs(places[:, 0]) < 1.0) & (np.abs(places[:, 1]) < 0.5)
    length = sum(np.linalg.norm(end - start) for start, end in outline_of(places, chosen))
    assert length == pytest.approx(2 * (2.0 + 1.0))


def test_the_page_has_every_sentence_and_marks_every_figure(rehearsal):
    page = render_rehearsal(rehearsal, provenance=provenance(command="", seeds=[0, 1], variants=["full"], seconds=1.0))
    for sentence in rehearsal.sentences:
        assert sentence in page.replace("&#39;", "'")
    assert not re.search(r">[^<>]*(?<![\w.])-0(\.0+)?(?![.\w])[^<>]*<", page)
    titles = re.findall(r'<figure class="panel"><h3>(.*?)</h3>', page)
    assert len(titles) > 10
    unmarked = [title for title in titles if "source" not in title]
    assert unmarked == [f"{height:g} m" for height in HEIGHTS]  # under one title, which is marked
    assert page.count('class="source fast-layer"') >= 6
    assert page.count('class="source simulation"') >= 8


HALL = """
detector = "typical"
[room]
size = [8.0, 8.0, 3.0]
[volume]
size = [4.0, 3.0]
center = [1.0, 0.5]
[[obstacles]]
center = [1.5, 0.0]
size = [0.4, 2.0, 1.8]
[clutter]
boxes = 3
[target]
pcp = 90.0
error = 50.0
"""


def test_the_command_writes_page_and_json(rehearsal, tmp_path, monkeypatch):
    asked = {}

    def remembered(rig, setup, **options):
        asked.update(options, setup=setup)
        return rehearsal

    monkeypatch.setattr(simharness.planning.rehearse_rig, "rehearse_rig", remembered)
    room = tmp_path / "hall.toml"
    room.write_text(HALL, encoding="utf-8")
    options = f"--room {room} --people 6 --subsets --scenes 2"
    result = CliRunner().invoke(app, ["rehearse", "corners4", *options.split(), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    setup = asked["setup"]
    assert asked["subsets"]
    assert setup.people == 6
    assert setup.volume.area == pytest.approx(12.0)
    assert setup.volume.middle == pytest.approx([1.0, 0.5])
    assert setup.space.height == 3.0
    assert len(setup.obstacles) == 1
    assert setup.clutter.boxes == 3
    assert (setup.target.pcp, setup.target.error) == (90.0, 50.0)
    assert json.loads((tmp_path / "rehearsal.json").read_text())["name"] == "corners"
    assert "<h1>corners</h1>" in (tmp_path / "rehearsal.html").read_text()


PROBE = """<script>
addEventListener("load", () => {
  const main = [...document.querySelectorAll("main *")];
  const wide = main.filter((each) => !each.closest("svg") && !each.closest(".scroll")
    && each.getBoundingClientRect().right > innerWidth + 1);
  const canvas = document.querySelector(".view-3d canvas"), first = canvas.toDataURL();
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  const turns = canvas.toDataURL() !== first;
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
  parent.postMessage(JSON.stringify({ wide: wide.map((each) => each.className), turns,
    turnsBack: canvas.toDataURL() === first, width: innerWidth }), "*");
});
</script>"""
FRAME = """<!doctype html><html><script>
addEventListener("message", (event) => { document.documentElement.dataset.probed = event.data; });
</script><iframe src="page.html" style="border: 0; width: WIDTHpx; height: 900px"></iframe></html>"""


@pytest.mark.parametrize(("width", "dark"), [(400, False), (1280, True)])
def test_the_page_fits_the_screen_and_its_rig_turns(rehearsal, tmp_path, width, dark):
    made = provenance(command="simharness rehearse corners4", seeds=[0, 1], variants=["full"], seconds=1.0)
    page = render_rehearsal(rehearsal, provenance=made).replace("<head>", "<head>" + PROBE, 1)
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    (tmp_path / "frame.html").write_text(FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    options = ["--window-size=1400,1000", f"--blink-settings=preferredColorScheme={0 if dark else 1}"]
    more = ["--virtual-time-budget=5000", "--dump-dom", (tmp_path / "frame.html").as_uri()]
    output, log = run_browser(find_browser(), tmp_path, *options, *more)
    found = re.search(r'data-probed="([^"]*)"', output)
    assert found, log
    probed = json.loads(found.group(1).replace("&quot;", '"'))
    assert probed == {"wide": [], "turns": True, "turnsBack": True, "width": width}
