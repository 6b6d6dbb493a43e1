"""What a person sees while a run works: a bar for each stage, on stderr, where that is a terminal."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)

Advance = Callable[[int], None]


class Reporter(Protocol):
    """Anything that is told of the stages of a run."""

    def stage(self, name: str, total: int) -> contextlib.AbstractContextManager[Advance]:
        """A stage of ``total`` steps begins; the context gives a function to say how many more are done."""
        ...


class Silence:
    """Says nothing."""

    @contextlib.contextmanager
    def stage(self, name: str, total: int) -> Iterator[Advance]:
        """Begin a stage, unseen."""
        yield lambda steps: None


class Bars:
    """A bar for each stage; use it as a context manager."""

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            SpinnerColumn(finished_text="[green]✓[/]"),
            TextColumn("{task.description:<9}"),
            BarColumn(bar_width=36),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
        )

    def __enter__(self) -> Bars:
        self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._progress.stop()

    @contextlib.contextmanager
    def stage(self, name: str, total: int) -> Iterator[Advance]:
        """Begin a stage with a bar of its own."""
        task = self._progress.add_task(name, total=total)
        yield lambda steps: self._progress.advance(task, steps)
        self._progress.update(task, completed=total)


@contextlib.contextmanager
def reporter() -> Iterator[Reporter]:
    """Bars on stderr where that is a terminal, else silence."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Silence()
        return
    with Bars(console) as bars:
        yield bars
