"""Print which wrong twins of a recording `simharness validate` notices, and from which size on."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict, replace
from pathlib import Path

from benchmarks.validation.power import Noticed, Power, measured, simulated
from benchmarks.validation.wrong_twins import SIZES, WRONG, WrongTwin
from mvpose.commands.progress import reporter
from simharness.reality.filmed_recording import film
from simharness.reality.recording_file import read_recording
from simharness.reality.twin import MOST_FILMS
from simharness.reality.validation.validation import twin_model

_OTHERS = 1000  # first seed of the twins in the place of the recording


def main() -> None:
    """Simulate, measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.validation", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of the data set Shelf")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every n-th frame")
    parser.add_argument("--twins", type=int, default=10, metavar="N", help="twins of each kind")
    parser.add_argument("--others", type=int, default=10, metavar="N", help="right twins in the place of the recording")
    parser.add_argument("--sizes", action="store_true", help="also smaller errors")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write all numbers as JSON")
    given = parser.parse_args()

    recording = read_recording("shelf", given.folder)
    model = twin_model(recording)
    films = [*model.films, *(film(recording, model.people, seed=k) for k in range(len(model.films), MOST_FILMS))]
    model, extent = replace(model, films=tuple(films)), {"every": given.every, "workers": given.workers}
    with reporter() as bars:
        power = Power(
            measured([recording], **extent)[0],
            simulated(model, WrongTwin(), range(given.twins), **extent, reporter=bars),
            simulated(model, WrongTwin(), range(_OTHERS, _OTHERS + given.others), **extent, reporter=bars),
        )
        found = {"right": power.noticed(power.right)}
        for name, wrong in {**WRONG, **(SIZES if given.sizes else {})}.items():
            found[name] = power.noticed(simulated(model, wrong, range(given.twins), **extent, reporter=bars))
            print_row(name, found[name], first=len(found) == 2, right=found["right"])
    if given.out is not None:
        given.out.write_text(json.dumps({name: asdict(each) for name, each in found.items()}, indent=1) + "\n")


def print_row(name: str, noticed: Noticed, *, first: bool, right: Noticed) -> None:
    """Print a row of the table, and before the first one its heading and the row of right twins."""
    if first:
        print("| twins | fail | hold | no longer hold | distance of Shelf / right twins | p | noticed on twins |")
        print("|---|--:|--:|--:|--:|--:|--:|")
        print(f"| right | {right.fails} | {right.holds} | | 1 | | {100 * right.share:.0f} % |")
    print(
        f"| {name} | {noticed.fails} | {noticed.holds} | {noticed.lost} | {noticed.ratio:.2f} | {noticed.p_value:.3f} "
        f"| {100 * noticed.share:.0f} % |",
        flush=True,
    )


main()
