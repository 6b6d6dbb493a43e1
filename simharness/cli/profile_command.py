"""``simharness profile-network``: how a network errs, and a profile with which simulation errs alike."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, write_json, write_text
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import plain_table, say
from simharness.cli.program import PROGRAM, Overrides, Workers, made_here

if TYPE_CHECKING:
    from simharness.reality.network_profile.profile_check import ProfileCheck
    from simharness.scenario.load import Study

_DESIGNED, _OTHER = "profile", "profile_check"
_RIVALS = ("typical", "topdown", "posefix")
_TOML = b"# Made by: simharness profile-network"


@grouped()
def profile_network(
    name: Annotated[
        str,
        typer.Argument(
            help="A network that finds people: a name of [cyan]mvpose networks list[/], or an ONNX file.",
            metavar="NETWORK",
        ),
    ],
    head: str | None = option(None, "Pose head that reads the joints in the boxes of NETWORK.", metavar="NETWORK"),
    check: bool = option(
        False, "Also compare the profile with the network on 80 other scenes, 2,000 pictures.", "--check"
    ),
    quick: bool = option(False, "Half of the scenes, and a fifth of those of --check, for a first look.", "--quick"),
    scenes: Path = option(Path(_DESIGNED), "Scenes to which the profile is fitted.", metavar="SCENARIO"),
    other_scenes: Path = option(Path(_OTHER), "Scenes of [cyan]--check[/].", metavar="SCENARIO"),
    overrides: Overrides = None,
    out: Path | None = option(
        None,
        "Folder of NAME.toml, profile.html and profile.json. [dim]\\[default: results/profiles/NAME][/]",
        metavar="FOLDER",
        file_okay=False,
    ),
    store: Path | None = option(
        None,
        "Folder of what the network found, which is not read again. [dim]\\[default: store, in --out][/]",
        metavar="FOLDER",
        file_okay=False,
    ),
    workers: Workers = 1,
) -> None:
    """Measure how a network errs in rendered pictures, and write a detector profile that errs alike.

    The designed scenes show people near and far, hidden, cut, in the dark, in
    crowds; their truth is exact. Use the profile in any scenario, without
    pictures: detector.profile = "NAME.toml".
    """
    with PROGRAM.exit_on_error():
        start = perf_counter()
        if not check and other_scenes != Path(_OTHER):
            raise ValueError("--other-scenes: these are the scenes of --check: add --check, or leave them out")
        stem = Path(name).stem
        place = out or Path("results/profiles") / stem
        check_place(place / "profile.html", option="--out", mark=HTML)
        check_place(place / "profile.json", option="--out", mark=PROVENANCE)
        check_place(place / f"{stem}.toml", option="--out", mark=_TOML)
        from simharness.outputs.network_profile.page import render_profile
        from simharness.reality.network_profile.profile_check import check_profile
        from simharness.reality.network_profile.profile_fit import SIMULATIONS, fit_network
        from simharness.reality.network_profile.profiled_scenes import read_scenes
        from simharness.scenario.load import load
        from simharness.study.trial_store import Store
        from simharness.trial.stages.networks import people_finder

        designed, other = _studies((scenes, other_scenes) if check else (scenes,), name, head, overrides, quick)
        kept = store or place / "store"
        if kept.is_dir():
            Store(kept)  # refuses a folder of something else before any scene is built
        people_finder(designed.base)
        where: dict[str, Any] = {"store": kept, "workers": workers}
        with reporter() as bars:
            with bars.stage("read pictures", designed.trials) as advance:
                read = read_scenes(designed, **where, progress=advance)
            with failing(), bars.stage("fit", SIMULATIONS) as advance:
                profile = fit_network(read, name=stem, command=f"simharness profile-network {stem}", progress=advance)
            write_text(profile.text, place / f"{stem}.toml")
            checked = None
            if other is not None:
                with bars.stage("read other pictures", other.trials) as advance:
                    fresh = read_scenes(other, **where, progress=advance)
                rivals = {
                    rival: load("quickstart", overrides=[f'detector.profile="{rival}"']).detector for rival in _RIVALS
                }
                with failing(), bars.stage("check", len(fresh)) as advance:
                    checked = check_profile(
                        fresh,
                        {stem: profile.detector, **rivals},
                        kind=profile.kind,
                        bias=profile.bias,
                        workers=workers,
                        progress=advance,
                    )
        seeds = [*designed.seeds, *(other.seeds if other is not None else ())]
        made = made_here(start, seeds=seeds, variants=other.variants if other is not None else ())
        measured = {"measured": profile.measured.summary(), "bias": profile.bias.tolist()}
        write_json(
            {**made, **measured, "check": None if checked is None else checked.summary()}, place / "profile.json"
        )
        write_text(render_profile(profile, checked, provenance=made), place / "profile.html")
    if checked is not None:
        _print_check(checked, Console())
    say(f"profile: {place / f'{stem}.toml'}\nreport: {place / 'profile.html'}")


def _studies(
    files: Sequence[Path], name: str, head: str | None, overrides: list[str] | None, quick: bool
) -> "tuple[Study, Study | None]":
    """Return the scenes of a fit, and those of its check where there are any."""
    studies = [_study(file, name, head, overrides, seeds=None) for file in files]
    if quick:
        whole = [each.trials for each in studies]
        studies = [_study(file, name, head, overrides, seeds=count) for count, file in enumerate(files, start=1)]
        if whole == [each.trials for each in studies]:
            note("--quick has no effect: the scenes have so few seeds anyway")
    return studies[0], studies[1] if len(studies) > 1 else None


def _study(scenes: Path, name: str, head: str | None, overrides: list[str] | None, *, seeds: int | None) -> "Study":
    """Return a study whose pictures are read by the network."""
    from simharness.scenario.load import load_study

    def network(given: str) -> str:
        return str(Path(given).resolve()).replace("\\", "/") if given.endswith(".onnx") else given

    keys = [f'detector.network="{network(name)}"', *([f'detector.onnx="{network(head)}"'] if head else [])]
    return load_study(scenes, overrides=[*keys, *(overrides or ())], seeds=seeds)


def _print_check(check: "ProfileCheck", console: Console) -> None:
    """Print PCP of each variant with the network, and the differences of the simulated detectors from it."""
    from simharness.reality.validation.verdicts import VerdictState

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
