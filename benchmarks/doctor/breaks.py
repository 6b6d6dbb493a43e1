"""Ten breaks of three rigs, found and mended by the command line alone.

    python -m benchmarks.doctor.breaks --work FOLDER [--rig shelf] [--break "x 10"] [--out results/doctor/breaks.md]

The rigs are real Shelf and a recording of Pose2Sim (below the folder of ``SIMHARNESS_DATA``), and a simulated one of
five distant HD cameras in whose pictures people are cut off. Each calibration is broken in one way and given to
``mvpose doctor``; the command that it prints is run as it is; the doctor examines the result. A row shows the verdicts,
whether the fault and the camera were named, and how far the mended cameras are from the untouched ones.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from benchmarks.doctor.measures import aligned, camera_errors
from mvpose import Camera, Rig
from mvpose.calibration.findings import ALARM
from mvpose.cli.app import app
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.detections.openpose import people_file

AXIS = np.array([0.6, 0.64, 0.48])  # of turns: no axis of a camera or of the world
VIEW, OTHER = 1, 2  # the camera that is broken, and the one that it is exchanged with

Entry = dict[str, object]
Cameras = list[Camera]


@dataclass(frozen=True)
class Lab:
    """A recording on disk.

    Attributes:
        name: name of the rig.
        rig: its cameras, untouched.
        detections: folder of the detections.
        options: options that the commands need for them.
    """

    name: str
    rig: Rig
    detections: Path
    options: tuple[str, ...]


@dataclass(frozen=True)
class Break:
    """A wrong calibration.

    Attributes:
        change: makes the cameras of the file wrong.
        kinds: kinds of findings that name it.
        view: the camera that a finding must name; None for a fault of all.
        size: whether the sizes of the pictures in the file are wrong instead.
    """

    change: Callable[[Cameras], Cameras]
    kinds: frozenset[str]
    view: int | None = None


def _of_all(change: Callable[[Camera], Camera]) -> Callable[[Cameras], Cameras]:
    return lambda cameras: [change(each) for each in cameras]


def _of_one(change: Callable[[Camera], Camera]) -> Callable[[Cameras], Cameras]:
    return lambda cameras: [change(each) if view == VIEW else each for view, each in enumerate(cameras)]


def _longer(factor: float) -> Callable[[Camera], Camera]:
    return lambda camera: replace(camera, t=factor * camera.t)


def _inverted(camera: Camera) -> Camera:
    return replace(camera, R=camera.R.T, t=camera.center)


def _exchanged(cameras: Cameras) -> Cameras:
    one, other = cameras[VIEW], cameras[OTHER]
    swapped = {VIEW: replace(other, name=one.name), OTHER: replace(one, name=other.name)}
    return [swapped.get(view, each) for view, each in enumerate(cameras)]


def _other_size(camera: Camera) -> Camera:
    return replace(camera, size=(camera.size[0] // 2, camera.size[1] // 2))


def _focal(factor: float) -> Callable[[Camera], Camera]:
    return lambda camera: replace(camera, K=camera.K * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]])


def _other_resolution(camera: Camera) -> Camera:
    return replace(camera, K=camera.K * [[0.5], [0.5], [1.0]])


def turned(degrees: float) -> Callable[[Camera], Camera]:
    """Return the turn of a camera about its centre."""

    def change(camera: Camera) -> Camera:
        R = Rotation.from_rotvec(np.radians(degrees) * AXIS).as_matrix() @ camera.R
        return replace(camera, R=R, t=-R @ camera.center)

    return change


BREAKS = {
    "untouched": Break(lambda cameras: cameras, frozenset()),
    "millimetres, all": Break(_of_all(_longer(1000.0)), frozenset({"wrong-unit"})),
    "millimetres, one": Break(_of_one(_longer(1000.0)), frozenset({"wrong-unit"}), VIEW),
    "x 10": Break(_of_all(_longer(10.0)), frozenset({"wrong-unit"})),
    "two exchanged": Break(_exchanged, frozenset({"cameras-swapped"}), VIEW),
    "inverted, all": Break(_of_all(_inverted), frozenset({"extrinsics-inverted"})),
    "inverted, one": Break(_of_one(_inverted), frozenset({"extrinsics-inverted"}), VIEW),
    "picture size": Break(_of_all(_other_size), frozenset({"picture-size"})),
    "K of another resolution": Break(_of_all(_other_resolution), frozenset({"image-size"})),
    "moved by 1 degree": Break(_of_one(turned(1.0)), frozenset({"moved-camera"}), VIEW),
    "moved by 2 degrees": Break(_of_one(turned(2.0)), frozenset({"moved-camera"}), VIEW),
    "moved by 3 degrees": Break(_of_one(turned(3.0)), frozenset({"moved-camera"}), VIEW),
    "focal x 1.1": Break(_of_one(_focal(1.1)), frozenset({"focal-length"}), VIEW),
}


def write_cameras(path: Path, cameras: Sequence[Camera]) -> None:
    """Write cameras as Pose2Sim's file, also those that make no rig."""
    lines = []
    for each in cameras:
        lines += [
            f"[{each.name}]", f'name = "{each.name}"', f"size = {[float(side) for side in each.size]}",
            f"matrix = {each.K.tolist()}", f"distortions = {each.distortion.tolist()}",
            f"rotation = {Rotation.from_matrix(each.R).as_rotvec().tolist()}", f"translation = {each.t.tolist()}",
            "fisheye = false", "",
        ]  # fmt: skip
    path.write_text("\n".join(lines))


