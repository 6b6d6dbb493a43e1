"""Small annotated recording without detections, and an estimator with fixed estimates."""

import numpy as np

from mvpose import COCO17, Camera, Detections, Estimate, Matching, Rig
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.annotated_recording import AnnotatedRecording

# fmt: off
PERSON = np.array([
    [.1, 0, 1.6], [.08, .03, 1.64], [.08, -.03, 1.64], [0, .07, 1.62], [0, -.07, 1.62],
    [0, .2, 1.4], [0, -.2, 1.4], [0, .25, 1.1], [0, -.25, 1.1], [0, .25, .85], [0, -.25, .85],
    [0, .1, .95], [0, -.1, .95], [0, .1, .5], [0, -.1, .5], [0, .1, .08], [0, -.1, .08],
])
# fmt: on


class Fixed:
    """User-defined estimator that always returns the same people."""

    def __init__(self, people):
        self.people = np.asarray(people, float).reshape(-1, 17, 3)
        self.calls = 0

    def estimate(self, rig, detections):
        self.calls += 1
        timings = {"affinity": 0.001, "matching": 0.002, "reconstruction": 0.003, "total": 0.006}
        return Estimate(self.people, np.ones(self.people.shape[:2]), Matching(np.zeros(0)), timings=timings)


def small_recording(head):
    """Return three frames without detections: actors 1 and 2 annotated, then actor 1, then none."""
    K, R = np.diag([500.0, 500.0, 1.0]), np.eye(3)
    rig = Rig([Camera(K, R, np.array([x, 0.0, 5.0]), size=(640, 480)) for x in (0.0, 1.0)])
    truth = np.full((3, 4, 14, 3), np.nan)
    truth[:2, 0] = coco17_to_shelf14(PERSON, head=head)
    truth[0, 1] = coco17_to_shelf14(PERSON + np.array([2, 0, 0]), head=head)
    detections = (Detections.empty(COCO17),) * 3
    return AnnotatedRecording(rig, truth, detections, np.arange(3), name="shelf", actors=(0, 1, 2))
