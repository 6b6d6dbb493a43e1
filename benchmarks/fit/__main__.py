"""Closed loop of the fit of detectors and annotations: ``python -m benchmarks.fit FOLDER --draws 20 --cameras 3 4 5``.

A detector and an annotation that are known make recordings, with and without errors of the annotation, and are fitted
to them again. Printed for each parameter, mean over the kinds of joint: the truth, the value measured before the
calibration, the fitted one, its bias and root mean square error, and how often its interval holds the truth; the
variation of the lengths of triangulated bones in the recording and in its twin. Each draw is a file in FOLDER: finished
ones are not repeated.

With ``--sensitivity`` instead: what halving and doubling each constant of the inference does to a fit. With
``--out-of-sample``: fits to halves of recordings of other detectors, beside the shipped profile.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.fit.loop import run
from benchmarks.fit.others import out_of_sample
from benchmarks.fit.recordings import RIGS
from benchmarks.fit.sensitivity import sensitivity
from benchmarks.fit.table import tables
from mvpose.files.atomic_files import write_atomic


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the draws that are missing, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fit", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--cameras", type=int, nargs="+", default=list(RIGS), choices=list(RIGS))
    parser.add_argument("--truth", nargs="+", default=["exact", "annotated"], choices=["exact", "annotated"])
    parser.add_argument("--films", type=Path, help="folder of re-enactments; default: films in FOLDER")
    parser.add_argument("--sensitivity", action="store_true")
    parser.add_argument("--out-of-sample", action="store_true")
    options = parser.parse_args(arguments)
    films = options.films or options.folder / "films"
    if options.sensitivity or options.out_of_sample:
        for line in sensitivity(films) if options.sensitivity else out_of_sample():
            print(line, flush=True)
        return 0
    draws = []
    options.folder.mkdir(parents=True, exist_ok=True)
    for draw in range(options.draws):
        for cameras in options.cameras:
            for truth in options.truth:
                file = options.folder / f"{cameras}_{truth}_{draw}.json"
                if not file.exists():
                    found = run(cameras, annotated=truth == "annotated", draw=draw, films=films)
                    write_atomic(file, json.dumps(found).encode())
                draws.append(json.loads(file.read_text("utf-8")))
    for line in tables(draws):
        print(line)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
