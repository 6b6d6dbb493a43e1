"""``mvpose view``: the page of a folder of results."""

from pathlib import Path
from typing import Annotated

import typer

from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped, option

_PAGES = ("recording.html", "doctor.html")


@grouped()
def view(
    folder: Annotated[
        Path, typer.Argument(help="Folder that [cyan]mvpose[/] wrote: of estimate, run or doctor.", metavar="FOLDER")
    ],
    browser: bool = option(True, "Open the page in a browser.", "--browser/--no-browser"),
) -> None:
    """Open the page of a result in a browser, and print its path."""
    with PROGRAM.exit_on_error():
        page = next((folder / name for name in _PAGES if (folder / name).is_file()), None)
        if page is None:
            raise ValueError(f"{folder}: has no {_PAGES[0]}; expected a folder that `mvpose estimate ... --out` made")
        typer.echo(page)
        if browser:
            import webbrowser

            webbrowser.open(page.absolute().as_uri())
