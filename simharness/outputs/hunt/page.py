"""Page of a folder of kept failures: what fails in each, why, and what the cameras show."""

from pathlib import Path

import numpy as np
from markupsafe import Markup

from mvpose import COCO17, Camera
from mvpose.arrays import Floats
from mvpose.commands.output_files import write_text
from mvpose.report.documents import fill_template
from mvpose.report.palette import identity_color
from mvpose.report.picture_drawings import Person, draw_detections, draw_people, near_picture, picture_element
from simharness.hunt.kept_failure import KeptFailure, is_failure, read_failure
from simharness.outputs import TEMPLATES
from simharness.runtime.version import code_version

PAGE = "failures.html"


def write_failures_page(folder: Path) -> Path:
    """Write the page of all kept failures of a folder into it, and return the file.

    Raises:
        ValueError: a failure cannot be read, or the page cannot be written.
    """
    failures = [read_failure(path) for path in sorted(folder.glob("*.toml")) if is_failure(path)]
    page = fill_template(
        PAGE,
        folder=TEMPLATES,
        program="simharness",
        code=code_version(),
        name="failures",
        path=folder,
        failures=[(each, *_views(each)) for each in failures],
    )
    write_text(page, folder / PAGE)
    return folder / PAGE


def _views(failure: KeptFailure) -> tuple[bool, list[tuple[str, Markup]]]:
    """Return whether a failure still fails, and name and drawing of each camera, with the answer of the method now."""
    (answer, fails), views = failure.replay(), []
    rig, detections, truth = failure.detected()
    colors = [identity_color(number) for number in failure.numbers]
    for view, (camera, frozen) in enumerate(zip(rig, failure.cameras, strict=True)):
        people = [
            Person(truth.pixels[view, p], colors[p], f"person {number}") for p, number in enumerate(failure.numbers)
        ]
        found = [Person(camera.project(joints), "var(--bad)", f"answer {k}") for k, joints in enumerate(answer)]
        marks = [
            f'<path class="wrong" d="M{x:.1f} {y:.1f}l{error.offset[0]:.1f} {error.offset[1]:.1f}"/>'
            for error in failure.errors
            if error.kind == "keypoint" and error.camera == frozen.name and error.offset is not None
            for x, y in [truth.pixels[view, failure.numbers.index(error.person), COCO17.index(error.joint)]]
            if np.isfinite(x)
        ]
        parts = [
            *draw_people(camera, people, COCO17),
            f'<g class="answer">{"".join(draw_people(camera, found, COCO17))}</g>',
            *draw_detections(camera, detections, view, truth.person, colors),
            *marks,
        ]
        points = [detections.keypoints[detections.view == view].reshape(-1, 2), truth.pixels[view].reshape(-1, 2)]
        parts = [f'<g transform="{_zoom(camera, np.concatenate(points))}">', *parts, "</g>"]
        views.append((frozen.name, Markup(picture_element(camera, parts, label=f"camera {frozen.name}"))))
    return fails, views


def _zoom(camera: Camera, points: Floats) -> str:
    """Return the transform by which what lies in or near a picture at points (n, 2) fills it."""
    size, pixels = np.array(camera.size, float), points[near_picture(camera, points)]
    if not len(pixels):
        return "scale(1)"
    share = min(1.2 * float((np.ptp(pixels, axis=0) / size).max()) + 0.05, 1.0)
    x, y = np.clip((pixels.min(axis=0) + pixels.max(axis=0) - share * size) / 2, 0.0, (1 - share) * size)
    return f"scale({1 / share:.4f}) translate({-x:.1f} {-y:.1f})"
