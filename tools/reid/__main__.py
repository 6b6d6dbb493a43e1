"""Command line: ``python -m tools.reid --help``."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tools.reid.card import card_path
from tools.reid.evaluation import evaluate_again
from tools.reid.identities import RUNS
from tools.reid.plan import LOOK_ALIKE, Plan

_PROGRAM = "python -m tools.reid"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, export, evaluate and write the card; return 2 for wrong arguments or without PyTorch."""
    options = _parser().parse_args(arguments)
    try:
        _check(options)
        if options.judge is not None:
            command = f"{_PROGRAM} --judge {options.judge.as_posix()}"
            evaluate_again(
                options.judge, cache=options.cache, workers=options.workers, command=command, log=_timed_log()
            )
            return 0
    except ValueError as error:
        print(f"{_PROGRAM}: {error}", file=sys.stderr)
        return 2
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as error:
        print(f"training needs PyTorch and onnx: pip install 'simharness[train]' ({error})", file=sys.stderr)
        return 2
    from tools.reid.run import run

    plan = Plan.quick(seed=options.seed) if options.quick else Plan(seed=options.seed)
    run(
        plan,
        options.output,
        cache=options.cache,
        workers=options.workers,
        threads=options.threads,
        command=" ".join([_PROGRAM, f"--seed {options.seed}", *(["--quick"] if options.quick else [])]),
        log=_timed_log(),
    )
    return 0


def _timed_log() -> Callable[[str], None]:
    """Return a function that prints a line with the seconds since this call."""
    start = time.perf_counter()
    return lambda text: print(f"{time.perf_counter() - start:7.0f} s  {text}", flush=True)


def _check(options: argparse.Namespace) -> None:
    """Check the arguments before any rendering, and make the output folders.

    Raises:
        ValueError: an argument is wrong; the message has one line.
    """
    if not 0 <= options.seed < RUNS:
        raise ValueError(f"--seed must be 0 to {RUNS - 1}, got {options.seed}")
    for key in ("workers", "threads"):
        if getattr(options, key) < 1:
            raise ValueError(f"--{key} must be at least 1, got {getattr(options, key)}")
    _make_folder("--cache", options.cache)
    if options.judge is not None:
        return
    if options.output.is_dir() or card_path(options.output) == options.output:
        raise ValueError(
            f"--output must be an ONNX file, because its card is a .json file beside it, got {options.output}"
        )
    _make_folder("--output", options.output.parent)


def _make_folder(option: str, folder: Path) -> None:
    """Make a folder and check that it is writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(f"{option}: cannot write to {folder}: {error.strerror or error}") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM,
        description="Train the person re-identification network on rendered people and evaluate it on held-out people.",
        epilog=f"The evaluation uses look_alike = {', '.join(f'{value:g}' for value in LOOK_ALIKE)}.",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("reid.onnx"),
        help="path of the ONNX file; its card is written beside it (default: %(default)s)",
    )
    parser.add_argument(
        "--judge",
        type=Path,
        metavar="FILE",
        help="do not train; evaluate this ONNX file again on people rendered by the present code, and update its card",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path(tempfile.gettempdir()) / "simharness-reid",
        help="folder of the rendered crops (about 1.8 GB), used again by the same code (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of people, pictures and training (default: %(default)s)"
    )
    parser.add_argument("--workers", type=int, default=1, help="number of rendering processes (default: %(default)s)")
    parser.add_argument(
        "--threads", type=int, default=1, help="number of threads of PyTorch without CUDA (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="train a minimal network as a test, in less than a minute")
    return parser


if __name__ == "__main__":
    sys.exit(main())
