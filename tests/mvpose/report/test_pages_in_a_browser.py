"""Pages in a real browser: nothing is wider than the screen, and drawings have the colours of the page."""

import json
import re

import numpy as np
import pytest
from headless_browser import find_browser, run_browser
from people import ring
from PIL import Image
from synthetic_recording import recording
from test_doctor_page import finding, made_repair, moved, page_of, sighted

from mvpose.report.recording_page import write_page

pytestmark = pytest.mark.slow

PROBE = """<script>
addEventListener("load", () => {
  const wide = [...document.querySelectorAll("main *")].filter((each) =>
    !each.closest("svg") && !each.closest(".scroll") && each.getBoundingClientRect().right > innerWidth + 1);
  const empty = [...document.querySelectorAll("svg")].filter((each) => each.checkVisibility() && !each.clientHeight);
  const clipped = [...document.querySelectorAll(".scroll")].filter((each) => each.scrollWidth > each.clientWidth + 1);
  const page = document.scrollingElement;
  parent.postMessage(JSON.stringify({ width: innerWidth, overflow: page.scrollWidth - innerWidth,
    wide: wide.map((each) => each.className), empty: empty.length, clipped: clipped.length,
    ink: getComputedStyle(document.body).color }), "*");
});
</script>"""
# A browser window has a minimum width; an inner frame has none.
FRAME = """<!doctype html><html><script>
addEventListener("message", (event) => { document.documentElement.dataset.probed = event.data; });
</script><iframe src="page.html" style="border: 0; width: WIDTHpx; height: 900px"></iframe></html>"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Both pages, with a long name and many cameras."""
    folder = tmp_path_factory.mktemp("pages")
    rig, frames, people = recording(7, frames=40, cameras=9, noise=2.0)
    name = "a_recording_with_a_name_that_is_longer_than_the_screen_of_a_phone"
    path = write_page(folder, name=name, people=people, rig=rig, frames=frames)
    right = ring(5)
    repair = made_repair(right, np.full((5, 6), 0.01))
    doctor, _ = page_of(folder, moved(right, 2, degrees=2.0), sighted(right, noise=1.0), [finding()] * 2, repair)
    return {"recording": path.read_text(encoding="utf-8"), "doctor": doctor}


def probe(folder, page, width, *, dark=False):
    """Return what the browser finds on a page on a screen of some width."""
    (folder / "frame.html").write_text(FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    (folder / "page.html").write_text(page.replace("<head>", "<head>" + PROBE, 1), encoding="utf-8")
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    options = ["--hide-scrollbars", "--no-first-run", "--window-size=1400,1000", scheme]
    more = ["--virtual-time-budget=5000", "--dump-dom", (folder / "frame.html").as_uri()]
    output, log = run_browser(find_browser(), folder, *options, *more)
    found = re.search(r'data-probed="([^"]*)"', output)
    assert found, log
    probed = json.loads(found.group(1).replace("&quot;", '"').replace("&amp;", "&"))
    assert probed["width"] == width
    return probed


@pytest.mark.parametrize("name", ["recording", "doctor"])
@pytest.mark.parametrize(("width", "dark"), [(360, True), (1280, False)])
def test_pages_fit_the_screen(pages, tmp_path, name, width, dark):
    probed = probe(tmp_path, pages[name], width, dark=dark)
    assert (probed["overflow"] <= 0, probed["wide"], probed["empty"]) == (True, [], 0)
    assert probed["ink"] == ("rgb(232, 233, 235)" if dark else "rgb(27, 29, 33)")


@pytest.mark.parametrize(("people", "cameras", "width"), [(4, 5, 400), (8, 6, 1280)])
def test_tables_of_a_usual_recording_fit_the_screen_without_scrolling(tmp_path, people, cameras, width):
    rig, frames, found = recording(people, frames=10, cameras=cameras, noise=2.0)
    page = write_page(tmp_path, name="take 1", people=found, rig=rig, frames=frames).read_text(encoding="utf-8")
    probed = probe(tmp_path, page, width)
    assert (probed["overflow"] <= 0, probed["clipped"]) == (True, 0)


def test_people_are_drawn_in_their_colours(pages, tmp_path):
    page, picture = tmp_path / "page.html", tmp_path / "page.png"
    page.write_text(pages["recording"], encoding="utf-8")
    options = ["--hide-scrollbars", "--window-size=1280,3000", f"--screenshot={picture}"]
    run_browser(find_browser(), tmp_path, *options, page.as_uri())
    with Image.open(picture) as opened:
        pixels = np.asarray(opened.convert("RGB")).reshape(-1, 3).astype(int)
    for color in ((0, 119, 187), (238, 119, 51), (238, 51, 119)):  # of the first three people, in bars and dots
        assert (np.abs(pixels - color).max(axis=1) < 8).sum() > 500
