"""Table of the coverage of ellipsoids: ``python -m benchmarks.confidence ci --variants full fast --seeds 100 101``.

Each case of a scenario is simulated at each seed. The table has the shares of the joints of the people found that are
inside of the ellipsoids that should hold 50, 90, 99 and 99.9 % of them. ``--by joint`` or ``--by views`` splits a case
by joint, or by the number of views with a keypoint of it in the detections of the estimate.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Estimate
from simharness import simulate
from simharness.scenario.load import load_study
from simharness.scoring.joint_errors import inside
from simharness.scoring.pairing import pair
from simharness.trial.stages.build_trial import build_variants
from simharness.types.recording import Recording

SHARES = (0.5, 0.9, 0.99, 0.999)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.confidence", description=__doc__)
    parser.add_argument("scenario", help="name or file of a scenario or study")
    parser.add_argument("--variants", nargs="+", default=["full", "fast"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[100, 101, 102])
    parser.add_argument("--by", choices=["case", "joint", "views"], default="case")
    options = parser.parse_args(arguments)
    for line in table(options.scenario, options.variants, options.seeds, options.by):
        print(line, flush=True)
    return 0


def table(scenario: str, variants: Sequence[str], seeds: Sequence[int], by: str) -> Iterator[str]:
    """Yield the lines of the table."""
    study = load_study(scenario, seeds=seeds, variants=variants)
    yield f"{'variant':12s} {'case':24s} {by if by != 'case' else '':16s} joints " + " ".join(
        f"{100 * share:5g} %" for share in SHARES
    )
    for setting in study.settings:
        counts: dict[tuple[str, str], list[NDArray[np.float64]]] = defaultdict(list)
        for seed in study.seeds:
            scene = study.at(setting, seed)
            recording = simulate(scene)
            for variant, pipeline in build_variants(scene).items():
                estimates = [pipeline.estimate(recording.rig, each) for each in recording.detections]
                for group, found in coverage(recording, estimates, by):
                    counts[variant, group].append(found)
        for (variant, group), parts in sorted(counts.items()):
            hits = np.concatenate(parts)
            shares = " ".join(f"{100 * share:7.1f}" for share in hits.mean(axis=0))
            yield f"{variant:12s} {setting.case:24s} {group:16s} {len(hits):6d} {shares}"


def coverage(recording: Recording, estimates: Sequence[Estimate], by: str) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield groups and whether each of their joints is inside of the ellipsoids, (k, 4)."""
    for detections, truth, estimate in zip(recording.detections, recording.truth, estimates, strict=True):
        partner = pair(truth.joints, estimate.joints).estimate
        people = np.flatnonzero(partner >= 0)
        found = partner[people]
        shells = [shell for share in SHARES if (shell := estimate.ellipsoids(share)) is not None]
        if not shells:
            raise SystemExit("this variant gives no covariances, so it has no ellipsoids")
        hits = np.stack(
            [inside(truth.joints[people], estimate.joints[found], shell[found]) for shell in shells], axis=-1
        )
        groups = np.full(hits.shape[:2], "", dtype="<U32")
        if by == "joint":
            groups[:] = COCO17.joints
        elif by == "views":
            labels = estimate.matching.labels_of(len(detections))
            seen = np.stack([(detections.scores[labels == k] > 0).sum(axis=0) for k in found] or [np.zeros(17, int)])
            groups[:] = seen[: len(found)].astype(str)
        known = np.isfinite(hits).all(axis=-1)
        for group in np.unique(groups[known]):
            yield str(group), hits[known & (groups == group)]


if __name__ == "__main__":
    sys.exit(main())
