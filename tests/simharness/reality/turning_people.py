"""Recording of people who stand on a floor among cameras, with detections that are exact."""

import numpy as np

from mvpose import Camera, Detections, Rig
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.annotated_recording import AnnotatedRecording

# fmt: off
PERSON = np.array([
    [.12, 0, 1.55], [.09, .03, 1.59], [.09, -.03, 1.59], [.01, .07, 1.57], [.01, -.07, 1.57],
    [0, .17, 1.38], [0, -.17, 1.38], [0, .22, 1.11], [0, -.22, 1.11], [.05, .24, .86], [.05, -.24, .86],
    [0, .09, .90], [0, -.09, .90], [.02, .10, .51], [.02, -.10, .51], [0, .10, .09], [0, -.10, .09],
])
# fmt: on


def ring(count, *, radius=4.0, distortion=(0.0,) * 5):
    """Cameras on a ring that is not regular, so that no two face each other."""
    cameras = []
    for view in range(count):
        bearing = 2 * np.pi * (view + 0.13 * view**2 / count) / (count + 1)
        center = np.array([radius * np.cos(bearing), radius * np.sin(bearing), 2.0 + 0.1 * view])
        forward = np.array([0, 0, 0.9]) - center
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        K = np.array([[700.0, 0, 515.5], [0, 700.0, 387.5], [0, 0, 1]])
        cameras.append(Camera(K, R, -R @ center, np.array(distortion), size=(1032, 776), name=f"cam{view}"))
    return Rig(cameras)


def joints_of(frames, people, *, seed=0):
    """People at fixed distances who turn and shift a little, (F, P, 17, 3)."""
    rng = np.random.default_rng(seed)
    result = np.empty((frames, people, 17, 3))
    for person in range(people):
        for frame in range(frames):
            angle = 2.1 * person + 0.05 * frame
            turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
            place = [1.5 * (person - (people - 1) / 2), rng.uniform(-0.1, 0.1), 0]
            result[frame, person] = PERSON @ turn.T + place
    return result


def walkers(*, frames=8, people=2, cameras=4, noise=0.0, seed=0, name="walkers", actors=None):
    """Recording whose detections are the true joints, plus ``noise`` pixels, in every camera."""
    rig, joints = ring(cameras), joints_of(frames, people)
    rng = np.random.default_rng(seed)
    detections = []
    for of_frame in joints:
        pixels = rig.project(of_frame)
        view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
        shift = noise * rng.standard_normal((len(view), 17, 2))
        detections.append(Detections.from_keypoints(view, pixels[view, person] + shift, np.full((len(view), 17), 0.9)))
    truth = coco17_to_shelf14(joints)
    return AnnotatedRecording(rig, truth, tuple(detections), np.arange(frames), name=name, actors=actors)
