"""Programs with commands: their options, exit codes, and messages of errors.

Exit codes: 0 success, 1 a regression or a fault was found, 2 bad input, 3 the run itself failed, 130 interrupted.
"""

import contextlib
import errno
import os
import shlex
import sys
import traceback
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass

import typer
from rich.console import Console
from rich.text import Text

from mvpose.commands.errors import MethodError, RunError
from mvpose.files.message_text import one_line

FOUND = 1
"""Exit code: a regression, a fault, or a prediction that does not hold was found."""

BAD_INPUT = 2
"""Exit code: the input is wrong; the message says how to mend it."""

FAILED = 3
"""Exit code: the run itself failed, on good input."""

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


@dataclass(frozen=True)
class Program:
    """Program with commands."""

    name: str
    """Name on the command line."""
    summary: str
    """What it is for, one line."""
    version: Callable[[], str]
    """Function that returns the version; "" for none."""
    tracebacks: bool = False
    """Whether failures print their tracebacks, but for those of users' methods. Where the environment variable
    ``NAME_TRACEBACK`` is set, all errors do, those of bad input as well."""
    left: str = ""
    """What a failure of most commands leaves on disk, for its message."""

    def app(self) -> typer.Typer:
        """Return the application, without commands."""
        app = typer.Typer(
            name=self.name,
            help=self.summary,
            no_args_is_help=True,
            add_completion=False,
            rich_markup_mode="rich",
            pretty_exceptions_enable=False,
            context_settings={"help_option_names": ["-h", "--help"]},
        )

        def show_version(wanted: bool) -> None:
            if wanted:
                if version := self.version():
                    typer.echo(f"{self.name} {version}")
                raise typer.Exit

        @app.callback(help=self.summary)
        def options(
            version: bool = typer.Option(
                False, "--version", callback=show_version, is_eager=True, help="Show the version and exit."
            ),
        ) -> None:
            """Take the options of the program itself."""

        return app

    def command_line(self) -> str:
        """Return the command line of this process, for reproduction."""
        return shlex.join([self.name, *sys.argv[1:]])

    @contextlib.contextmanager
    def exit_on_error(self, *, left: str | None = None) -> Iterator[None]:
        """Exit with one line on stderr and an exit code on an error.

        A ValueError is bad input; a failure of code that works on input that was found good is a
        :class:`~mvpose.commands.errors.RunError`, whose message says what failed.

        Args:
            left: what a failure of this command leaves on disk; None: as that of most commands.
        """
        try:
            yield
        except (typer.Exit, typer.Abort):
            raise
        except KeyboardInterrupt as interruption:
            typer.echo(str(interruption) or "interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except ValueError as error:
            self._end("error", str(error), BAD_INPUT)
        except OSError as error:
            if error.errno == errno.ENAMETOOLONG:
                place = f"{str(error.filename)[:60]}…"
                self._end("error", f"{place}: this path is too long for the file system", BAD_INPUT)
            place = f"{error.filename}: " if error.filename else ""
            self._end("failed", f"{place}{error.strerror or error}", FAILED, self.left if left is None else left)
        except Exception as error:
            kind = "" if isinstance(error, RunError) else f"{type(error).__name__}: "
            self._end("failed", f"{kind}{error}", FAILED, self.left if left is None else left)

    def _end(self, kind: str, message: str, code: int, left: str = "") -> None:
        internal = self.tracebacks and code == FAILED and not isinstance(sys.exception(), MethodError)
        if internal or os.environ.get(f"{self.name.upper()}_TRACEBACK"):
            traceback.print_exc()
        shown = Text.assemble((f"{kind}: ", "bold red"), one_line(message), f"; {left}" if left else "")
        Console(stderr=True).print(shown, soft_wrap=True)
        raise typer.Exit(code) from None


_WARNINGS: ContextVar[list[str] | None] = ContextVar("warnings", default=None)


def note(text: str, *, usual: bool = False) -> None:
    """Print a remark about the input, one line on stderr.

    Args:
        text: the remark.
        usual: whether it says what was decided or done, and is no warning.
    """
    typer.echo(f"note: {one_line(text)}", err=True)
    if not usual and (warnings := _WARNINGS.get()) is not None:
        warnings.append(one_line(text))


@contextlib.contextmanager
def warnings_of() -> Iterator[list[str]]:
    """Give a list of the warnings of a block, which are printed as well."""
    found: list[str] = []
    token = _WARNINGS.set(found)
    try:
        yield found
    finally:
        _WARNINGS.reset(token)
