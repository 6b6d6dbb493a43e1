"""Stages of a run, with their times, progress and names in errors."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

from simharness.runtime.errors import RunError
from simharness.runtime.progress import Advance, Reporter


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
