"""Make the pictures of pages in the guide: a simulated recording whose third camera was moved, as a browser shows it.

    python -m tools.page_pictures docs/guide/pages

Needs chromium. The recording is simulated, so that no picture of a real person is in the guide.
"""

from __future__ import annotations

import argparse
import io
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

import simharness
from mvpose import Rig
from mvpose.calibration import diagnose, repair
from mvpose.recording import People
from mvpose.report.doctor_page import write_doctor_page
from mvpose.report.recording_page import write_page
from mvpose.tracking.smoothing import TrackingPipeline
from simharness.trial.run_trial import TrialResult, run_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

_SCENE = ("duration=10.0", "rate=25.0", "rendering.renderer='rays'")
_MOVED, _TURN, _SHIFT = 2, np.radians([0.9, -1.0, 0.6]), np.array([0.05, -0.03, 0.03])  # view; rad; metres
_WIDTH, _HEIGHTS = 1280, {"recording": 3900, "doctor": 4200}  # pixels of the window
_COLORS = 256  # of the pictures in the guide, which keeps them small
_EMPTY = 40  # rows of one colour that are kept at the end


def main() -> None:
    """Simulate, estimate, diagnose, repair, write both pages, and take their pictures."""
    parser = argparse.ArgumentParser(prog="python -m tools.page_pictures", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where recording.png and doctor.png are written")
    folder = parser.parse_args().folder
    scenario = simharness.load_scenario("quickstart", overrides=_SCENE, seed=4_000)
    result = run_trial(scenario, until="detect")
    with TemporaryDirectory() as name:
        _write_pages(Path(name), result)
        for page, height in _HEIGHTS.items():
            picture = _photographed(Path(name) / f"{page}.html", height)
            picture.save(folder / f"{page}.png", optimize=True)


def _write_pages(folder: Path, result: TrialResult) -> None:
    recording = result.recording
    frames = recording.detections
    source = picture_source_of(result.scenario, Playback(result.trial.scene))
    people = People.of_estimates(TrackingPipeline().track(recording.rig, frames))

    def picture(frame: int, view: int) -> NDArray[np.uint8]:
        return source.picture(result.trial.exposures, frame, view, finer=2)

    fine = diagnose(recording.rig, frames)
    write_page(
        folder, name="Hall, take 1", people=people, rig=recording.rig, frames=frames, diagnosis=fine, pictures=picture
    )
    wrong = _moved(recording.rig)
    write_doctor_page(
        folder,
        name="Hall, take 2",
        rig=wrong,
        frames=frames,
        diagnosis=diagnose(wrong, frames),
        repair=repair(wrong, frames),
        pictures=picture,
        command=lambda options: shlex.join(
            ["mvpose", "repair", "hall.json", "detections", *options, "--out", "new.json"]
        ),
    )


def _moved(rig: Rig) -> Rig:
    """Return the rig with the calibration of one camera as if the camera had been touched after calibration."""
    camera = rig[_MOVED]
    R, center = Rotation.from_rotvec(_TURN).as_matrix() @ camera.R, camera.center + _SHIFT
    return Rig([replace(each, R=R, t=-R @ center) if each is camera else each for each in rig])


def _photographed(page: Path, height: int) -> Image.Image:
    """Return a page as a browser shows it, without the empty part below its end."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("error: no headless browser; install chromium")
    file = page.with_suffix(".png")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={page.parent}/p"]
    size, shot = f"--window-size={_WIDTH},{height}", f"--screenshot={file}"
    subprocess.run([browser, *options, size, shot, page.as_uri()], check=True, capture_output=True)
    picture = Image.open(io.BytesIO(file.read_bytes())).convert("RGB")
    rows = np.flatnonzero(np.ptp(np.asarray(picture), axis=1).max(axis=1))
    cut = picture.crop((0, 0, picture.width, min(picture.height, int(rows[-1]) + _EMPTY)))
    return cut.quantize(_COLORS)


if __name__ == "__main__":
    main()
