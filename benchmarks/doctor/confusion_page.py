"""Page of the benchmark of the doctor: requirements, and what is found where there is a fault.

    python -m benchmarks.doctor.confusion_page results/doctor

writes ``confusion.html`` again from ``doctor.json``.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.doctor.report import Row, kinds_of
from mvpose.report.documents import fill_template, program_version

_TEMPLATES = Path(__file__).parent / "templates"


def write_page(folder: Path) -> None:
    """Write ``confusion.html`` of a folder from its ``doctor.json``: requirements, and alarms by fault."""
    summary = json.loads((folder / "doctor.json").read_text())
    rows = [Row(**row) for row in summary["bounds"]]
    matrix = {fault: Counter(counts) for fault, counts in summary["confusion"].items()}
    (folder / "confusion.html").write_text(_page(rows, matrix))


def _page(rows: Sequence[Row], matrix: Mapping[str, Counter[str]]) -> str:
    """Return both tables as a page without scripts; faults are in the order of their alarms."""
    kinds = kinds_of(matrix)
    found = {fault: [counts[kind] for kind in kinds] for fault, counts in matrix.items()}
    ordered = sorted(found, key=lambda fault: found[fault].index(max(found[fault])))
    return fill_template(
        "confusion.html",
        folder=_TEMPLATES,
        program="mvpose",
        code=program_version(),
        name="the doctor",
        met=sum(row.met is True for row in rows),
        measured=sum(row.met is not None for row in rows),
        missed=[row.what.strip() for row in rows if row.met is False],
        rows=[{**asdict(row), "what": row.what.strip(), "part": row.what.startswith(" ")} for row in rows],
        kinds=[kind.replace("-", " ") for kind in kinds],
        matrix=[
            (fault, [(count, round(100 * count / matrix[fault]["recordings"])) for count in found[fault]])
            for fault in ordered
        ],
    )


if __name__ == "__main__":
    write_page(Path(sys.argv[1]))
