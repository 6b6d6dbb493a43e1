"""What a person sees while a study runs: one bar on a terminal, a line now and then elsewhere; all on stderr."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

_EVERY = 10.0  # seconds between lines where there is no terminal


class Watch(Protocol):
    """Anything that is told of the trials of a study."""

    def begin(self, trials: int, kept: int) -> None:
        """A study of so many trials begins, and so many of them were finished before."""
        ...

    def advance(self, failed: bool) -> None:
        """One more is finished, or has failed."""
        ...


class Quiet:
    """Says nothing."""

    def begin(self, trials: int, kept: int) -> None:
        """Begin, unseen."""

    def advance(self, failed: bool) -> None:
        """Go on, unseen."""


class Pace:
    """How fast trials go, counted from the first that was not finished before."""

    def __init__(self) -> None:
        self.trials = self.done = self.failed = self._fresh = 0
        self._start = time.monotonic()

    def begin(self, trials: int, kept: int) -> None:
        """Start the clock."""
        self.trials, self.done, self._start = trials, kept, time.monotonic()

    def advance(self, failed: bool) -> None:
        """One more."""
        self.done += 1
        self._fresh += 1
        self.failed += failed

    def __str__(self) -> str:
        if not self._fresh:
            return ""
        rate = self._fresh / max(time.monotonic() - self._start, 1e-3)
        said = f"{rate:.1f}/s" if rate >= 1 else f"{60 * rate:.1f}/min"
        if self.done < self.trials:
            said += f", {_duration((self.trials - self.done) / rate)} left"
        return f"{said}, {self.failed} failed" if self.failed else said


class _Bar:
    """A bar with rate, remaining time and failures."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._pace = progress, Pace()
        self._task = progress.add_task("trials", total=None, pace="")

    def begin(self, trials: int, kept: int) -> None:
        self._pace.begin(trials, kept)
        self._progress.update(self._task, total=trials, completed=kept)

    def advance(self, failed: bool) -> None:
        self._pace.advance(failed)
        self._progress.update(self._task, advance=1, pace=str(self._pace))


class _Lines:
    """A line now and then."""

    def __init__(self, console: Console) -> None:
        self._console, self._pace, self._last = console, Pace(), time.monotonic()

    def begin(self, trials: int, kept: int) -> None:
        self._pace.begin(trials, kept)

    def advance(self, failed: bool) -> None:
        self._pace.advance(failed)
        now = time.monotonic()
        if now - self._last >= _EVERY:
            self._last = now
            self._console.print(f"{self._pace.done} of {self._pace.trials} trials, {self._pace}", highlight=False)


@contextlib.contextmanager
def watching() -> Iterator[Watch]:
    """A bar on stderr where that is a terminal, else a line every ten seconds."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _Lines(console)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=36),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[pace]}"),
    )
    with Progress(*columns, console=console) as progress:
        yield _Bar(progress)


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
