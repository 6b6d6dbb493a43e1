"""Rendered scenes that a network has read: what cameras see, and its detections, which the store keeps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import threadpoolctl

from mvpose import Rig
from mvpose.commands.progress import Silence, Stages
from simharness.detector.detect import Detected, detect
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.load import Study, load_study
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.scenario import Scenario
from simharness.study.trial_store import Store
from simharness.trial.archive import pack_detected, unpack_detected
from simharness.trial.identity import trial_identity
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import capture_trial, detect_trial
from simharness.types.random_streams import stream
from simharness.types.recording import Recording
from simharness.types.sequence import Sequence as PoseSequence
from simharness.types.views import Views


@dataclass(frozen=True)
class ProfiledScene:
    """One scene in pictures, and what a network finds in them."""

    case: str
    """Name of its condition; "" in a study without cases."""
    scenario: Scenario
    """Its scenario, with the seed."""
    sequence: PoseSequence
    """True poses, T frames of P people."""
    views: Views
    """Truth in the pictures of V cameras."""
    rig: Rig
    """True rig."""
    believed: Rig
    """Rig that the method is given."""
    found: tuple[Detected, ...]
    """Detections of the network and their truth, T."""

    def simulated(self, config: DetectorSection, *, draw: int = 0) -> tuple[Detected, ...]:
        """Return the detections of a simulated detector in the same pictures, T.

        Args:
            config: its parameters.
            draw: number of the draw; others are independent.
        """
        seed = int(
            stream(self.scenario.seed, "profile", self.case, draw).integers(2**31)
        )  # not alike in all conditions
        return tuple(detect(self.sequence, self.views, self.rig, config, seed=seed))

    def recording(self, detected: Sequence[Detected]) -> Recording:
        """Return the input of scoring, with detections of this scene, T."""
        frames = tuple(each.detections for each in detected), tuple(each.truth for each in detected)
        return Recording(self.sequence.time, self.believed, *frames)


def network_study(
    scenes: Path, network: str, *, head: str | None = None, overrides: Sequence[str] = (), seeds: int | None = None
) -> Study:
    """Return the study of a scenario file whose pictures a network reads.

    Args:
        scenes: name or file of the scenario.
        network: name of a network that finds people, or an ONNX file.
        head: name or file of the pose head that reads the joints in its boxes.
        overrides: further KEY=VALUE of all scenes.
        seeds: number of seeds; None: those of the file.

    Raises:
        ValueError: anything wrong with the file or a value.
    """
    named = str(Path(network).resolve()).replace("\\", "/") if network.endswith(".onnx") else network
    keys = [f'detector.network="{named}"', *([f'detector.onnx="{head}"'] if head else [])]
    return load_study(scenes, overrides=[*keys, *overrides], seeds=seeds)


def read_scenes(
    study: Study, *, store: Path, workers: int = 1, progress: Callable[[int], None] = lambda scenes: None
) -> list[ProfiledScene]:
    """Build and film all trials of a study, and let its network read those pictures that the store does not know.

    Args:
        study: its scenarios name a network that finds people (``detector.source = "network"``).
        store: folder of the detections.
        workers: number of processes.
        progress: called with the number of finished scenes.

    Returns:
        The scenes, seed by seed. Those that cannot be built at a seed, because people or objects do not fit, are left
        out.

    Raises:
        ValueError: a scenario without a network, the network cannot be opened, or no scene can be built.
        RunError: a network or a picture fails.
    """
    if wrong := [each for each in study.settings if each.scenario.detector.source != "network"]:
        raise ValueError(
            f'{study.path}, {wrong[0].case or "detector"}: expected detector.source = "network" in all scenes, got '
            f'"{wrong[0].scenario.detector.source}"'
        )
    Store(store)
    jobs = tuple((each.case, study.at(each, seed)) for seed in study.seeds for each in study.settings)
    ranges = [(range(k, k + 1),) for k in range(len(jobs))]
    read = map_jobs(_Reading(jobs, store), ranges, workers=workers, progress=progress)
    scenes = [each for each in read if isinstance(each, ProfiledScene)]
    if not scenes:
        raise ValueError(str(read[0]))
    return scenes


@dataclass(frozen=True)
class _Reading:
    """Scenes by index; a function of :func:`simharness.runtime.frame_pool.map_jobs`."""

    jobs: tuple[tuple[str, Scenario], ...]
    store: Path

    def __call__(self, frames: range, /) -> ProfiledScene | str:
        """Return the scene, or the reason why it cannot be built."""
        case, scenario = self.jobs[frames.start]
        store, identity, stages = Store(self.store), trial_identity(scenario), Stages(Silence())
        with threadpoolctl.threadpool_limits(1):
            try:
                trial = build_trial(scenario)
            except ValueError as error:
                return str(error)
            simulation = capture_trial(trial, stages)
            if stored := store.read_detections(identity):
                detected = unpack_detected(stored, scenario)
            else:
                detected = detect_trial(simulation, stages)
                store.write_detections(identity, pack_detected(detected))
        rigs = trial.exposures.true_rig, trial.exposures.believed_rig
        return ProfiledScene(case, scenario, simulation.sequence, simulation.views, *rigs, detected.frames)
