"""``mvpose repair``: a better calibration, from the people in the pictures."""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mvpose.cli.inputs import Calibration, Choices, DetectionPaths, read_inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.programs import note

if TYPE_CHECKING:
    from mvpose import Rig
    from mvpose.calibration import Repair
    from mvpose.calibration.mends import Mend
    from mvpose.calibration.repair import Freedom, Size
    from mvpose.cli.inputs import Inputs


@grouped(without=["joints"])
def repair(
    calibration: Calibration,
    detections: DetectionPaths,
    out: Path | None = option(None, "The new calibration, in the format of the old one.", metavar="NEW"),
    mend: list[str] | None = option(
        None,
        "A mistake to mend, as `mvpose doctor` prints it: [cyan]inverted[/], [cyan]unit:0.001@cam2[/] ... May "
        "be repeated; applied in this order.",
        metavar="NAME",
    ),
    free: str | None = option(
        None,
        "What is estimated from the people: extrinsics (position and direction), focal, center. "
        "[dim]\\[default: extrinsics; nothing with --mend][/]",
        metavar="NAME,...",
    ),
    new_times: Path | None = option(
        None,
        "Also write the times of the pictures with corrected clocks, for --times of other commands. Without "
        "--out, only these.",
        metavar="FILE",
    ),
    rig_size: str = option(
        "calibration",
        "What decides the size of the rig: calibration, people (their bone lengths) or both.",
        metavar="NAME",
    ),
    *,
    choices: Choices,
) -> None:
    """Correct a calibration from the people in the pictures, and write it in the format of the old one."""
    with PROGRAM.exit_on_error():
        from mvpose.calibration import repair as estimated
        from mvpose.calibration.mends import Mend
        from mvpose.commands.errors import failing
        from mvpose.commands.output_files import check_new
        from mvpose.formats.calibration.calibration_formats import check_writable

        if out is None and new_times is None:
            raise ValueError(
                "--out: expected the file of the new calibration, or --new-times for corrected times alone"
            )
        if out is not None:
            check_new(out)
        elif free is not None or mend:
            raise ValueError("--mend and --free change the calibration: give --out")
        if new_times is not None and choices.sync:
            raise ValueError(
                "--sync and --new-times: files that count from different moments have no times in common; give --sync "
                "to the other commands as well"
            )
        if new_times is not None:
            check_new(new_times, option="--new-times")
        if out is not None:
            check_writable(calibration)
        mends = [Mend.parsed(text) for text in mend or []]
        chosen = free if free is not None else "" if mends or out is None else "extrinsics"
        freedoms, decides = _freedoms(chosen), _size(rig_size)
        if not freedoms and decides != "calibration":
            raise ValueError(
                "--rig-size: has an effect only where cameras are estimated: give --free extrinsics as well"
            )
        if choices.up is not None:
            note("--up has no effect: the new calibration keeps the axes of the old one")
        inputs = _mended(read_inputs(calibration, detections, replace(choices, up=None), examined=True), mends)
        lines = [f"{each}: applied" for each in mends]
        if freedoms:
            with failing("the repair"):
                result = estimated(inputs.rig, inputs.frames, period=inputs.period, free=freedoms, size=decides)
            if result.refused:
                raise ValueError(f"nothing was repaired: {result.refused}")
            for reason in result.held:
                note(f"not changed: {reason}")
            inputs = replace(inputs, rig=result.rig)
            lines += _lines(result)
        elif new_times is None:
            for name in ("fps", "times", "frames", "skeleton"):
                if given(name):
                    note(f"--{name} has no effect: --mend changes the calibration without the people")
        if out is not None:
            write_new(calibration, out, inputs.rig)
            unit = "" if choices.unit is None else ", in metres"
            lines.append(f"{out}: repaired calibration{unit}; `mvpose doctor` examines it")
        if new_times is not None:
            _write_times(new_times, inputs)
            lines.append(f"{new_times}: corrected times of the pictures, for --times")
    typer.echo("\n".join(lines))


def _mended(inputs: "Inputs", mends: "list[Mend]") -> "Inputs":
    """Return the recording with a mended rig.

    Raises:
        ValueError: a camera that is not there, or cameras that make no rig.
    """
    from mvpose import Rig

    cameras = list(inputs.rig)
    for each in mends:
        cameras = each.applied(cameras)
    return replace(inputs, rig=Rig(cameras))


def _freedoms(given: str) -> "tuple[Freedom, ...]":
    names = [name.strip() for name in given.split(",") if name.strip()]
    known: dict[str, Freedom] = {"extrinsics": "extrinsics", "focal": "focal", "center": "center"}
    for name in names:
        if name not in known:
            raise ValueError(f"--free {name}: expected some of {', '.join(known)}")
    return tuple(known[name] for name in names)


def _size(given: str) -> "Size":
    known: dict[str, Size] = {"calibration": "calibration", "people": "people", "both": "both"}
    if given not in known:
        raise ValueError(f"--rig-size {given}: expected calibration, people or both")
    return known[given]


def write_new(original: Path, path: Path, rig: "Rig") -> None:
    """Write a rig in the format of a calibration; files appear when all are complete.

    Raises:
        ValueError: the format cannot hold the rig.
        OSError: a file cannot be written.
    """
    from mvpose.formats.calibration.calibration_formats import write_like

    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".", suffix=".partial") as partial:
        write_like(original, Path(partial) / path.name, rig)
        for each in Path(partial).iterdir():  # EasyMocap's calibrations are two files
            if (path.parent / each.name).exists():
                raise ValueError(f"--out {path.parent / each.name}: exists, and is not replaced; give another folder")
        for each in Path(partial).iterdir():
            shutil.move(each, path.parent / each.name)


def _write_times(path: Path, inputs: "Inputs") -> None:
    """Write the times of the pictures by corrected clocks, without lost and repeated pictures."""
    from mvpose.calibration import estimate_clocks
    from mvpose.commands.errors import failing
    from mvpose.files.atomic_files import write_atomic

    with failing("the estimation of clocks"):
        clocks = estimate_clocks(inputs.rig, inputs.frames, period=inputs.period)
    lines = [",".join(clocks.names)]
    lines += [",".join(f"{time:.6f}" for time in row) for row in clocks.times.tolist()]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, ("\n".join(lines) + "\n").encode())


def _lines(result: "Repair") -> list[str]:
    """Return a line for each camera: its turn, its shift, its clock, and its residuals."""
    import numpy as np

    lines = []
    for view, camera in enumerate(result.rig):
        turn, shift = np.degrees(result.corrections[view, :3]), result.corrections[view, 3:]
        parts = [f"turned by {np.linalg.norm(turn):.2f} degrees, moved by {100 * np.linalg.norm(shift):.1f} cm"]
        if abs(result.focal[view] - 1.0) > 1e-9:
            parts.append(f"focal length {100 * (result.focal[view] - 1.0):+.2f} %")
        if result.offset_sigmas[view] > 0:
            clock, sigma = 1000 * result.offsets[view], 1000 * result.offset_sigmas[view]
            parts.append(f"clock {clock:+.0f} ms (standard deviation {sigma:.0f})")
        before, after = result.residuals_before[view], result.residuals_after[view]
        parts.append(f"residual {before:.1f} to {after:.1f} px")
        lines.append(f"{camera.name}: {', '.join(parts)}")
    return lines