def shelf(data: Path, work: Path) -> Lab:
    """Real Shelf: 301 frames of OpenPose at 25 Hz, five cameras."""
    rig = read_calibration(data / "shelf" / "calibration_shelf.json", size=(1032, 776))
    return Lab("shelf", rig, data / "shelf" / "openpose", ("--fps", "25"))


def pose2sim(data: Path, work: Path) -> Lab:
    """Pose2Sim's demonstration: 100 frames of BODY_25B at 60 Hz, four cameras, one man who balances."""
    folder = data / "pose2sim" / "body25b"
    rig = read_calibration(folder / "Calib_qualisys.toml", size=(1, 1))
    return Lab("pose2sim", rig, folder / "balancing" / "pose", ("--fps", "60", "--skeleton", "body25b"))


def simulated(data: Path, work: Path) -> Lab:
    """Five distant HD cameras around four people, whom the edges of the pictures cut off."""
    from benchmarks.doctor import prepare

    recording = prepare.simulated(
        "distant", 6000, "clutter.boxes=0", "room.size=[16.0, 16.0, 5.0]", "cameras.radius=6.5", "cameras.height=2.2",
        "cameras.fov=30.0", "cameras.size=[1920, 1080]", 'people.activities=["walk"]',
    )  # fmt: skip
    rig = recording.rig
    folder = work / "simulated"
    for number, frame in enumerate(recording.frames):
        for view, camera in enumerate(rig):
            rows = frame.view == view
            place = folder / camera.name / f"{camera.name}_{number:012d}_keypoints.json"
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(json.dumps(people_file(frame.keypoints[rows], frame.scores[rows])))
    return Lab("simulated", rig, folder, ("--fps", "25"))


RIGS = {"shelf": shelf, "pose2sim": pose2sim, "simulated": simulated}


@dataclass(frozen=True)
class Row:
    """What the commands made of one broken calibration.

    Attributes:
        rig: name of the rig.
        name: name of the break.
        verdict: verdict of the doctor.
        named: whether an alarm names the fault and its camera.
        text: the alarms; without any the first finding.
        command: the command that mends it.
        after: verdict after it, or its error.
        errors: largest turn (degrees), shift (metres) and error of the focal length (share) of the mended cameras
            against the untouched ones; NaN without.
    """

    rig: str
    name: str
    verdict: str
    named: bool
    text: str
    command: str = ""
    after: str = ""
    errors: tuple[float, float, float] = (np.nan, np.nan, np.nan)

    @property
    def right(self) -> bool:
        """Whether the fault was named and mended; of the untouched rig, whether nothing was alarmed."""
        if self.name == "untouched":
            return self.verdict != "faults"
        mended = self.after in ("fine", "cannot tell") and self.errors[0] < ALARM["degrees"]
        return self.named and mended and self.errors[1] < ALARM["metres"] and 100 * self.errors[2] < ALARM["percent"]


