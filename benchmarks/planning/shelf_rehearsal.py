"""PCP of every subset of Shelf's five cameras by the simulation of a rehearsal, beside that of the real detections.

    python -m benchmarks.planning.shelf_rehearsal FOLDER [--scenes 24] [--detector typical]

FOLDER holds the files of Shelf that ``scenarios/recordings/shelf.toml`` names. The rehearsal knows the calibration, a
detector profile, that four people are there, and the part of the floor where somebody is annotated; it sees neither
detections nor paths. Nothing is fitted to the subsets. PCP is that of ``full``, with missing joints of the head filled
from the others.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.planning.shelf_subsets import SubsetFigures, annotated_people, real_pcp
from mvpose import Rig
from mvpose.commands.progress import reporter
from simharness.planning import Volume
from simharness.planning.rehearsal_scene import ACTIVITIES, RehearsalSetup, SceneSettings
from simharness.planning.simulated_scenes import Condition, SceneBatch, interval_of, simulate_scenes
from simharness.reality.recording_file import read_recording
from simharness.reality.validation.variant_comparison import FILLED, camera_subsets
from simharness.scenario.presets import read_profile

_PEOPLE = 4  # on Shelf


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--detector", default="openpose-shelf")
    parser.add_argument("--activity", action="append", help="activities in turn; default: those of a rehearsal")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    recording = read_recording("shelf", arguments.folder)
    people = annotated_people(recording)
    settings = SceneSettings(
        Rig(people.cameras),
        RehearsalSetup(Volume.around(people.joints), read_profile(arguments.detector), _PEOPLE),
        activities=tuple(arguments.activity or ACTIVITIES),
        head=FILLED,
    )
    subsets = camera_subsets(len(people.cameras))
    batch = SceneBatch(
        settings,
        tuple(Condition(each) for each in subsets),
        tuple(range(arguments.seed, arguments.seed + arguments.scenes)),
    )
    with reporter() as bars, bars.stage("simulate", arguments.scenes) as advance:
        (results,) = simulate_scenes([batch], workers=arguments.workers, progress=advance)
    predicted = {each: interval_of(results, Condition(each), "pcp").mean for each in subsets}
    print(SubsetFigures(real_pcp(recording), predicted))


if __name__ == "__main__":
    main()
