"""Export a scenario, film it with painted bodies, run ``mvpose run`` on the videos, and score its files.

python -m benchmarks.pictures [--scenario NAME] [--set KEY=VALUE ...] [--head simcc|heatmap] [--out FOLDER]
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.pictures import networks
from benchmarks.pictures.painted_bodies import write_pictures
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.scenario.load import load

Command = Callable[..., None]


def measure(
    scenario: str, overrides: list[str], folder: Path, *, head: str = "simcc", command: Command | None = None
) -> Path:
    """Export a scenario, write its pictures and networks, and run the commands of a user on them.

    Args:
        scenario: scenario file or name; at most six people.
        overrides: ``KEY=VALUE`` each.
        folder: an existing, empty folder.
        head: kind of the pose head, ``simcc`` or ``heatmap``.
        command: runs a program with its arguments; by default as another process.

    Returns:
        JSON file with the scores.

    Raises:
        subprocess.CalledProcessError: a command failed.
    """
    loaded = load(scenario, overrides=overrides)
    export = export_sequence(loaded, ExportPlan(folder / loaded.name, pictures=False))
    pictures = folder / "pictures"
    pictures.mkdir()
    videos = write_pictures(loaded, pictures)
    detector = networks.detector(folder / "rtmdet_painted.onnx")
    pose = {"simcc": networks.simcc_head, "heatmap": networks.heatmap_head}[head](folder / f"{head}_painted.onnx")
    calibration, out, scores = export / f"calibration_{loaded.name}.json", folder / "results", folder / "scores.json"
    options = ["--detector", detector, "--pose", pose, "--fps", f"{loaded.rate:g}", "--out", out]
    run = command or _run
    run("mvpose", "run", calibration, *videos, *options)
    run("simharness", "evaluate", "poses", export, out, "--json", scores)
    return scores


def _run(program: str, *arguments: object) -> None:
    words = list(map(str, arguments))
    print(f"$ {shlex.join([program, *words])}", flush=True)
    start = perf_counter()
    subprocess.run([sys.executable, "-m", f"{program}.cli", *words], check=True)
    print(f"({perf_counter() - start:.1f} s)", flush=True)


def main() -> None:
    """Parse the command line and measure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=__doc__)
    parser.add_argument("--scenario", default="quickstart", help="scenario file or name; at most six people")
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--head", choices=("simcc", "heatmap"), default="simcc", help="kind of the pose head")
    parser.add_argument("--out", type=Path, help="folder in which everything stays")
    given = parser.parse_args()
    with TemporaryDirectory() as temporary:
        folder = given.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        measure(given.scenario, given.overrides, folder, head=given.head)


if __name__ == "__main__":
    main()
