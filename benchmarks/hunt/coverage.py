"""``python -m benchmarks.hunt.coverage SOURCE...``: circumstances of the people of trials, and untested ones.

Sources are suites and studies (scenario files or shipped names), and result folders of hunts. Trials that are not in
the store are run.
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from benchmarks.hunt.coverage_bins import (
    bin_text,
    bins,
    coverage,
    found_alike,
    hunt_sightings,
    recording_sightings,
    study_sightings,
)
from mvpose import preset
from mvpose.commands.output_files import write_text
from mvpose.commands.progress import reporter
from mvpose.report.documents import fill_template
from simharness.hunt.hunt_run import TRIALS
from simharness.reality.recording_file import read_recording
from simharness.runtime.version import code_version
from simharness.scenario.load import load_study


def write_coverage_page(
    file: Path, sources: Sequence[str], tested: pl.DataFrame, strength: int, recording: tuple[str, pl.DataFrame] | None
) -> None:
    """Write the page of what trials have covered.

    Args:
        file: the page.
        sources: names of suites, studies and hunts.
        tested: people of their trials by bins.
        strength: number of bins of a combination.
        recording: name and people of a recording, if there is one.

    Raises:
        ValueError: the page cannot be written.
    """
    combined = coverage(tested, strength)
    name, own = recording or ("", tested.clear())
    lies = {each: people / max(len(own), 1) for each, (_, people, _) in coverage(own, strength).items()}
    page = fill_template(
        "coverage.html",
        folder=Path(__file__).parent,
        program="simharness",
        code=code_version(),
        name="coverage",
        sources=sources,
        trials=tested["trial"].n_unique(),
        people=len(tested),
        strength=strength,
        recording=name,
        alike=found_alike(tested, own),
        bins=bins(),
        text=bin_text,
        single=coverage(tested, 1),
        shares={each: people / max(len(own), 1) for (each,), (_, people, _) in coverage(own, 1).items()},
        pairs=coverage(tested, 2),
        combinations=len(combined),
        untested=[each for each, (trials, *_) in combined.items() if not trials],
        new=sorted(((-lies[each], each) for each, (trials, *_) in combined.items() if lies[each] and not trials)),
    )
    write_text(page, file, option="--out")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hunt.coverage", description=__doc__)
    parser.add_argument("sources", nargs="+", type=Path, help="suites, studies, and result folders of hunts")
    parser.add_argument(
        "--recording", help="recording to find in the bins, as of simharness evaluate; without its truth"
    )
    parser.add_argument("--files", type=Path, help="folder with the files of the recording")
    parser.add_argument("--strength", type=int, default=2, choices=(1, 2, 3), help="bins of a combination (default: 2)")
    parser.add_argument("--seeds", type=int, help="number of seeds, instead of those of the files")
    parser.add_argument("--variant", default="full", help="variant that is scored (default: full)")
    parser.add_argument("--store", type=Path, default=Path("results/studies/store"), help="finished trials")
    parser.add_argument("--out", type=Path, default=Path("results/coverage.html"), help="the page")
    options = parser.parse_args(arguments)
    tables, recording = [], None
    with reporter() as bars:
        for each in options.sources:
            if each.is_dir():
                tables.append(hunt_sightings(each / TRIALS))
            else:
                study = load_study(each, seeds=options.seeds, variants=[options.variant])
                tables.append(study_sightings(study, options.store, workers=1, reporter=bars))
    tested = pl.concat(tables)
    if options.recording:
        data, estimator = read_recording(options.recording, options.files), preset(options.variant)
        answers = [estimator.estimate(data.rig, each) for each in data.detections]
        recording = data.name, recording_sightings(data.rig, data.detections, answers)
    names = [each.stem for each in options.sources]
    write_coverage_page(options.out, names, tested, options.strength, recording)
    print(table(tested))
    combined = coverage(tested, options.strength).values()
    found = sum(trials > 0 for trials, *_ in combined)
    print(f"\n{found} of {len(combined)} combinations of {options.strength} bins were tested")
    if recording:
        share, pcp = found_alike(tested, recording[1])
        print(
            f"{recording[0]}: {100 * share:.0f} % of its people are in bins of people of trials, whose PCP is {pcp:.1f}"
        )


def table(tested: pl.DataFrame) -> str:
    """Return single bins as a Markdown table."""
    lines = ["| bin | trials | people | PCP |", "|:--|--:|--:|--:|"]
    for (each,), (trials, people, pcp) in coverage(tested, 1).items():
        lines.append(f"| {bin_text(each)} | {trials} | {people} | {'–' if math.isnan(pcp) else f'{pcp:.1f}'} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
