"""Small synthetic rigs and people, made without the simulator, because tests of mvpose must not depend on it."""

from __future__ import annotations

import numpy as np

from mvpose import COCO17, Camera, Detections, Rig

# A standing adult in COCO-17, metres, facing +x, left is +y.
STANDING = np.array(
    [
        [0.12, 0.00, 1.55], [0.09, 0.03, 1.59], [0.09, -0.03, 1.59], [0.01, 0.07, 1.57], [0.01, -0.07, 1.57],
        [0.00, 0.17, 1.38], [0.00, -0.17, 1.38], [0.00, 0.22, 1.11], [0.00, -0.22, 1.11], [0.05, 0.24, 0.86],
        [0.05, -0.24, 0.86], [0.00, 0.09, 0.90], [0.00, -0.09, 0.90], [0.02, 0.10, 0.51], [0.02, -0.10, 0.51],
        [0.00, 0.10, 0.09], [0.00, -0.10, 0.09],
    ]
)  # fmt: skip


def look_at(center, target, *, focal=800.0, size=(1280, 960), distortion=None, name=""):
    """A camera at ``center`` that looks at ``target``, upright."""
    center, forward = np.asarray(center, float), np.subtract(target, center)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    return Camera(K, R, -R @ center, np.zeros(5) if distortion is None else np.asarray(distortion), size, name)


def ring(count=5, *, radius=4.0, height=2.0, **kwargs):
    """Cameras on a ring around the origin."""
    bearings = 2 * np.pi * np.arange(count) / count
    return Rig(
        [
            look_at([radius * np.cos(a), radius * np.sin(a), height], [0, 0, 1.0], name=f"cam{k}", **kwargs)
            for k, a in enumerate(bearings)
        ]
    )


def crowd(count, *, spacing=1.0, seed=0):
    """People in a row at the origin, with random headings and sizes: (count, 17, 3)."""
    rng = np.random.default_rng(seed)
    people = []
    for k in range(count):
        angle = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        body = STANDING * rng.uniform(0.92, 1.08)
        people.append(body @ turn.T + [spacing * (k - (count - 1) / 2), rng.uniform(-0.4, 0.4), 0])
    return np.array(people).reshape(count, 17, 3)


def detect(rig, people, *, noise=0.0, seed=0, shuffle=True):
    """Project all people into all views; return the detections and the true person of each, (m,)."""
    rng = np.random.default_rng(seed)
    pixels = rig.project(people)
    view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
    if shuffle:
        order = rng.permutation(len(view))
        view, person = view[order], person[order]
    keypoints = pixels[view, person] + noise * rng.standard_normal((len(view), len(COCO17), 2))
    return Detections.from_keypoints(view, keypoints, np.full((len(view), len(COCO17)), 0.9)), person
