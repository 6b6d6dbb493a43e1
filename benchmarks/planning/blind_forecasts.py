"""Forecasts of rigs beside what a network and a recording show there; fits :mod:`simharness.planning.forecast_error`.

    python -m benchmarks.planning.blind_forecasts FOLDER [--shelf FOLDER] [--detector topdown] [--scenes 12]

FOLDER keeps what is finished. Ten rigs (``filmed_rigs.toml``) are rendered, and their pictures read by the network
MoveNet (``mvpose networks get movenet``); where the data of Shelf are, its recording is the eleventh. The forecast of a
rig knows the cameras, where people are and their number, as a planner of the rig does; of Shelf, only the
calibration. Neither knows the network, and all have the same profile of a detector; with ``--detector movenet``, that
of the network of the rendered rigs. PCP is that of ``full`` with missing joints of the head filled from the others, for
all sets of two cameras and more.

The errors of all rigs but one give the intervals of that one; how many of its figures they hold is the test of the
intervals, and the errors of all rigs are the constants of the module.
"""

from __future__ import annotations

import argparse
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.optimize import minimize

from benchmarks.planning.shelf_subsets import Subset, SubsetFigures
from mvpose import Rig, preset
from mvpose.arrays import Floats
from mvpose.commands.progress import reporter
from mvpose.skeleton import coco17_to_shelf14
from simharness.planning.fast_layer import Volume
from simharness.planning.floor_coverage import covered_volume, usual_people
from simharness.planning.forecast_error import ForecastError
from simharness.planning.rehearsal_scene import RehearsalSetup, SceneSettings
from simharness.planning.rig_file import read_rig
from simharness.planning.simulated_scenes import Condition, SceneBatch, SceneResult, simulate_scenes
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.recording_file import read_recording
from simharness.reality.validation.evidence import frame_weights
from simharness.reality.validation.passes import CameraSubset, annotated, run_passes
from simharness.reality.validation.variant_comparison import FILLED, camera_subsets
from simharness.scenario.load import load_study
from simharness.scenario.presets import read_profile
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import percent
from simharness.trial.conditioned_trial import estimate_frames
from tools.network_profile.profiled_scenes import ProfiledScene, read_scenes

_RIGS = Path(__file__).with_name("filmed_rigs.toml")
Scores = Mapping[Subset, Floats]
"""Scores of n scenes or resamples by set of cameras: PCP and MPJPE, (2, n)."""
T = TypeVar("T")


@dataclass(frozen=True)
class BlindForecast:
    """Forecast of a rig, and its real scores."""

    name: str
    real: Scores
    """Of a network on n scenes, or of resamples of a recording, the recording itself first."""
    resampled: bool
    """Whether ``real`` holds resamples."""
    forecast: Scores
    """Of n simulated scenes."""

    def figures(self, kind: str) -> Floats:
        """Return forecasts, sizes, errors (real minus forecast) and the noise of both, (n, 4), of "pcp", "loss", "mm".

        The size is what :class:`.ForecastError` scales by; the noise is a standard deviation.
        """
        whole = max(self.real, key=len)
        rows = []
        for each in self.real:
            if kind == "loss" and (len(each) != len(whole) - 1):
                continue
            values = [side[each][0 if kind != "mm" else 1] for side in (self.forecast, self.real)]
            if kind == "loss":
                values = [
                    side[whole][0] - value for side, value in zip((self.forecast, self.real), values, strict=True)
                ]
            forecast, real = values
            outcome = real[0] if self.resampled else np.nanmean(real)
            noise = np.nanstd(real[1:]) if self.resampled else _standard_error(real)
            mean = float(np.nanmean(forecast))
            size = {"pcp": 100 - mean, "loss": abs(mean), "mm": mean}[kind]
            rows.append((mean, size, outcome - mean, np.hypot(noise, _standard_error(forecast))))
        return np.array(rows)

    def subsets(self) -> SubsetFigures:
        """Return the PCP of all sets of cameras."""
        real = {
            each: float(values[0][0] if self.resampled else np.mean(values[0])) for each, values in self.real.items()
        }
        return SubsetFigures(real, {each: float(np.mean(values[0])) for each, values in self.forecast.items()})


def _standard_error(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.std(known, ddof=1) / np.sqrt(len(known)))


def fit_error(figures: Sequence[Floats]) -> ForecastError:
    """Return the error of most likelihood, every rig counted alike.

    Args:
        figures: :meth:`BlindForecast.figures` of each rig, (n, 4).
    """

    def cost(logarithms: Floats) -> float:
        least, share = np.exp(logarithms)
        total = 0.0
        for _, size, error, noise in (each.T for each in figures):
            variance = least**2 + (share * size) ** 2 + noise**2
            total += float(np.mean(np.log(variance) + error**2 / variance))
        return total

    least, share = np.exp(minimize(cost, np.log([1.0, 0.3]), method="Nelder-Mead").x)
    return ForecastError(float(least), float(share), len(figures))


def covered(error: ForecastError, figures: Floats) -> Floats:
    """Return which figures (n, 4) lie within the intervals of a forecast, (n,)."""
    _, size, apart, noise = figures.T
    deviation = np.array([error.deviation(each) for each in size])
    return np.asarray(np.abs(apart) <= error.quantile * np.hypot(deviation, noise))


def forecast_rig(rig: Rig, volume: Volume, people: int, *, detector: str, scenes: int, workers: int) -> Scores:
    """Return the scores that simulated scenes give for every set of two cameras and more."""
    settings = SceneSettings(rig, RehearsalSetup(volume, read_profile(detector), people), head=FILLED)
    sets = camera_subsets(len(rig))
    batch = SceneBatch(settings, tuple(map(Condition, sets)), tuple(range(scenes)))
    (results,) = simulate_scenes([batch], workers=workers)
    return {each: np.array([_scores(result, each) for result in results]).T for each in sets}


