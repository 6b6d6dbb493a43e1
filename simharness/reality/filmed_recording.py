"""Re-enactment of a recording: simulated people in the recorded places and poses, filmed by the recording's cameras.

The recording is cut into takes, in each of which the same people are present. Simulated bodies of the recorded sizes
replay their joint tracks, so that distances, bearings, speeds, and who hides whom are those of the recording. Bodies
and clothes are drawn from the seed. What the recording's room holds is unknown: the twin's room is empty.
"""

import itertools
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mvpose import COCO17, Detections, Rig
from mvpose.arrays import Floats
from mvpose.commands.progress import Silence, Stages
from mvpose.formats.calibration.opencv import write_calibration
from mvpose.formats.people import write_people
from mvpose.recording import People
from simharness.detector.detect import detect
from simharness.detector.viewing_conditions import world_offsets
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.people_tracks import actors_of, present
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import Simulation, capture_trial
from simharness.types.sequence import LANDMARKS, Sequence
from simharness.types.views import Views, Visibility
from simharness.world.motion.motion import held

_LONGEST = 4.0  # seconds of a take
_SHORTEST = 0.6  # seconds; shorter takes are joined with a neighbour
_PRESENT = 0.5  # share of the frames of a take in which a person of it is present
_ANKLE = 0.10  # metres: height of the ankle joint of a standing person, in shoes: that of simulated bodies
_STANDING = 0.25  # quantile of the heights of the lower ankle: most people stand, noise is on both sides
_MARGIN = 1.5  # metres between people or cameras and the border of the floor


@dataclass(frozen=True)
class Take:
    """Part of a recording in which the same people are present."""

    rows: range
    """Its frames, as rows of the recording."""
    people: tuple[int, ...]
    """Indices of its people."""


@dataclass(frozen=True)
class FilmedRecording:
    """Simulated recording before any detector.

    People who are absent in a frame are outside of all pictures there.
    """

    sequence: Sequence
    """True poses of everyone and who is present in each frame, with the floor at z = 0. The limbs are where the
    recording's detector found them, which is not where annotators would place them."""
    views: Views
    """Truth in the pictures."""
    rig: Rig
    """The cameras, with the floor at z = 0."""
    floor: float
    """Height of the recording's floor, metres."""

    @property
    def joints(self) -> Floats:
        """True joints in the recording's world, COCO-17, (F, P, 17, 3) metres; NaN where absent."""
        return self.sequence.of_skeleton(COCO17) + [0.0, 0.0, self.floor]

    def shown(self, people: People, truth: Floats, config: DetectorSection) -> Floats:
        """Return the joints of each actor as the detector places them on average, COCO-17, (F, A, 17, 3) metres.

        NaN where the actor is absent. Limbs of the film are the detected ones; the face has the detector's bias.

        Args:
            people: the people who are re-enacted.
            truth: truth of the recording, which says who the actors are, (F, A, 14, 3).
            config: parameters of the detector.
        """
        joints = self.joints
        joints = joints + world_offsets(joints, config.bias.of_face())
        result = np.full((*truth.shape[:2], *joints.shape[2:]), np.nan)
        for person, actor in enumerate(actors_of(people, truth)):
            if actor >= 0:
                result[:, actor] = joints[:, person]
        return result

    def detected(self, config: DetectorSection, *, seed: int) -> list[Detections]:
        """Return the detections of a simulated detector in each frame.

        The limbs are where the recording's detector found them, so that its bias of limbs is not added once more.

        Args:
            config: parameters of the detector.
            seed: seed of its draws.
        """
        config = config.model_copy(update={"bias": config.bias.of_face()})
        return [each.detections for each in detect(self.sequence, self.views, self.rig, config, seed=seed)]


