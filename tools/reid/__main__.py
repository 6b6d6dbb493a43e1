"""The command line: ``python -m tools.reid --help``."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tools.reid.card import card_path
from tools.reid.evaluation import judge
from tools.reid.identities import RUNS
from tools.reid.plan import DIALS, Plan

_PROGRAM = "python -m tools.reid"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, export, judge and write the card; 2 where PyTorch or an argument is missing or cannot be."""
    options = _parser().parse_args(arguments)
    try:
        _check(options)
        if options.judge is not None:
            command = f"{_PROGRAM} --judge {options.judge.as_posix()}"
            judge(options.judge, cache=options.cache, workers=options.workers, command=command, say=_say())
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
        say=_say(),
    )
    return 0


def _say() -> Callable[[str], None]:
    """Prints lines with the seconds since now before them."""
    start = time.perf_counter()
    return lambda text: print(f"{time.perf_counter() - start:7.0f} s  {text}", flush=True)


def _check(options: argparse.Namespace) -> None:
    """Refuse at once what would fail after an hour, and make the folders that are written to.

    Raises:
        ValueError: with one line for the terminal.
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
        raise ValueError(f"--output must be an ONNX file, with its card beside it, got {options.output}")
    _make_folder("--output", options.output.parent)


def _make_folder(option: str, folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(f"{option}: cannot write to {folder}: {error.strerror or error}") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM,
        description="Train the person re-identification network on rendered people, and judge it on others.",
        epilog=f"The people are judged dressed at look_alike = {', '.join(f'{dial:g}' for dial in DIALS)}.",
    )
    parser.add_argument("--output", type=Path, default=Path("reid.onnx"), help="the ONNX file; its card goes beside it")
    parser.add_argument(
        "--judge",
        type=Path,
        metavar="FILE",
        help="do not train: judge this ONNX file again, on people rendered by the code as it is now, and write the "
        "figures into its card",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path(tempfile.gettempdir()) / "simharness-reid",
        help="folder of the rendered crops (about 1.2 GB), which are not rendered again by the same code "
        "(default: %(default)s)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of people, pictures and training")
    parser.add_argument("--workers", type=int, default=1, help="processes that render")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch, where there is no CUDA")
    parser.add_argument("--quick", action="store_true", help="a toy, in less than a minute")
    return parser


if __name__ == "__main__":
    sys.exit(main())
