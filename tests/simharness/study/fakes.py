"""Studies with made-up trials, which fail or kill their process where a test requests it.

Tests that kill a study run this module as a program.
"""

import json
import os
import secrets
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from simharness.scenario.load import Study, load_study
from simharness.scoring.catalogue import SCORES
from simharness.study.stored_trial import TrialOutput
from simharness.trial.variant_result import VariantResult

ALWAYS = 99
PATIENCE = 120.0  # seconds that a call waits for other calls, or to be killed by them
FOR_EVER = 600.0  # seconds; finite, in case the test that started the process is gone


@dataclass(frozen=True)
class Fake:
    """Replacement of ``measure`` that writes a file for each call, so that calls are counted across processes.

    Attributes:
        calls: folder of these files.
        harm: failure at a seed, and how often: "raise", "refuse" (an error of the scenario), "kill".
        seconds: duration of each call.
        large: seed from which tables have a megabyte.
        stuck: seed from which calls never end.
        together: number of calls that must have begun before one kills its process. The first call of every other seed
            waits to be killed.
    """

    calls: Path
    harm: Mapping[int, tuple[str, int]] = field(default_factory=dict)
    seconds: float = 0.0
    large: int = ALWAYS
    stuck: int = ALWAYS
    together: int = 0

    def __call__(self, scenario, variants, stored=None):
        self._record(f"{scenario.seed} {scenario.cameras.count} {'+'.join(variants)}")
        what, times = self.harm.get(scenario.seed, ("", 0))
        begun = sum(each.startswith(f"{scenario.seed} ") for each in called(self.calls))
        if begun <= times:
            if what == "kill":
                end = time.monotonic() + PATIENCE
                while len(called(self.calls)) < self.together and time.monotonic() < end:
                    time.sleep(0.02)
                os.kill(os.getpid(), signal.SIGKILL)
            raise ValueError("no room") if what == "refuse" else ZeroDivisionError("by zero")
        if scenario.seed >= self.stuck:
            time.sleep(FOR_EVER)
        time.sleep(PATIENCE if self.together and begun == 1 else self.seconds)
        rows = 3 if scenario.seed < self.large else 130_000
        return TrialOutput({variant: made_up(scenario, variant, rows=rows) for variant in variants})

    def _record(self, call):
        """Write the file of a call by renaming, because other processes read the folder."""
        self.calls.mkdir(exist_ok=True)
        name = f"{time.time_ns()} {secrets.token_hex(4)}"
        written = self.calls.with_name(f"{self.calls.name}, {name}")
        written.write_text(call)
        written.replace(self.calls / name)


def made_up(scenario, variant, *, rows=3):
    """Return a known result, different for every trial and variant."""
    number = 1000.0 * scenario.seed + scenario.cameras.count + len(variant) / 100
    frames = pl.DataFrame({"frame": np.arange(rows), "noise": np.random.default_rng(int(number)).random(rows)})
    people = pl.DataFrame({"frame": [0], "person": [0], "error_mm": [number]})
    failures = pl.DataFrame({"frame": [0], "kind": ["ghost"], "joints": [["nose"]]})
    return VariantResult({key: number + place for place, key in enumerate(SCORES)}, frames, people, failures)


def called(folder: Path) -> list[str]:
    """Return the calls so far, "SEED CAMERAS VARIANTS", in their order."""
    return [file.read_text() for file in sorted(folder.iterdir())] if folder.is_dir() else []


def times(folder: Path) -> Counter:
    """Return the number of calls of each seed."""
    return Counter(int(call.split()[0]) for call in called(folder))


def study_of(folder: Path, *, cameras=(3,), seeds=2, variants=("full", "fast"), name="views", more="") -> Study:
    """Return a study with a sweep of the number of cameras."""
    path = folder / "fake.toml"
    swept = f"[sweep]\ncameras.count = {list(cameras)}\n" if len(cameras) > 1 else ""
    count = f"[cameras]\ncount = {cameras[0]}\n"
    path.write_text(
        f'name = "{name}"\nseeds = {seeds}\nvariants = {json.dumps(list(variants))}\n{more}\n{count}{swept}'
    )
    return load_study(path)


def program(folder: Path, **options) -> list[str]:
    """Return the command that runs a study of 2 x 3 trials in a separate process, with options of :func:`main`."""
    text = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import fakes; fakes.main()"
    return [sys.executable, "-c", text, json.dumps({"folder": str(folder), **options})]


def run_program(folder: Path, **options) -> subprocess.CompletedProcess:
    """Run the program to its end."""
    return subprocess.run(program(folder, **options), capture_output=True, text=True, timeout=300, check=False)


def main():
    """Run ``simharness study`` with made-up trials."""
    from simharness.cli import study_command
    from simharness.study import study_run

    options = json.loads(sys.argv[1])
    folder = Path(options["folder"])
    harm = {int(seed): tuple(what) for seed, what in options.get("harm", {}).items()}
    fake = Fake(
        folder / "calls", harm, **{key: options[key] for key in ("seconds", "large", "stuck") if key in options}
    )
    study_of(folder, cameras=(3, 4), seeds=3)
    run_study = study_run.run_study
    study_run.run_study = lambda *args, **given: run_study(*args, measure=fake, **given)
    study_command._report = lambda results: None
    if limit := options.get("file_size"):
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    sys.argv = ["simharness", "study", str(folder / "fake.toml"), "--out", str(folder / "out")]
    sys.argv += ["--workers", str(options.get("workers", 1))]
    from simharness.cli import main as simharness

    simharness()
