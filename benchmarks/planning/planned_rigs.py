"""Planned rigs beside usual ones and those of another program: ``python -m benchmarks.planning.planned_rigs``."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.method.report import table
from benchmarks.planning.peer import PROGRAM, peer_rig
from benchmarks.planning.rooms import draw_room
from simharness.planning.candidates import Candidate
from simharness.planning.plan_rig import PlanEffort, plan_rig
from simharness.planning.rig_comparison import corner_rig, rig_of, ring_rig, simulate_rigs
from simharness.planning.search import Ledger
from simharness.planning.simulated_scenes import interval_of

RIGS = ("plan", "corners", "ring", "peer")
FIRST_SEED = 1000
_SIMULATION_SEED = 77  # of the scenes that judge, which no plan has seen


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan random rooms, simulate each rig on the same scenes, and print what each reaches."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.planned_rigs", description=main.__doc__)
    parser.add_argument("--rooms", type=int, default=20, metavar="N", help="number of rooms")
    parser.add_argument("--first", type=int, default=FIRST_SEED, metavar="SEED", help="seed of the first room")
    parser.add_argument("--scenes", type=int, default=8, metavar="N", help="simulated scenes of each room")
    parser.add_argument("--starts", type=int, default=3, metavar="N", help="greedy starts of each search")
    parser.add_argument("--candidates", type=int, default=600, metavar="N", help="cameras that a search chooses from")
    parser.add_argument("--peer", metavar="PROGRAM", help=f"path of {PROGRAM}; by default the installed one")
    parser.add_argument("--out", type=Path, metavar="FILE", help="JSON file of results; finished rooms are kept in it")
    options = parser.parse_args(arguments)
    program = options.peer or shutil.which(PROGRAM)
    if program is None:
        parser.error(f"{PROGRAM} is not installed: install the extra bench, or give --peer PROGRAM")
    ledger = Ledger(options.out, f"scenes {options.scenes} starts {options.starts} of {options.candidates}")
    rows = []
    for seed in range(options.first, options.first + options.rooms):
        row = ledger.result(str(seed), partial(_compare, seed, options, program))
        rows.append(row)
        print(_line(row), flush=True)
    print(summary(rows))
    return 0


def _compare(seed: int, options: argparse.Namespace, program: str) -> dict[str, Any]:
    """Return PCP and error of all rigs of a room, and the seconds of both searches."""
    room = draw_room(seed)
    count = room.keys.cameras.count
    assert count is not None
    start = time.perf_counter(), time.process_time()
    effort = PlanEffort(scenes=0, curve=(), starts=options.starts, candidates=options.candidates)
    planned = plan_rig(room, count, effort=effort, seed=seed)
    seconds = time.perf_counter() - start[0]
    begun = time.perf_counter()
    folder = Path.cwd() if options.out is None else options.out.parent
    theirs = peer_rig(room, count, program=program, folder=folder / "peer")
    others: dict[str, list[Candidate]] = {
        "corners": corner_rig(room, count), "ring": ring_rig(room, count), "peer": theirs,
    }  # fmt: skip
    peer_seconds = time.perf_counter() - begun
    rigs = [planned.rig, *(rig_of(room, others[name]) for name in RIGS[1:])]
    results, conditions = simulate_rigs(room, rigs, seeds=range(options.scenes), seed=_SIMULATION_SEED + seed)
    pcp = [float(interval_of(results, each, "pcp").mean) for each in conditions]
    error = [float(interval_of(results, each, "mpjpe_mm").mean) for each in conditions]
    return {
        "room": room.name,
        "cameras": count,
        "people": room.keys.people.count,
        "pcp": dict(zip(RIGS, pcp, strict=True)),
        "mpjpe_mm": dict(zip(RIGS, error, strict=True)),
        "predicted": planned.best.predicted.pcp.mean,
        "seconds": {"plan": seconds, "peer": peer_seconds, "plan_processor": time.process_time() - start[1]},
    }


def _line(row: dict[str, Any]) -> str:
    figures = "  ".join(f"{name} {row['pcp'][name]:5.1f} ({row['mpjpe_mm'][name]:3.0f} mm)" for name in RIGS)
    times = row["seconds"]
    return (
        f"{row['room']}: {row['cameras']} cameras, {row['people']} people: {figures}; "
        f"{times['plan']:.0f} s, peer {times['peer']:.0f} s"
    )


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of wins and gains over all rooms."""
    lines = [["rig", "PCP, mean", "error, mm", "plan is better in", "mean gain", "seconds, median"]]
    pcp = {name: np.array([row["pcp"][name] for row in rows]) for name in RIGS}
    for name in RIGS:
        seconds = [row["seconds"][name] for row in rows if name in row["seconds"]]
        wins = f"{int((pcp['plan'] > pcp[name]).sum())} of {len(rows)}" if name != "plan" else ""
        gain = f"{(pcp['plan'] - pcp[name]).mean():+.1f}" if name != "plan" else ""
        error = np.mean([row["mpjpe_mm"][name] for row in rows])
        lines.append(
            [
                name,
                f"{pcp[name].mean():.1f}",
                f"{error:.0f}",
                wins,
                gain,
                f"{np.median(seconds):.0f}" if seconds else "",
            ]
        )
    best = np.max([pcp[name] for name in RIGS[1:]], axis=0)
    low = best < 95.0
    gain = f"{(pcp['plan'] - best)[low].mean():+.1f} PCP" if low.any() else "none"
    return (
        table(lines, "<>>>>>")
        + f"\nover the best of the others, in the {int(low.sum())} rooms where it is below 95: {gain}\n"
    )


if __name__ == "__main__":
    sys.exit(main())
