"""Truth about detections that a network makes in pictures: whom each shows, and the error of each keypoint."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections
from mvpose.arrays import Floats, Integers
from simharness.detector.error_classes import classify, distance
from simharness.detector.viewing_conditions import oks_units
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility

SIMILAR = 0.5
"""Object keypoint similarity from which a detection shows a person, as COCO counts one that is found."""

_SHARE = 0.5  # of the reported keypoints of a detection that lie on one person

Ids = Callable[[int], NDArray[np.int16]]


def with_detections(truth: Truth, found: Detections, ids: Ids) -> Truth:
    """Return the truth of a frame with persons and errors for the detections of a network.

    A detection shows the person to whose joints it is most similar. Where nobody's are similar enough, because most are
    hidden or wrong, it shows the person on whose pixels half of its keypoints lie; else it is a false positive.

    Args:
        truth: truth of the frame; its detections are replaced.
        found: detections of the network, m of them.
        ids: gives for a view the index of the visible person at each pixel, (h, w); other values are no person.
    """
    count = len(found.view)
    similarity = np.zeros((count, len(truth.joints)))
    for row, view in enumerate(found.view.tolist()):
        similarity[row] = object_keypoint_similarity(
            found.keypoints[row], truth.pixels[view], truth.visibility[view], truth.boxes[view]
        )
    order = np.argsort(-similarity, axis=1, kind="stable")
    person = (
        np.where(similarity.max(axis=1, initial=0.0) >= SIMILAR, order[:, 0], -1) if order.size else np.full(count, -1)
    )
    for row in np.flatnonzero(person < 0).tolist():
        person[row] = _person_at(found.keypoints[row], ids(int(found.view[row])), people=len(truth.joints))
    return replace(truth, person=person, error=_errors(truth, found, person, similarity))


def object_keypoint_similarity(
    keypoints: Floats, pixels: Floats, visibility: NDArray[np.int8], boxes: Floats
) -> Floats:
    """Return the similarity of a detection to every person, 0 to 1, (P,): COCO's, over the joints in the picture.

    Joints that the detection does not report count as wrong.

    Args:
        keypoints: keypoints of the detection, (17, 2) pixels; NaN where not reported.
        pixels: joints of the people, (P, 17, 2) pixels.
        visibility: their visibility, (P, 17).
        boxes: boxes of the people, (P, 4).
    """
    inside = visibility != Visibility.OUTSIDE
    away = np.where(inside, distance(keypoints, pixels, oks_units(boxes)), np.inf)
    return np.exp(-(away**2) / 8).sum(axis=1) / np.maximum(inside.sum(axis=1), 1)  # 8 = 2 (2 sigma)^2 / sigma^2


def _person_at(keypoints: Floats, ids: NDArray[np.int16], *, people: int) -> int:
    """Return the person on whose pixels half of the reported keypoints lie; -1: nobody."""
    places = np.rint(keypoints[np.isfinite(keypoints).all(axis=1)]).astype(int)
    height, width = ids.shape
    inside = ((places >= 0) & (places < (width, height))).all(axis=1)
    hit = ids[places[inside, 1], places[inside, 0]]
    votes = np.bincount(hit[(hit >= 0) & (hit < people)], minlength=people)
    return int(votes.argmax()) if votes.size and votes.max() >= max(1.0, _SHARE * len(places)) else -1


def _errors(truth: Truth, found: Detections, person: Integers, similarity: Floats) -> NDArray[np.int8]:
    """Return the error classes, (m, 17); a swap is with the other person who is most similar."""
    real = person >= 0
    others = similarity.copy()
    others[np.flatnonzero(real), person[real]] = -1.0
    other = others.argmax(axis=1) if others.shape[1] else person
    has_other = real & (others.max(axis=1, initial=-1.0) >= 0.0)
    reported = np.isfinite(found.keypoints).all(axis=-1)
    error = np.where(reported, np.int8(KeypointError.MISS), np.int8(KeypointError.ABSENT))
    view, shown = found.view[real], person[real]
    swapped = np.where(has_other[real, None, None], truth.pixels[view, other[real]], np.nan)
    units = oks_units(truth.boxes[view, shown])
    error[real] = classify(found.keypoints[real], truth.pixels[view, shown], units, other=swapped)
    return error