def film(
    recording: AnnotatedRecording, people: People, *, seed: int, advance: Callable[[int], None] = lambda _: None
) -> FilmedRecording:
    """Simulate and film a recording.

    Args:
        recording: its rig and frames.
        people: who is where.
        seed: seed of the bodies.
        advance: called after each take with 1.

    Raises:
        ValueError: nobody stays for a second or longer, or the scene cannot be built.
    """
    takes = cut_takes(recording, people)
    if not takes:
        raise ValueError(f"{recording.name}: expected people who stay for a second or longer, got none")
    floor = floor_height(people)
    rig = Rig([replace(camera, t=camera.t + camera.R[:, 2] * floor) for camera in recording.rig])
    frames, views, count = len(recording), len(rig), people.joints.shape[1]
    landmarks = np.zeros((frames, count, len(LANDMARKS), 3))
    present = np.zeros((frames, count), bool)
    pixels = np.full((frames, views, count, len(COCO17), 2), np.nan)
    visibility = np.full((frames, views, count, len(COCO17)), Visibility.OUTSIDE, np.int8)
    boxes, area = np.zeros((frames, views, count, 4)), np.zeros((frames, views, count), np.int64)
    for take in takes:
        joints = _held(people.joints[take.rows.start : take.rows.stop, list(take.people)]) - [0.0, 0.0, floor]
        simulation = _film_take(recording, rig, joints, seed=seed)
        rows = slice(take.rows.start, take.rows.stop)
        for index, person in enumerate(take.people):
            landmarks[rows, person] = simulation.sequence.landmarks[:, index]
            pixels[rows, :, person] = simulation.views.pixels[:, :, index]
            visibility[rows, :, person] = simulation.views.visibility[:, :, index]
            boxes[rows, :, person] = simulation.views.boxes[:, :, index]
            area[rows, :, person] = simulation.views.area_visible[:, :, index]
            present[rows, person] = True
        advance(1)
    source = np.broadcast_to(np.arange(frames)[:, None], (frames, views))
    sequence = Sequence(
        np.stack([held(landmarks[:, person], here) for person, here in enumerate(present.T)], axis=1),
        np.arange(count),
        np.arange(frames) / recording.rate,
        present,
    )
    return FilmedRecording(sequence, Views(pixels, visibility, boxes, area, source), rig, floor)


def cut_takes(recording: AnnotatedRecording, people: People) -> list[Take]:
    """Return the takes of a recording: runs without a gap, cut where people come and go, and when they get long.

    Frames without anybody belong to no take.
    """
    takes: list[Take] = []
    shortest, longest = (max(1, round(seconds * recording.rate)) for seconds in (_SHORTEST, _LONGEST))
    for segment in recording.segments:
        here = present(people)[segment]
        changes = 1 + np.flatnonzero((here[1:] != here[:-1]).any(axis=1))
        cuts = [0]
        for change in changes:
            if change - cuts[-1] >= shortest and len(here) - change >= shortest:
                cuts.append(int(change))
        for start, stop in zip(cuts, [*cuts[1:], len(here)], strict=True):
            pieces = -(-(stop - start) // longest)
            edges = np.linspace(start, stop, pieces + 1).round().astype(int)
            for first, last in itertools.pairwise(edges):
                cast = tuple(np.flatnonzero(here[first:last].mean(axis=0) >= _PRESENT).tolist())
                if cast:
                    takes.append(Take(range(segment.start + int(first), segment.start + int(last)), cast))
    return takes


def floor_height(people: People) -> float:
    """Return the height of the floor, metres: a usual ankle's height below the lower ankles of standing people."""
    ankles = people.joints[:, :, 15:, 2].min(axis=-1)
    return float(np.nanquantile(ankles, _STANDING)) - _ANKLE


def _film_take(recording: AnnotatedRecording, rig: Rig, joints: Floats, *, seed: int) -> Simulation:
    """Simulate and film one take, with joints (T, P, 17, 3) over a floor at z = 0."""
    with tempfile.TemporaryDirectory() as folder:
        calibration = Path(folder, "cameras.yml")
        recorded = People(np.arange(len(joints)) / recording.rate, np.arange(joints.shape[1]), joints)
        (file,) = write_people(recorded, Path(folder), formats=["npz"])
        write_calibration(calibration, rig)
        reach = max(np.abs(joints[..., :2]).max(), np.abs(rig.centers[:, :2]).max()) + _MARGIN
        height = max(3.0, float(rig.centers[:, 2].max()) + 0.5)
        scenario = Scenario.model_validate(
            {
                "name": "twin",
                "seed": seed,
                "duration": len(joints) / recording.rate,
                "rate": recording.rate,
                "room": {"size": (2 * reach, 2 * reach, height), "walls": False},
                "people": {"count": joints.shape[1], "area": reach - 0.7, "motion": {"file": str(file)}},
                "cameras": {"layout": "file", "file": str(calibration)},
                "rendering": {"renderer": "rays"},
            }
        )
        return capture_trial(build_trial(scenario), Stages(Silence()))


def _held(joints: Floats) -> Floats:
    """Return tracks (T, P, 17, 3) without gaps: people hold their first or last pose where they are absent."""
    result = joints.copy()
    rows = np.arange(len(joints))
    for person in range(joints.shape[1]):
        known = np.isfinite(joints[:, person, 0, 0])
        nearest = rows[known][np.abs(rows[:, None] - rows[known]).argmin(axis=1)]
        result[:, person] = joints[nearest, person]
    return result
