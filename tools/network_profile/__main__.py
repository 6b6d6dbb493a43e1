"""Write the profile of a network: ``python -m tools.network_profile movenet``.

The network reads the pictures of designed scenes, which show people near and far, hidden, cut, in the dark and in
crowds, and whose truth is exact. Into ``results/profiles/NAME`` go ``NAME.toml``, a detector profile with which
simulation errs alike, ``profile.html``, how the network errs, and ``profile.json``. Use the profile in any scenario,
without pictures: ``detector.profile = "NAME.toml"``. Detections are kept: only new pictures are read again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from mvpose.commands.errors import RunError
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, write_json, write_text
from mvpose.commands.progress import reporter
from simharness.study.trial_store import Store
from simharness.trial.identity import provenance
from simharness.trial.stages.networks import people_finder
from tools.network_profile.page import render_profile
from tools.network_profile.profile_fit import SIMULATIONS, fit_network
from tools.network_profile.profiled_scenes import network_study, read_scenes

_TOML = b"# Made by: python -m tools.network_profile"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 2 for bad input and 1 for a network or a picture that fails."""
    parser = argparse.ArgumentParser(prog="python -m tools.network_profile", description=__doc__)
    parser.add_argument(
        "network", help="name of a network of `mvpose networks list` that finds people, or an ONNX file"
    )
    parser.add_argument("--head", metavar="NETWORK", help="pose head that reads the joints in the network's boxes")
    parser.add_argument("--scenes", type=Path, default=Path("profile"), metavar="SCENARIO", help="the designed scenes")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of all scenes")
    parser.add_argument("--seeds", type=int, metavar="N", help="seeds of each scene; default: those of the file")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="folder of the results")
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    options = parser.parse_args(arguments)
    name = Path(options.network).stem
    place = options.out or Path("results/profiles") / name
    try:
        start = perf_counter()
        check_place(place / "profile.html", option="--out", mark=HTML)
        check_place(place / "profile.json", option="--out", mark=PROVENANCE)
        check_place(place / f"{name}.toml", option="--out", mark=_TOML)
        study = network_study(
            options.scenes, options.network, head=options.head, overrides=options.set, seeds=options.seeds
        )
        people_finder(study.base)
        Store(place / "store")  # refuses a folder of something else before any scene is built
        with reporter() as bars:
            with bars.stage("read pictures", study.trials) as advance:
                read = read_scenes(study, store=place / "store", workers=options.workers, progress=advance)
            command = f"python -m tools.network_profile {options.network}"
            with bars.stage("fit", SIMULATIONS) as advance:
                profile = fit_network(read, name=name, command=command, progress=advance)
        made = provenance(command=command, seeds=study.seeds, variants=(), seconds=perf_counter() - start)
        write_text(profile.text, place / f"{name}.toml")
        measured = {"measured": profile.measured.summary(), "bias": profile.bias.tolist()}
        write_json({**made, **measured}, place / "profile.json")
        write_text(render_profile(profile, provenance=made), place / "profile.html")
    except (ValueError, RunError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if isinstance(error, ValueError) else 1
    print(f"profile: {place / f'{name}.toml'}\nreport: {place / 'profile.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
