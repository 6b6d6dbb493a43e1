"""Run a study from Python: how many cameras does it take? Results are stored, so a second run takes no time."""

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

from simharness.scenario.load import load_study
from simharness.study.study_run import run_study

STUDY = """
extends = "quickstart"
name = "cameras"
duration = 0.5
seeds = 3
variants = ["full", "fast"]
rendering.renderer = "rays"

[sweep]
cameras.count = [2, 3, 4]
"""


def main() -> None:
    """Run a study of three settings and print a table."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "cameras.toml"
        file.write_text(STUDY)
        results = run_study(load_study(file), out=Path(folder) / "results", workers=2)
        mean = results.trials.group_by("cameras.count", "variant").agg(pl.col("pcp").mean().round(1))
        print(mean.sort("cameras.count", "variant"))


if __name__ == "__main__":
    main()
