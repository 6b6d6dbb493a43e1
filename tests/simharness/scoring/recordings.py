"""Small synthetic recording: people who walk apart from each other in a ring of cameras; and estimates of them."""

from dataclasses import replace

import numpy as np

from mvpose import COCO17, Camera, Detections, Estimate, Matching, Rig
from simharness.types.recording import Recording
from simharness.types.truth import Truth

# A standing person, metres.
# fmt: off
PERSON = np.array([
    [.1, 0, 1.6], [.08, .03, 1.64], [.08, -.03, 1.64], [0, .07, 1.62], [0, -.07, 1.62],
    [0, .2, 1.4], [0, -.2, 1.4], [0, .25, 1.1], [0, -.25, 1.1], [0, .25, .85], [0, -.25, .85],
    [0, .1, .95], [0, -.1, .95], [0, .1, .5], [0, -.1, .5], [0, .1, .08], [0, -.1, .08],
])
# fmt: on

RATE = 25.0
NO_PEOPLE = Estimate(np.zeros((0, 17, 3)), np.zeros((0, 17)), Matching(np.zeros(0, np.int64)), ids=[])


def ring(views):
    """Return a rig of cameras 8 m from the centre, at a height of 2 m, that look at the centre."""
    cameras = []
    for angle in 2 * np.pi * np.arange(views) / views:
        center = np.array([8 * np.cos(angle), 8 * np.sin(angle), 2.0])
        forward = np.array([0, 0, 1.0]) - center
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        K = np.array([[800.0, 0, 480], [0, 800, 360], [0, 0, 1]])
        cameras.append(Camera(K=K, R=R, t=-R @ center, distortion=np.zeros(5), size=(960, 720), name="camera"))
    return Rig(cameras)


def walk(frames, people):
    """Return joints, (T, P, 17, 3), of people who turn and walk, at least 1.5 m from each other."""
    time = np.arange(frames)[:, None] / RATE
    angle = np.linspace(0, 3, people) + 0.8 * time
    turn = np.zeros((frames, people, 3, 3))
    turn[..., 0, 0], turn[..., 0, 1], turn[..., 1, 0], turn[..., 1, 1] = (
        np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle),
    )  # fmt: skip
    turn[..., 2, 2] = 1
    along = np.stack([0.9 * time + 0 * angle, 2.0 * np.arange(people) - people + 0 * angle, 0 * angle], axis=-1)
    return np.einsum("tpab,jb->tpja", turn, PERSON) + along[:, :, None]


def record(frames=5, people=2, views=3, *, noise=0.0, phantoms=0, seed=0):
    """Return a recording with every person detected in every view, with ``noise`` pixels; phantoms come last."""
    rng = np.random.default_rng(seed)
    rig, joints = ring(views), walk(frames, people)
    detections, truth = [], []
    for people_joints in joints:
        pixels = rig.project(people_joints)
        person = np.concatenate([np.tile(np.arange(people), views), np.full(phantoms, -1)])
        view = np.concatenate([np.repeat(np.arange(views), people), rng.integers(0, views, phantoms)])
        keypoints = np.concatenate([pixels.reshape(-1, 17, 2), rng.uniform(0, 700, (phantoms, 17, 2))])
        keypoints = keypoints + noise * rng.standard_normal(keypoints.shape)
        detections.append(Detections.from_keypoints(view, keypoints, np.full(keypoints.shape[:2], 0.9)))
        visibility, boxes = np.zeros(pixels.shape[:3], np.int8), np.zeros((*pixels.shape[:2], 4))
        truth.append(Truth(people_joints, pixels, visibility, boxes, person, np.zeros(keypoints.shape[:2], np.int8)))
    return Recording(np.arange(frames) / RATE, rig, tuple(detections), tuple(truth))


def perfect_estimates(recording, *, noise=0.0, seed=0):
    """Return estimates of all people, with ``noise`` metres along each axis, true labels and true identities.

    Phantoms are unmatched.
    """
    rng = np.random.default_rng(seed)
    return [
        Estimate(
            true.joints + noise * rng.standard_normal(true.joints.shape),
            rng.uniform(0.5, 1.0, true.joints.shape[:2]),
            Matching(true.person),
            timings={"affinity": 0.001, "matching": 0.002, "reconstruction": 0.003, "total": 0.006},
            ids=np.arange(len(true.joints)),
        )
        for true in recording.truth
    ]


def with_ghost(estimate, *, score=0.1):
    """Return an estimate with one more person, far from all others."""
    joints = np.concatenate([estimate.joints, PERSON[None] + [0, 0, 30.0]])
    scores = np.concatenate([estimate.scores, np.full((1, len(COCO17)), score)])
    return replace(estimate, joints=joints, scores=scores, ids=np.append(estimate.ids, 100))
