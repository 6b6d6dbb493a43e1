"""Page of a study in a real browser: no script errors, nothing wider than the screen, and 3D views that turn."""

import json
import re

import pytest
from headless_browser import find_browser, run_browser

from simharness.outputs.study.page import render_study

pytestmark = pytest.mark.slow

# Installed before the page's scripts run; posts its observations when the page is complete.
PROBE = """<script>
const probed = { errors: [], views: [] };
addEventListener("error", (event) => probed.errors.push(String(event.message)));
addEventListener("unhandledrejection", (event) => probed.errors.push(String(event.reason)));
addEventListener("load", () => setTimeout(() => {
  probed.width = innerWidth;
  probed.overflow = document.scrollingElement.scrollWidth - innerWidth;
  probed.dark = matchMedia("(prefers-color-scheme: dark)").matches;
  probed.shown = {};
  for (const tab of document.querySelectorAll(".tabs > input")) {
    document.querySelector(`label[for=${tab.id}]`).click();
    const visible = [...document.querySelectorAll("figure .of")].filter((each) => each.checkVisibility());
    probed.shown[tab.id] = visible.map((each) => each.className);
  }
  for (const place of document.querySelectorAll(".view-3d")) {
    const canvas = place.querySelector("canvas"), slider = place.querySelector("input"), seen = {};
    const picture = () => canvas.toDataURL();
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    seen.colors = new Set(new Uint32Array(data.buffer)).size;
    seen.still = place.querySelector("svg").checkVisibility();
    seen.frame = place.querySelector("output").textContent;
    const first = picture();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    const turned = picture();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
    seen.turns = turned !== first;
    seen.turnsBack = picture() === first;
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "+" }));
    seen.zooms = picture() !== first;
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "-" }));
    const drag = (type, x) => canvas.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: x, clientY: 50 }));
    canvas.setPointerCapture = () => {}; // there is no such pointer
    drag("pointerdown", 50); drag("pointermove", 90); drag("pointerup", 90);
    seen.drags = picture() !== first;
    const before = picture();
    slider.value = Number(slider.value) ? 0 : 1;
    slider.dispatchEvent(new Event("input"));
    seen.slides = picture() !== before && place.querySelector("output").textContent !== seen.frame;
    probed.views.push(seen);
  }
  parent.postMessage(JSON.stringify(probed), "*");
}, 100));
</script>"""

# A browser window has a minimum width; an inner frame has none.
FRAME = """<!doctype html><html><script>
addEventListener("message", (event) => { document.documentElement.dataset.probed = event.data; });
</script><iframe src="page.html" style="border: 0; width: WIDTHpx; height: 900px"></iframe></html>"""


@pytest.fixture(scope="module")
def browser():
    return find_browser()


@pytest.fixture(scope="module")
def page(ran, shown):
    return render_study(ran, shown=[picture for picture, _ in shown])


def browse(browser, page, folder, *, width, dark=False):
    """Return the observations of the probe, and the browser's log."""
    file = folder / "frame.html"
    file.write_text(FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    (folder / "page.html").write_text(page.replace("<head>", "<head>" + PROBE, 1), encoding="utf-8")
    options = [
        *("--hide-scrollbars", "--no-first-run"),
        "--window-size=1400,1000",
        f"--blink-settings=preferredColorScheme={0 if dark else 1}",
        *("--virtual-time-budget=5000", "--enable-logging=stderr", "--v=0", "--dump-dom"),
    ]
    output, log = run_browser(browser, folder, *options, file.as_uri())
    found = re.search(r'data-probed="([^"]*)"', output)
    assert found, log
    return json.loads(found.group(1).replace("&quot;", '"').replace("&amp;", "&")), log


@pytest.mark.parametrize(("width", "dark"), [(360, False), (1280, True)])
def test_the_page_works(browser, page, tmp_path, width, dark):
    probed, log = browse(browser, page, tmp_path, width=width, dark=dark)
    assert probed["errors"] == []
    assert "Uncaught" not in log
    assert (probed["width"], probed["dark"]) == (width, dark)
    assert probed["overflow"] <= 0
    assert len(probed["shown"]) == 4
    for tab, visible in probed["shown"].items():
        assert visible
        assert {classes.split("of-")[1] for classes in visible} == {tab.removeprefix("tab-")}
    assert len(probed["views"]) == 4
    for seen in probed["views"]:
        assert seen["colors"] > 20
        assert not seen["still"]
        assert all(seen[key] for key in ("turns", "turnsBack", "zooms", "drags", "slides")), seen


def test_without_scripts_the_still_drawings_are_shown(browser, page, tmp_path):
    """A screenshot of the page without its scripts shows the limbs of people in their colours."""
    import numpy as np
    from PIL import Image

    plain = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    still = re.search(r'<div class="view-3d">\s*(<svg.*?</svg>)', plain, re.DOTALL).group(1)
    style = re.search(r"<style>.*?</style>", plain, re.DOTALL).group(0)
    file, picture = tmp_path / "still.html", tmp_path / "still.png"
    file.write_text(f"<!doctype html>{style}<main><div class=view-3d>{still}</div></main>", encoding="utf-8")
    options = ["--hide-scrollbars", "--window-size=800,600", f"--screenshot={picture}"]
    run_browser(browser, tmp_path, *options, file.as_uri())
    with Image.open(picture) as opened:
        pixels = np.asarray(opened.convert("RGB")).reshape(-1, 3).astype(int)
    assert len(np.unique(pixels, axis=0)) > 50
    assert (pixels.sum(axis=1) < 250).sum() > 100  # ink: the true limbs
