"""Scores of identities by ``trackeval``, the reference implementation; and random people and tracks to compare on.

``trackeval`` is called at its metric classes, with the same similarities: its data sets are pictures with boxes.
"""

import contextlib
import io

import numpy as np


def metrics():
    """Return its three metric classes; importing them prints a warning about packages that only data sets need."""
    with contextlib.redirect_stdout(io.StringIO()):
        from trackeval.metrics import CLEAR, HOTA, Identity

        return HOTA(), Identity({"PRINT_CONFIG": False}), CLEAR({"PRINT_CONFIG": False})


def data_of(frames, distance):
    """Return the dictionary that metrics read, with people renumbered so that each is there once at least."""
    there = np.unique(np.concatenate([np.zeros(0, int), *frames.present]))
    people = [np.searchsorted(there, each) for each in frames.present]
    return {
        "gt_ids": people,
        "tracker_ids": list(frames.tracks),
        "similarity_scores": frames.similarities(distance),
        "num_gt_ids": len(there),
        "num_tracker_ids": len(frames.ids),
        "num_gt_dets": sum(map(len, people)),
        "num_tracker_dets": sum(map(len, frames.tracks)),
        "num_timesteps": len(frames),
    }


def reference(frames, distance):
    """Return the scores of ``trackeval`` by its names; arrays over its thresholds for HOTA."""
    data = data_of(frames, distance)
    with contextlib.redirect_stdout(io.StringIO()):
        return {key: value for each in metrics() for key, value in each.eval_sequence(data).items()}


def random_case(seed):
    """Return true joints (T, P, 17, 3), and joints and identities of the estimates of each frame.

    People walk near each other, and may be absent for a while or for the whole time. They are missed now and then,
    exchange identities and get new ones, and there are ghosts. Cases may lack frames, people or estimates.
    """
    rng = np.random.default_rng(seed)
    frames, people = int(rng.integers(0, 25)), int(rng.integers(0, 6))
    body = rng.normal(0, 0.3, (17, 3))
    path = rng.normal(0, 0.8, (people, 3)) + np.cumsum(rng.normal(0, 0.1, (frames, people, 3)), axis=0)
    truth = path[:, :, None] + body + rng.normal(0, 0.02, (frames, people, 17, 3))
    name = rng.permutation(50)[:people]
    found, noise, ghosts, fresh = rng.uniform(0.4, 1), rng.uniform(0, 0.5), rng.uniform(0, 1), 100
    if rng.random() < 0.1:
        found = 0.0
    joints, ids = [], []
    for frame in range(frames):
        there = rng.random(people) < found
        if people and rng.random() < 0.15:  # exchange two identities, or give a new one
            one, other = rng.integers(0, people, 2)
            name[[one, other]] = name[[other, one]]
            if rng.random() < 0.5:
                name[one], fresh = fresh, fresh + 7
        estimates = truth[frame, there] + rng.normal(0, noise, (int(there.sum()), 1, 3)) / np.sqrt(3)
        estimates = estimates + rng.normal(0, 0.03, estimates.shape)
        extra = rng.poisson(ghosts)
        joints.append(np.concatenate([estimates, rng.normal(0, 1.0, (extra, 1, 3)) + body]))
        ids.append(np.concatenate([name[there], 1000 + 10 * rng.permutation(9)[:extra]]).astype(int))
    for person in range(people):
        if frames and rng.random() < 0.5:  # absent: for the whole sequence as well
            start, end = np.sort(rng.integers(0, frames + 1, 2))
            truth[start:end, person] = np.nan
    truth[rng.random(truth.shape[:3]) < 0.05] = np.nan  # joints without truth, the hips as well
    return truth, joints, ids
