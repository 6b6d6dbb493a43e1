"""Complete training run: crops, network, ONNX file, evaluation and card."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from mvpose.networks.session import Session
from tools.reid import card, scores
from tools.reid.evaluation import evaluate
from tools.reid.network import DIMENSIONS, count_parameters
from tools.reid.plan import Plan
from tools.reid.rendering import render_crops
from tools.reid.training import Progress, export, train


def run(
    plan: Plan,
    output: Path,
    *,
    cache: Path,
    workers: int = 1,
    threads: int = 1,
    command: str = "",
    log: Callable[[str], None] = print,
) -> dict[str, object]:
    """Train a network, write the ONNX file and its card, and return the card.

    Args:
        plan: size of the run.
        output: path of the ONNX file.
        cache: folder of the rendered crops.
        workers: number of rendering processes.
        threads: number of threads of PyTorch on a CPU.
        command: command line of the run, for the card.
        log: called with lines of progress.
    """
    output.parent.mkdir(parents=True, exist_ok=True)  # before the training, so that an error comes early
    clock = time.perf_counter()
    crops = render_crops(plan.training_job, cache, workers=workers)
    rendering = time.perf_counter() - clock
    log(f"{len(crops)} training crops of {plan.training} groups")

    def report(at: Progress) -> None:
        log(f"epoch {at.epoch} of {at.epochs}: identity loss {at.identities:.3f}, triplet loss {at.triplets:.3f}")

    clock = time.perf_counter()
    network = train(crops, seed=plan.seed, epochs=plan.epochs, threads=threads, report=report)
    training = time.perf_counter() - clock
    card.card_path(output).unlink(missing_ok=True)  # the card of a former training does not belong to this file
    export(network, output)

    session = Session(output)
    validation = render_crops(plan.validation_job, cache, workers=workers)
    midpoint, slope = scores.fit_affinity(session, validation)
    card.write_metadata(output, midpoint=midpoint, slope=slope, plan=plan, command=command)
    log(f"affinity: midpoint at distance {midpoint:.3f}, slope {slope:.3f}")

    evaluation = evaluate(Session(output), plan, cache=cache, workers=workers, log=log)  # with the final metadata
    content: dict[str, object] = {
        "name": card.NAME,
        "command": command,
        "sha256": card.digest(output),
        "network": {
            "parameters": count_parameters(network),
            "bytes": output.stat().st_size,
            "input_width_height": session.size,
            "dimensions": DIMENSIONS,
        },
        "data": {
            "plan": card.of_plan(plan),
            "training": card.of_crops(crops),
            "validation": card.of_crops(validation),
            **evaluation.data,
        },
        "training": {
            "rendering_seconds": round(rendering),
            "training_seconds": round(training),
            "workers": workers,
            **card.machine(threads),
        },
        "affinity": {"midpoint": round(midpoint, 4), "slope": round(slope, 4), "from": "validation people"},
        "results": {
            **evaluation.results,
            "milliseconds_a_crop_in_batches_of_20_on_one_thread": round(scores.milliseconds(session), 2),
        },
        "distances": evaluation.distances,
    }
    card.write(output, content)
    log(f"wrote {output} and {card.card_path(output)}")
    return content
