"""List of kernels that a second process compiles for pictures: ``python -m tools.picture_kernels``.

The first run after an installation compiles the kernels of rendering while it films. Those from the shading of a
picture on, about half of them, it needs so late that a second process can compile them meanwhile
(:mod:`simharness.trial.kernel_compilation`); that one knows them, and the types of their arguments, from a file that
this tool writes. It films a frame of the quickstart. Run it when the arguments of these kernels have changed; an old
list costs time and changes no result.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from numba import types
from numba.core import event

from mvpose.kernels import KernelCache
from simharness.scenario.load import load
from simharness.trial import kernel_compilation
from simharness.trial.run_trial import run_trial

FILE = Path(kernel_compilation.__file__).parent / "data" / "picture_kernels.txt"
FIRST = "simharness.capture.rendering.lit_kernels.shade_lit"
LAST = "simharness.capture."  # kernels of these packages only


def main() -> None:
    """Film a frame and write the list."""
    with _needed_kernels() as needed:
        run_trial(load("quickstart", overrides=["duration=0.1"]), until="detect", previews=[0])
    places = [place for place, _ in needed]
    lines = [
        f"{place} ({', '.join(map(_text, arguments))},)\n"
        for place, arguments in needed[places.index(FIRST) :]
        if place.startswith(LAST) and all(map(_has_text, arguments))
    ]
    FILE.write_text("".join(lines), encoding="utf-8")
    print(f"{len(lines)} kernels in {FILE}")


@contextmanager
def _needed_kernels() -> Iterator[list[tuple[str, tuple[Any, ...]]]]:
    """Collect places and types of arguments of the kernels that Python calls, in the order of their first calls."""
    needed: list[tuple[str, tuple[Any, ...]]] = []
    load_overload, depth = KernelCache.load_overload, _Depth()

    def noted(cache: KernelCache, signature: Any, context: Any) -> Any:
        if not depth.value:  # not called by a kernel that is being compiled
            function = cache._kernel.py_func
            needed.append(
                (f"{function.__module__}.{function.__qualname__}", tuple(getattr(signature, "args", signature)))
            )
        return load_overload(cache, signature, context)

    with event.install_listener("numba:compile", depth), mock.patch.object(KernelCache, "load_overload", noted):
        yield needed


class _Depth(event.Listener):
    """Number of compilations that are under way."""

    value = 0

    def on_start(self, event: Any) -> None:
        self.value += 1

    def on_end(self, event: Any) -> None:
        self.value -= 1


def _has_text(kind: Any) -> bool:
    """Whether numba's notation of types can write a type: it has none for arrays that are not to be written."""
    return isinstance(kind, types.Number | types.Boolean) or (isinstance(kind, types.Array) and kind.mutable)


def _text(kind: Any) -> str:
    """Return a type in numba's notation: ``float32[:,::1]``."""
    if isinstance(kind, types.Array):
        axes = [":"] * kind.ndim
        if kind.layout in "CF":
            axes[-1 if kind.layout == "C" else 0] = "::1"
        return f"{_text(kind.dtype)}[{','.join(axes)}]"
    return "boolean" if isinstance(kind, types.Boolean) else str(kind)


if __name__ == "__main__":
    main()
