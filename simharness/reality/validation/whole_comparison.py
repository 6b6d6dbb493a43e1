"""Comparison of a recording with its twins with all cameras: scores of the variants, and what detections are like."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mvpose.commands.progress import Reporter, Silence
from simharness.reality.annotated_recording import AnnotatedRecording, DetectorKind
from simharness.reality.validation import variant_comparison
from simharness.reality.validation.detection_figures import DetectionFigures, compare_detections, measure_detections
from simharness.reality.validation.evidence import Compared, Evidence, frame_weights
from simharness.reality.validation.passes import RecordingChange, ScoreSums, Tallies, Unchanged, score_recordings
from simharness.reality.validation.twin_distance import TwinDistance, measure_distance
from simharness.reality.validation.verdicts import Bounds, BoundVerdict, judge_measurements, judge_scores
from simharness.scoring.frame_scores import RULES, ByRule, HeadRule


@dataclass(frozen=True)
class MeasuredRecording:
    """What is measured in a recording with all of its cameras."""

    recording: AnnotatedRecording
    """The recording, with the frames that are scored."""
    scores: Mapping[str, ByRule]
    """Scores of all frames by variant."""
    detections: DetectionFigures
    """Measurements of the detections."""


@dataclass(frozen=True)
class WholeComparison:
    """Comparison with all cameras."""

    variants: Mapping[str, Mapping[str, Mapping[HeadRule, Compared]]]
    """Scores by variant, key and rule for the head."""
    parts: Mapping[str, Mapping[str, Compared]]
    """PCP of each group of parts by variant."""
    contrasts: Mapping[tuple[str, str], Mapping[HeadRule, Compared]]
    """Differences of PCP by pair of variants and rule."""
    measured: Mapping[str, Compared]
    """Measurements of the detections."""

    @property
    def figures(self) -> dict[str, Compared]:
        """PCP of variants and of parts, and all measurements, by key."""
        scores = {f"pcp.{name}": of["pcp"][RULES[0]] for name, of in self.variants.items()}
        scores |= {f"parts.{name}.{group}": each for name, of in self.parts.items() for group, each in of.items()}
        return {**self.measured, **scores}

    @property
    def distance(self) -> TwinDistance:
        """Distance of the recording from the twins over all figures."""
        return measure_distance(self.figures)

    def verdicts(self, kind: DetectorKind, bounds: Bounds) -> list[BoundVerdict]:
        """Return the verdicts, for a kind of detector."""
        return [
            *judge_scores(self.variants, self.parts, self.contrasts, bounds),
            *judge_measurements(self.measured, kind, bounds),
        ]


def compare_whole(real: MeasuredRecording, twins: Sequence[MeasuredRecording]) -> WholeComparison:
    """Compare a recording with its twins, with all cameras."""
    tallies: list[dict[RecordingChange, Tallies]] = [
        {Unchanged(): {name: ScoreSums.of_scores(of, each.recording.scored) for name, of in each.scores.items()}}
        for each in (real, *twins)
    ]
    whole, names = Evidence.of_tallies(real.recording, tallies[0], tallies[1:]), list(real.scores)
    weights = frame_weights(real.recording)
    return WholeComparison(
        variant_comparison.compare_variants(whole, names),
        {
            name: variant_comparison.compare_parts(
                of[RULES[0]], [each.scores[name][RULES[0]] for each in twins], real.recording.scored, weights
            )
            for name, of in real.scores.items()
        },
        variant_comparison.compare_contrasts(whole, names),
        compare_detections(real.detections, [each.detections for each in twins], weights),
    )


def measure_recordings(
    recordings: Sequence[AnnotatedRecording],
    *,
    variants: Sequence[str],
    workers: int = 1,
    reporter: Reporter | None = None,
) -> list[MeasuredRecording]:
    """Score variants on recordings with all cameras, and measure their detections.

    Args:
        recordings: recordings, for example those of :func:`.annotated`.
        variants: names of presets.
        workers: number of processes.
        reporter: receiver of progress.
    """
    reporter = reporter or Silence()
    with reporter.stage("scores", len(recordings)) as advance:
        scores = score_recordings(recordings, variants=variants, workers=workers, progress=advance)
    measured = []
    with reporter.stage("measurements", len(recordings)) as advance:
        for each, of_variants in zip(recordings, scores, strict=True):
            measured.append(MeasuredRecording(each, of_variants, measure_detections(each)))
            advance(1)
    return measured
