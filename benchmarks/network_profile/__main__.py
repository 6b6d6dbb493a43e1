"""A profile beside its network on new scenes: ``python -m benchmarks.network_profile NETWORK FOLDER``.

Fits the profile of a network as ``tools.network_profile`` does, then runs the method on what the network finds in the
pictures of ``scenarios/profile_check.toml``, and on what simulated detectors find in the same scenes: with the
fitted profile, and with shipped ones. Prints PCP by variant and the counts of verdicts, and writes all figures to
``FOLDER/check.json``. Half an hour on two cores; detections are kept in ``FOLDER/store``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.network_profile.profile_check import ProfileCheck, check_profile
from mvpose.commands.output_files import write_json
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import plain_table
from simharness.reality.validation.verdicts import VerdictState
from simharness.scenario.load import load
from tools.network_profile.profile_fit import SIMULATIONS, fit_network
from tools.network_profile.profiled_scenes import network_study, read_scenes

_RIVALS = ("typical", "topdown", "posefix")


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit, compare, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.network_profile", description=__doc__)
    parser.add_argument("network", help="name of a network of `mvpose networks list`, or an ONNX file")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--head", help="pose head that reads the joints in the network's boxes")
    parser.add_argument("--scenes", type=Path, default=Path("profile"), help="scenes to which the profile is fitted")
    parser.add_argument("--other-scenes", type=Path, default=Path("profile_check"), help="scenes of the comparison")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a value of all scenes")
    parser.add_argument("--seeds", type=int, help="seeds of the scenes of the comparison; default: all")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(arguments)
    given = {"head": options.head, "overrides": options.set}
    designed = network_study(options.scenes, options.network, **given)
    other = network_study(options.other_scenes, options.network, **given, seeds=options.seeds)
    store, name = options.folder / "store", Path(options.network).stem
    with reporter() as bars:
        with bars.stage("read pictures", designed.trials) as advance:
            read = read_scenes(designed, store=store, workers=options.workers, progress=advance)
        with bars.stage("fit", SIMULATIONS) as advance:
            profile = fit_network(read, name=name, progress=advance)
        with bars.stage("read other pictures", other.trials) as advance:
            fresh = read_scenes(other, store=store, workers=options.workers, progress=advance)
        detectors = {rival: load("quickstart", overrides=[f'detector.profile="{rival}"']).detector for rival in _RIVALS}
        with bars.stage("check", len(fresh)) as advance:
            check = check_profile(
                fresh,
                {name: profile.detector, **detectors},
                kind=profile.kind,
                bias=profile.bias,
                workers=options.workers,
                progress=advance,
            )
    write_json(check.summary(), options.folder / "check.json")
    _print(check, Console())
    return 0


def _print(check: ProfileCheck, console: Console) -> None:
    """Print PCP of each variant with the network, and the differences of the simulated detectors from it."""
    title = f"PCP on {len(check.scenes)} other scenes, and differences of simulated detectors from it"
    table = plain_table(title, ("variant",), ("network", *check.detectors), pad_edge=False)
    for variant in check.variants:
        figures = [check.score(name, variant, "pcp") for name in check.detectors]
        differences = [each.difference for each in figures]
        ends = [
            f"{each.mean:+.1f}" + (f"\n{each.low:+.1f} to {each.high:+.1f}" if each.n > 1 else "")
            for each in differences
        ]
        table.add_row(variant, f"{figures[0].network:.1f}", *ends)
    console.print(table, highlight=False, markup=False)
    for group, verdicts in check.verdicts.items():
        counts = ", ".join(f"{verdicts.count(each)} {each}" for each in VerdictState)
        console.print(f"{group}: {counts}", highlight=False)


if __name__ == "__main__":
    sys.exit(main())
