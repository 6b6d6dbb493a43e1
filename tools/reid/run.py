"""One training from nothing: crops, network, ONNX file, figures, card."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from mvpose.networks.session import Session
from tools.reid import card, scores
from tools.reid.evaluation import judged
from tools.reid.network import DIMENSIONS, parameters
from tools.reid.plan import Plan
from tools.reid.rendering import rendered
from tools.reid.training import Progress, export, train


def run(
    plan: Plan,
    output: Path,
    *,
    cache: Path,
    workers: int = 1,
    threads: int = 1,
    command: str = "",
    say: Callable[[str], None] = print,
) -> dict[str, object]:
    """Train, write the ONNX file and its card, and return the card.

    Args:
        plan: how much of everything.
        output: the ONNX file.
        cache: folder of the rendered crops.
        workers: processes that render.
        threads: of PyTorch on a CPU.
        command: that made it, for the card.
        say: called with a line of progress now and then.
    """
    output.parent.mkdir(parents=True, exist_ok=True)  # now, not after an hour
    clock = time.perf_counter()
    crops = rendered(plan.training_order, cache, workers=workers)
    rendering = time.perf_counter() - clock
    say(f"{len(crops)} crops of {plan.training} groups to learn from")

    def report(at: Progress) -> None:
        say(f"epoch {at.epoch} of {at.epochs}: identities {at.identities:.3f}, triplets {at.triplets:.3f}")

    clock = time.perf_counter()
    network = train(crops, seed=plan.seed, epochs=plan.epochs, threads=threads, report=report)
    training = time.perf_counter() - clock
    card.card_path(output).unlink(missing_ok=True)  # that of a former training is not this file's
    export(network, output)

    session = Session(output)
    validation = rendered(plan.validation_order, cache, workers=workers)
    midpoint, slope = scores.scale(session, validation)
    card.stamp(output, midpoint=midpoint, slope=slope, plan=plan, command=command)
    say(f"a distance of {midpoint:.3f} is as likely of one person as of two; slope {slope:.3f}")

    judgement = judged(Session(output), plan, cache=cache, workers=workers, say=say)  # as anyone will read it
    content: dict[str, object] = {
        "name": card.NAME,
        "command": command,
        "sha256": card.digest(output),
        "network": {
            "parameters": parameters(network),
            "bytes": output.stat().st_size,
            "input_width_height": session.size,
            "dimensions": DIMENSIONS,
        },
        "data": {
            "plan": card.of_plan(plan),
            "training": card.of_crops(crops),
            "validation": card.of_crops(validation),
            **judgement.data,
        },
        "training": {
            "rendering_seconds": round(rendering),
            "training_seconds": round(training),
            "workers": workers,
            **card.machine(threads),
        },
        "affinity": {"midpoint": round(midpoint, 4), "slope": round(slope, 4), "from": "validation people"},
        "results": {
            **judgement.results,
            "milliseconds_a_crop_in_batches_of_20_on_one_thread": round(scores.milliseconds(session), 2),
        },
        "distances": judgement.distances,
    }
    card.write(output, content)
    say(f"{output} and {card.card_path(output)} are written")
    return content
