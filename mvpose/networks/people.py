"""People and their keypoints in one picture after the other: a detector, and a pose head for its boxes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mvpose.networks.crops import Pixels
from mvpose.networks.detector import PeopleInPicture, PersonDetector
from mvpose.networks.pose import PoseHead
from mvpose.networks.session import Provider, Session
from mvpose.skeleton import COCO17, Skeleton
from mvpose.wholebody import SKELETONS, skeleton_by_name


def detect_people(
    pictures: Iterable[Pixels], detector: PersonDetector, head: PoseHead | None
) -> Iterator[PeopleInPicture]:
    """Yield the people of every picture with their keypoints.

    Args:
        pictures: (h, w, 3) uint8, red green blue.
        detector: gives their boxes, and if it is one-stage their keypoints.
        head: pose head; None with a one-stage detector.

    Raises:
        ValueError: no head with a detector that gives boxes alone.
    """
    if head is None and not detector.one_stage:
        raise ValueError("a detector that gives boxes alone needs a pose head")
    for picture in pictures:
        found = detector.find(picture)
        if head is None or not len(found.scores):
            yield found if found.keypoints is not None else _nobody(head)
            continue
        posed = head.detect([picture], np.zeros(len(found.boxes), np.int64), found.boxes, box_scores=found.scores)
        yield replace(found, keypoints=posed.keypoints, keypoint_scores=posed.scores)


def open_head(path: str | Path, *, provider: Provider = "cpu", threads: int = 1) -> PoseHead:
    """Open a pose head, on COCO-17 or on the skeleton of :mod:`mvpose.wholebody` with its number of joints.

    Raises:
        ValueError: as :class:`mvpose.networks.PoseHead`, or another number of joints.
    """
    session = Session(path, provider=provider, threads=threads)
    known: list[Skeleton] = [COCO17, *map(skeleton_by_name, SKELETONS)]
    counts = {extent for shape in session.shapes for extent in (shape[0], shape[-1])}
    skeleton = next((each for each in known if len(each) in counts), COCO17)
    return PoseHead(session, skeleton=skeleton, likelihoods=False)


def _nobody(head: PoseHead | None) -> PeopleInPicture:
    joints = len(COCO17 if head is None else head.skeleton)
    return PeopleInPicture(np.zeros((0, 4)), np.zeros(0), np.zeros((0, joints, 2)), np.zeros((0, joints)))
