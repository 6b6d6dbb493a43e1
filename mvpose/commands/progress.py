"""Progress of long commands on stderr: one protocol for the stages of a run, which are timed and named in errors, and
for the trials of a study.
"""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from mvpose.commands.errors import RunError

T = TypeVar("T")

_LINE_SECONDS = 10.0  # seconds between two lines where stderr is not a terminal
_UNSETTLED = 2  # first steps include compilation: a rate that counts them gives many times the remaining time
_TIMED_SECONDS = 2.0  # least duration that a rate is measured over: workers finish at nearly the same time


class Advance(Protocol):
    """Report finished steps of a stage."""

    def __call__(self, steps: int, /, *, failed: int = 0) -> None:
        """Report ``steps`` more steps, of which ``failed`` failed."""
        ...


class Reporter(Protocol):
    """Receiver of the progress of a command."""

    def stage(self, name: str, total: int, *, done: int = 0) -> contextlib.AbstractContextManager[Advance]:
        """Begin a stage of ``total`` steps, ``done`` of which were finished earlier; the context gives its advance."""
        ...


class Silence:
    """Reporter that prints nothing."""

    @contextlib.contextmanager
    def stage(self, name: str, total: int, *, done: int = 0) -> Iterator[Advance]:
        """Begin a stage without output."""
        yield _ignore


def counted(items: Iterable[T], advance: Callable[[int], object]) -> Iterator[T]:
    """Yield items, and report each as a finished step before the next one is taken."""
    for item in items:
        yield item
        advance(1)


class Stages:
    """Timer and reporter of stages. An error in a stage becomes a RunError with the name of the stage in front.

    Attributes:
        seconds: duration of each finished stage, by name.
    """

    def __init__(self, reporter: Reporter, seconds: dict[str, float] | None = None) -> None:
        self._reporter = reporter
        self.seconds: dict[str, float] = {} if seconds is None else seconds

    @contextlib.contextmanager
    def stage(self, name: str, total: int, *, input_errors: bool = False) -> Iterator[Advance]:
        """Run one stage.

        Args:
            name: name of the stage.
            total: number of steps of the stage.
            input_errors: let a ValueError pass unchanged, because the scenario is wrong.

        Raises:
            RunError: an error in the stage, with the name of the stage in front.
        """
        start = time.perf_counter()
        try:
            with self._reporter.stage(name, total) as advance:
                yield advance
        except ValueError as error:
            if input_errors:
                raise
            raise RunError(f"{name}: {type(error).__name__}: {error}") from error
        except RunError as error:
            raise type(error)(f"{name}: {error}") from error
        except Exception as error:
            raise RunError(f"{name}: {type(error).__name__}: {error}") from error
        self.seconds[name] = time.perf_counter() - start


class Pace:
    """Rate and remaining time of a stage.

    Steps that were finished in an earlier run do not count, nor do the first steps of this run, because they include
    imports and compilation.

    Args:
        total: steps of the stage.
        done: steps finished earlier.
        clock: time in seconds.
    """

    def __init__(self, total: int, done: int = 0, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.total, self.done, self.failed = total, done, 0
        self._clock = clock
        self._fresh = 0
        self._settled: tuple[int, float] | None = None  # fresh steps and time from which the rate is measured

    def advance(self, steps: int, *, failed: int = 0) -> None:
        """Count finished steps."""
        self.done += steps
        self.failed += failed
        self._fresh += steps
        if self._settled is None and self._fresh >= _UNSETTLED:
            self._settled = self._fresh, self._clock()

    @property
    def rate(self) -> float | None:
        """Steps a second; None until enough steps have been timed."""
        if self._settled is None:
            return None
        steps, since = self._fresh - self._settled[0], self._clock() - self._settled[1]
        return steps / since if steps > 0 and since >= _TIMED_SECONDS else None

    def __str__(self) -> str:
        parts = []
        rate = self.rate
        if rate is not None:
            parts.append(f"{rate:.1f}/s" if rate >= 1 else f"{60 * rate:.1f}/min")
            if self.done < self.total:
                parts.append(f"{duration((self.total - self.done) / rate)} left")
        if self.failed:
            parts.append(f"{self.failed} failed")
        return ", ".join(parts)


class Bars:
    """Reporter with a bar for each stage. Use it as a context manager."""

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            SpinnerColumn(finished_text="[green]✓[/]"),
            TextColumn("{task.description:<9}"),
            BarColumn(bar_width=36),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[pace]}"),
            console=console,
        )

    def __enter__(self) -> "Bars":
        self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._progress.stop()

    @contextlib.contextmanager
    def stage(self, name: str, total: int, *, done: int = 0) -> Iterator[Advance]:
        """Begin a stage with a new bar."""
        pace = Pace(total, done)
        task = self._progress.add_task(name, total=total, completed=done, pace="")

        def advance(steps: int, /, *, failed: int = 0) -> None:
            pace.advance(steps, failed=failed)
            self._progress.update(task, advance=steps, pace=str(pace))

        yield advance
        self._progress.update(task, completed=total, pace=f"{pace.failed} failed" if pace.failed else "")


class Lines:
    """Reporter that prints a line from time to time, for logs."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last = time.monotonic()

    @contextlib.contextmanager
    def stage(self, name: str, total: int, *, done: int = 0) -> Iterator[Advance]:
        """Begin a stage; it prints a line when the last line of this reporter is old enough."""
        pace = Pace(total, done)

        def advance(steps: int, /, *, failed: int = 0) -> None:
            pace.advance(steps, failed=failed)
            now = time.monotonic()
            if now - self._last >= _LINE_SECONDS:
                self._last = now
                text = ", ".join(filter(None, (f"{name}: {pace.done} of {pace.total}", str(pace))))
                self._console.print(text, highlight=False, markup=False, soft_wrap=True)

        yield advance


@contextlib.contextmanager
def reporter() -> Iterator[Reporter]:
    """Give a reporter for stderr: bars on a terminal, else a line every ten seconds."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Lines(console)
        return
    with Bars(console) as bars:
        yield bars


@contextlib.contextmanager
def single_stage(name: str, total: int, *, done: int = 0) -> Iterator[Advance]:
    """Report a command of one stage on stderr; one without steps is not shown."""
    shown = reporter() if total else contextlib.nullcontext(Silence())
    with shown as bars, bars.stage(name, total, done=done) as advance:
        yield advance


def duration(seconds: float) -> str:
    """Return a duration in words: "45 s", "12 min", "3.5 h"."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _ignore(steps: int, /, *, failed: int = 0) -> None:
    """Drop a progress report."""
