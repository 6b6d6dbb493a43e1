"""The command line: ``python -m simharness.train.reid --help``."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from simharness.train.reid.plan import DIALS, Plan


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, train, export, judge and write the card; 2 where PyTorch or an argument is missing."""
    options = _parser().parse_args(arguments)
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as error:
        print(f"training needs PyTorch and onnx: pip install 'simharness[train]' ({error})", file=sys.stderr)
        return 2
    from simharness.train.reid.run import run

    plan = Plan.quick(seed=options.seed) if options.quick else Plan(seed=options.seed)
    command = " ".join(
        ["python -m simharness.train.reid", f"--seed {options.seed}", *(["--quick"] if options.quick else [])]
    )
    start = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - start:7.0f} s  {text}", flush=True)

    run(
        plan,
        options.output,
        cache=options.cache,
        workers=options.workers,
        threads=options.threads,
        command=command,
        say=say,
    )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m simharness.train.reid",
        description="Train the person re-identification network on rendered people, and judge it on others.",
        epilog=f"The people are judged dressed at look_alike = {', '.join(f'{dial:g}' for dial in DIALS)}.",
    )
    parser.add_argument("--output", type=Path, default=Path("reid.onnx"), help="the ONNX file; its card goes beside it")
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path(tempfile.gettempdir()) / "simharness-reid",
        help="folder of the rendered crops (about 1.2 GB), which are not rendered again (default: %(default)s)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of people, pictures and training")
    parser.add_argument("--workers", type=int, default=1, help="processes that render")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch, where there is no CUDA")
    parser.add_argument("--quick", action="store_true", help="a toy, in less than a minute")
    return parser


if __name__ == "__main__":
    sys.exit(main())
