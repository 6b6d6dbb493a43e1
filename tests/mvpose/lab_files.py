"""A small recording of two people, and its detections as the files of several programs."""

from __future__ import annotations

import json

import numpy as np
from people import STANDING, look_at

from mvpose import COCO17, Rig
from mvpose.formats.detections.openpose import people_file
from mvpose.formats.joint_names import KNOWN

WALKERS = np.stack([STANDING + [-0.9, 0.4, 0.0], STANDING * [1, 1, 1.05] + [0.6, -0.5, 0.0]])


def studio():
    """Four cameras at uneven places, as a lab has them."""
    places = ([4.0, 0.6, 2.2], [0.4, 3.4, 2.7], [-4.6, -0.5, 1.9], [-1.2, -4.1, 2.4])
    aims = ([0.2, 0.1, 1.0], [-0.3, 0.0, 0.9], [0.0, -0.3, 1.1], [0.3, 0.2, 1.0])
    return Rig([look_at(*each, name=f"cam{k}") for k, each in enumerate(zip(places, aims, strict=True))])


def walk(frames=12, *, speed=1.0, rate=25.0):
    """Two people who walk side by side along y, (T, 2, 17, 3), metres."""
    steps = speed / rate * (np.arange(frames) - frames / 2)
    return WALKERS + steps[:, None, None, None] * np.array([0.0, 1.0, 0.0])


def filmed(rig=None, *, frames=12, noise=1.0, seed=0):
    """Return a rig, joints (T, 2, 17, 3) and keypoints (T, V, 2, 17, 2)."""
    rig = rig or studio()
    joints = walk(frames)
    pixels = rig.project(joints).swapaxes(0, 1)
    return rig, joints, pixels + noise * np.random.default_rng(seed).standard_normal(pixels.shape)


def scores_of(pixels, score=0.9):
    return np.where(np.isnan(pixels).any(axis=-1), 0.0, score)


def write_openpose(folder, names, pixels, *, first=0, score=0.9):
    """A folder for each camera, a file for each picture."""
    for view, name in enumerate(names):
        (folder / name).mkdir(parents=True)
        for frame, people in enumerate(pixels[:, view]):
            content = people_file(people, scores_of(people, score))
            (folder / name / f"{name}_{frame + first:012d}_keypoints.json").write_text(json.dumps(content))


def write_coco(folder, names, pixels, *, image_id=int, box="bbox"):
    """A list of results for each camera."""
    folder.mkdir(parents=True, exist_ok=True)
    for view, name in enumerate(names):
        entries = [
            {
                "image_id": image_id(frame),
                "category_id": 1,
                "score": 2.5,
                "keypoints": triples(person),
                box: span(person),
            }
            for frame, people in enumerate(pixels[:, view])
            for person in people
        ]
        (folder / f"{name}.json").write_text(json.dumps(entries))


def write_mmpose(folder, names, pixels, *, meta=False):
    """The predictions of MMPoseInferencer on a video, or with ``meta`` those of its demo."""
    folder.mkdir(parents=True, exist_ok=True)
    for view, name in enumerate(names):
        frames = [
            {"frame_id": frame, "instances": [instance(person) for person in people]}
            for frame, people in enumerate(pixels[:, view])
        ]
        about = {"keypoint_id2name": {str(k): joint for k, joint in enumerate(COCO17.joints)}}
        content = {"meta_info": about, "instance_info": frames} if meta else frames
        (folder / f"{name}.json").write_text(json.dumps(content))


def write_rtmlib(folder, names, pixels):
    """The arrays of RTMLib, frame by frame."""
    folder.mkdir(parents=True, exist_ok=True)
    for view, name in enumerate(names):
        frames = [{"keypoints": people.tolist(), "scores": scores_of(people).tolist()} for people in pixels[:, view]]
        (folder / f"{name}.json").write_text(json.dumps(frames))


def write_rtmlib_arrays(folder, names, pixels):
    folder.mkdir(parents=True, exist_ok=True)
    for view, name in enumerate(names):
        np.savez(folder / f"{name}.npz", keypoints=pixels[:, view], scores=scores_of(pixels[:, view]))


def write_pose2sim(folder, names, pixels):
    """The layout of a Pose2Sim project, with HALPE_26."""
    rows = [KNOWN["halpe26"].joints.index(joint) for joint in COCO17.joints]
    for view, name in enumerate(names):
        place = folder / "pose" / f"{name}_json"
        place.mkdir(parents=True)
        for frame, people in enumerate(pixels[:, view]):
            bodies = []
            for person in people:
                body = np.zeros((26, 3))
                body[rows] = np.column_stack([person, np.full(17, 0.9)])
                bodies.append({"pose_keypoints_2d": body.ravel().tolist()})
            (place / f"{name}_{frame:06d}.json").write_text(json.dumps({"version": 1.3, "people": bodies}))
    (folder / "calibration").mkdir()


def triples(person, score=0.9):
    return np.column_stack([person, np.full(len(person), score)]).ravel().tolist()


def span(person):
    low, high = person.min(axis=0), person.max(axis=0)
    return [*low.tolist(), *(high - low).tolist()]


def instance(person):
    low, high = person.min(axis=0).tolist(), person.max(axis=0).tolist()
    return {
        "keypoints": person.tolist(),
        "keypoint_scores": [0.9] * len(person),
        "bbox": [[*low, *high]],
        "bbox_score": 0.8,
    }