def measure(lab: Lab, name: str, work: Path) -> Row:
    """Break the calibration of a rig, and run the doctor, the command that it prints, and the doctor again."""
    case, folder = BREAKS[name], work / f"{lab.name} {name}".replace(" ", "-")
    folder.mkdir(parents=True, exist_ok=True)
    broken = folder / "Calib.toml"
    write_cameras(broken, case.change(list(lab.rig)))
    inputs = [str(broken), str(lab.detections), *lab.options]
    found = CliRunner().invoke(app, ["doctor", *inputs, "--json"])
    if not found.stdout.startswith("{"):
        last = (found.stderr.strip().splitlines() or ["?"])[-1]
        return Row(lab.name, name, "refused", False, last)
    diagnosis = json.loads(found.stdout)
    alarms = [each for each in diagnosis["findings"] if each["severity"] == "alarm"]
    names = [each.name for each in lab.rig]
    camera = None if case.view is None else names[case.view]
    named = bool(alarms) and any(each["kind"] in case.kinds and each["camera"] == camera for each in alarms)
    text = "; ".join(each["text"] for each in (alarms or diagnosis["findings"][:1]))
    row = Row(lab.name, name, diagnosis["verdict"], named, text, diagnosis["command"] or "")
    return row if not row.command else _mended(row, lab, inputs, folder)


def _mended(row: Row, lab: Lab, inputs: Sequence[str], folder: Path) -> Row:
    """Run the command of a row in a folder, and examine what it wrote."""
    runner, before, words = CliRunner(), Path.cwd(), shlex.split(row.command)
    os.chdir(folder)
    try:
        mended = runner.invoke(app, words[1:])
        if mended.exit_code or "--out" not in words:
            return replace(row, after=(mended.stderr.strip().splitlines() or ["no calibration"])[-1])
        out = words[words.index("--out") + 1]
        again = runner.invoke(app, ["doctor", out, *inputs[1:], "--json"])
        rig = aligned(read_calibration(out, size=(1, 1)), lab.rig)
    finally:
        os.chdir(before)
    turns, shifts = camera_errors(rig, lab.rig)
    focal = max(abs(float(a.K[0, 0] / b.K[0, 0]) - 1.0) for a, b in zip(rig, lab.rig, strict=True))
    errors = float(turns.max()), float(shifts.max()), focal
    return replace(row, after=json.loads(again.stdout)["verdict"], errors=errors)


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a table in Markdown."""
    lines = ["| rig | break | verdict | named | what it says | after its command | off by | right |", "|---" * 8 + "|"]
    for row in rows:
        degrees, metres, focal = row.errors
        off = f"{degrees:.2f}°, {100 * metres:.1f} cm, {100 * focal:.1f} %" if np.isfinite(degrees) else ""
        named, right = "yes" if row.named else "", "yes" if row.right else "**no**"
        cells = [row.rig, row.name, row.verdict, named, row.text, row.after, off, right]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark and return the exit code: 0, or 1 where a row is not right."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.doctor.breaks", description=__doc__)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("SIMHARNESS_DATA", "data")))
    parser.add_argument("--work", type=Path, required=True, help="an empty folder for the files")
    parser.add_argument("--rig", nargs="+", choices=RIGS, default=list(RIGS))
    parser.add_argument("--break", dest="breaks", nargs="+", choices=BREAKS, default=list(BREAKS))
    parser.add_argument("--out", type=Path, help="write the table here")
    options = parser.parse_args(arguments)
    rows = []
    for rig in options.rig:
        lab = RIGS[rig](options.data, options.work)
        for name in options.breaks:
            rows.append(measure(lab, name, options.work))
            row = rows[-1]
            print(
                f"{row.rig}, {row.name}: {row.verdict}, then {row.after or 'no command'}", file=sys.stderr, flush=True
            )
    text = table(rows)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n")
    return int(not all(each.right for each in rows))


if __name__ == "__main__":
    sys.exit(main())