def _scores(result: SceneResult, cameras: Subset) -> tuple[float, float]:
    scores = result.scores[Condition(cameras)]
    return scores.pcp, scores.mpjpe_mm


def network_scores(scenes: Sequence[ProfiledScene]) -> Scores:
    """Return the scores of the detections of the network in the scenes of one rig."""
    sets, result = camera_subsets(len(scenes[0].believed)), {}
    for cameras in sets:
        values = []
        for scene in scenes:
            frames = tuple(each.detections for each in scene.found)
            nobody = np.zeros((len(frames), 0, 14, 3))
            part = AnnotatedRecording(scene.believed, nobody, frames, np.arange(len(frames))).subset(cameras)
            estimates = [each.joints for each in estimate_frames(preset("full"), part.rig, part.detections)]
            truth = coco17_to_shelf14(scene.sequence.joints, head=FILLED.mapping)
            scored = score_frames(truth, estimates, head=FILLED.mapping, filled=FILLED.filled)
            error = scored.error[scored.found].mean() if scored.found.any() else np.nan
            values.append((percent(scored.parts), 1000.0 * error))
        result[cameras] = np.array(values).T
    return result


def recorded_scores(recording: AnnotatedRecording) -> Scores:
    """Return the scores of a recording and of its bootstrap resamples."""
    frames = annotated(recording)
    changes = [CameraSubset(each) for each in camera_subsets(len(recording.rig))]
    (passes,) = run_passes([frames], changes, variants=("full",))
    weights = frame_weights(frames)
    result = {}
    for change in changes:
        sums = passes[change]["full"]
        of = [np.concatenate([[score(sums.total(), FILLED)], score(sums.resampled(weights), FILLED)])
              for score in (type(sums).pcp, type(sums).mpjpe)]  # fmt: skip
        result[change.views] = np.array(of)
    return result


def main() -> None:
    """Print forecasts beside real scores, and their errors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="of what is finished")
    parser.add_argument("--shelf", type=Path, help="folder of the files of Shelf")
    parser.add_argument("--detector", default="topdown")
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    folder = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    study = load_study(_RIGS)
    how = {"detector": arguments.detector, "scenes": arguments.scenes, "workers": arguments.workers}

    def kept(name: str, make: object) -> Scores:
        path = folder / f"{name}.pkl"
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))  # type: ignore[operator]
        return pickle.loads(path.read_bytes())

    with reporter() as bars, bars.stage("read pictures", study.trials) as advance:
        scenes = read_scenes(study, store=folder / "store", workers=arguments.workers, progress=advance)
    forecasts = []
    for setting in study.settings:
        of = [each for each in scenes if each.case == setting.case]
        people, square = setting.scenario.people.count, 2 * setting.scenario.people.area
        tag = f"{setting.case}-{arguments.detector}-{arguments.scenes}"
        forecasts.append(
            BlindForecast(
                setting.case,
                kept(f"{setting.case}-network", lambda of=of: network_scores(of)),
                False,
                kept(
                    tag, lambda of=of, n=people, side=square: forecast_rig(of[0].rig, Volume.box(side, side), n, **how)
                ),
            )
        )
    if arguments.shelf:
        rig = read_rig(arguments.shelf / "calibration_shelf.json", size=(1032, 776))
        volume, _ = covered_volume(rig)
        forecasts.append(
            BlindForecast(
                "Shelf",
                kept("Shelf-real", lambda: recorded_scores(read_recording("shelf", arguments.shelf))),
                True,
                kept(
                    f"Shelf-{arguments.detector}-{arguments.scenes}",
                    lambda: forecast_rig(rig, volume, usual_people(volume), **how),
                ),
            )
        )
    print(report(forecasts))


def report(forecasts: Sequence[BlindForecast]) -> str:
    """Return a table of the rigs, and the errors of each kind of figure."""
    lines = [
        f"{'rig':10} sets  mean difference  Spearman  PCP lost by choice  pairs: forecast, real  all: forecast, real"
    ]
    for each in forecasts:
        sets = each.subsets()
        sizes = sorted({len(one) for one in sets.real})
        lost = max(sets.real[best] - sets.real[chosen] for chosen, best in map(sets.chosen, sizes))
        pairs = [np.mean([side[one] for one in side if len(one) == 2]) for side in (sets.predicted, sets.real)]
        whole = max(sets.real, key=len)
        lines.append(
            f"{each.name:10} {len(sets.real):4}  {sets.mean_difference:15.1f}  {sets.rank():8.3f}  {lost:18.1f}  "
            f"{pairs[0]:15.1f}, {pairs[1]:4.1f}  {sets.predicted[whole]:13.1f}, {sets.real[whole]:4.1f}"
        )
    for kind in ("pcp", "loss", "mm"):
        figures = [each.figures(kind) for each in forecasts]
        held = [covered(fit_error([*figures[:k], *figures[k + 1 :]]), one) for k, one in enumerate(figures)]
        error = fit_error(figures)
        rates = ", ".join(f"{each.name} {100 * one.mean():.0f}" for each, one in zip(forecasts, held, strict=True))
        lines.append(
            f"\n{kind}: ForecastError({error.least:.2g}, {error.share:.2g}, {error.rigs}); intervals from the "
            f"other rigs hold {100 * np.mean([one.mean() for one in held]):.0f} % ({rates})"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
