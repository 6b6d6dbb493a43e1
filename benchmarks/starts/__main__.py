"""Simulate recordings whose cameras start apart, find the starts as ``mvpose estimate --sync`` does, and print errors.

Of ten recordings one has cameras of 25 and 50 pictures a second, all others of 25. With ``--strangers``, one camera of
each but the first shows the people of the recording before, so that every answer is wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.filmed_people import filmed_people
from mvpose import Detections, Rig
from mvpose.arrays import Floats
from mvpose.cli.inputs import Choices, read_inputs
from mvpose.formats.calibration import pose2sim
from mvpose.formats.detections.openpose import people_file

_RATE = 50  # pictures a second of the simulation
_ACTIVITIES = ("walk", "wave", "walk", "point", "talk", "walk", "turn", "squat", "reach", "walk", "step")


@dataclass(frozen=True)
class _Film:
    """Recording of cameras that started apart."""

    rig: Rig
    pictures: list[list[Detections]]
    """Detections of each camera's pictures."""
    rates: list[int]
    """Pictures a second of each camera."""
    starts: Floats
    """True start of each camera, (V,), seconds."""


def _film(number: int, seed: int, apart: float) -> _Film:
    """Simulate a recording: 3 to 5 cameras, one to five people of whom one walks, 8 to 20 s of each camera."""
    rng = np.random.default_rng(seed + number)
    views, people = 3 + number % 3, 1 + (number // 2) % 5
    layout = ("ring", "corners", "arc")[number % 3]
    if layout == "corners" and views != 4:
        layout = "ring" if number % 2 else "arc"
    activities = ["walk", *map(str, rng.choice(_ACTIVITIES, people - 1))]
    length = rng.uniform(8, 20)
    recording = filmed_people(
        seed + number,
        rng,
        seconds=length + apart + 0.1,
        rate=_RATE,
        activities=activities,
        views=views,
        layout=layout,
        boxes=number % 3,
    )
    frames = list(recording.detections)
    rates = [_RATE if number % 10 == 4 and view % 2 else _RATE // 2 for view in range(views)]
    first = np.round(rng.uniform(0, apart, views) * _RATE).astype(int)
    pictures = []
    for view, (start, rate) in enumerate(zip(first.tolist(), rates, strict=True)):
        rows = range(start, min(start + round(length * _RATE), len(frames)), _RATE // rate)
        pictures.append([frames[row].select(frames[row].view == view) for row in rows])
    return _Film(recording.rig, pictures, rates, first / _RATE)


def turned(rig: Rig, degrees: float, seed: int) -> Rig:
    """Return the rig with each camera turned about its centre, by so many degrees about a random axis."""
    axes = np.random.default_rng([seed, 1]).standard_normal((len(rig), 3))
    axes *= np.radians(degrees) / np.linalg.norm(axes, axis=1, keepdims=True)
    matrices = Rotation.from_rotvec(axes).as_matrix()
    cameras = zip(rig, matrices, rig.centers, strict=True)
    return Rig([replace(each, R=turn @ each.R, t=-turn @ each.R @ center) for each, turn, center in cameras])


def _found(film: _Film) -> tuple[str, Floats | None]:
    """Return what the command says, and the starts that it finds, (V,), seconds; None where it refuses."""
    with TemporaryDirectory() as place, contextlib.redirect_stderr(io.StringIO()):
        folder, names = Path(place), [f"cam{view}" for view in range(len(film.rig))]
        rig = Rig([replace(camera, name=name) for camera, name in zip(film.rig, names, strict=True)])
        pose2sim.write_calibration(folder / "Calib.toml", rig)
        for name, pictures in zip(names, film.pictures, strict=True):
            (folder / "openpose" / name).mkdir(parents=True)
            for number, each in enumerate(pictures):
                content = json.dumps(people_file(each.keypoints, each.scores))
                (folder / "openpose" / name / f"{name}_{number:06d}_keypoints.json").write_text(content)
        choices = Choices(sync=True, rates=",".join(map(str, film.rates)))
        try:
            found = read_inputs(folder / "Calib.toml", [folder / "openpose"], choices).synchronised
        except ValueError as error:
            return str(error), None
    assert found is not None
    return "", found.starts


def main() -> None:
    """Print the errors of the starts of each recording."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.starts", description=__doc__)
    parser.add_argument("--count", type=int, default=20, metavar="N", help="recordings")
    parser.add_argument("--seed", type=int, default=93000, metavar="N", help="of the first recording")
    parser.add_argument("--apart", type=float, default=5.0, metavar="S", help="most seconds between two starts")
    parser.add_argument("--strangers", action="store_true", help="one camera shows other people")
    parser.add_argument("--turned", type=float, default=0.0, metavar="DEG", help="error of each camera's rotation")
    options = parser.parse_args()
    within = answered = 0
    before: _Film | None = None
    for number in range(options.count):
        film = _film(number, options.seed, options.apart)
        shown = film
        if options.strangers and before is not None:
            other = [replace(each, view=np.zeros_like(each.view)) for each in before.pictures[0]]
            shown = replace(film, pictures=[other, *film.pictures[1:]], rates=[before.rates[0], *film.rates[1:]])
        before = film
        words, starts = _found(replace(shown, rig=turned(film.rig, options.turned, options.seed + number)))
        answer = words
        if starts is not None:
            error = np.ptp(starts - film.starts)
            answered, within = answered + 1, within + int(error <= 1.0 / min(film.rates))
            answer = f"{1e3 * error:.0f} ms"
        print(f"{number}: {len(film.rig)} cameras, {answer}", flush=True)
    print(f"{within} of {options.count} within a frame, {answered - within} wrong, {options.count - answered} refused")


if __name__ == "__main__":
    main()
