"""``simharness profile-network``: how a network errs, and a profile with which simulation errs alike."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, write_json, write_text
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import say
from simharness.cli.program import PROGRAM, Overrides, Workers, made_here

_DESIGNED = "profile"
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
    quick: bool = option(False, "Half of the scenes, for a first look.", "--quick"),
    scenes: Path = option(Path(_DESIGNED), "Scenes to which the profile is fitted.", metavar="SCENARIO"),
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
        stem = Path(name).stem
        place = out or Path("results/profiles") / stem
        check_place(place / "profile.html", option="--out", mark=HTML)
        check_place(place / "profile.json", option="--out", mark=PROVENANCE)
        check_place(place / f"{stem}.toml", option="--out", mark=_TOML)
        from simharness.outputs.network_profile.page import render_profile
        from simharness.reality.network_profile.profile_fit import SIMULATIONS, fit_network
        from simharness.reality.network_profile.profiled_scenes import network_study, read_scenes
        from simharness.study.trial_store import Store
        from simharness.trial.stages.networks import people_finder

        designed = network_study(scenes, name, head=head, overrides=overrides or ())
        if quick:
            half = network_study(scenes, name, head=head, overrides=overrides or (), seeds=1)
            if half.trials == designed.trials:
                note("--quick has no effect: the scenes have so few seeds anyway")
            designed = half
        kept = store or place / "store"
        if kept.is_dir():
            Store(kept)  # refuses a folder of something else before any scene is built
        people_finder(designed.base)
        with reporter() as bars:
            with bars.stage("read pictures", designed.trials) as advance:
                read = read_scenes(designed, store=kept, workers=workers, progress=advance)
            with failing(), bars.stage("fit", SIMULATIONS) as advance:
                profile = fit_network(read, name=stem, command=f"simharness profile-network {stem}", progress=advance)
            write_text(profile.text, place / f"{stem}.toml")
        made = made_here(start, seeds=designed.seeds, variants=())
        measured = {"measured": profile.measured.summary(), "bias": profile.bias.tolist()}
        write_json({**made, **measured}, place / "profile.json")
        write_text(render_profile(profile, provenance=made), place / "profile.html")
    say(f"profile: {place / f'{stem}.toml'}\nreport: {place / 'profile.html'}")
