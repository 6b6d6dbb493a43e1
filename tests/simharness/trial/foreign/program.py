"""A method that knows neither mvpose nor simharness: JSON in, JSON out, one frame a run.

Reads {"P": V projection matrices (3, 4), "view": camera of each of m detections, "keypoints": (m, J, 2) pixels without
distortion, "scores": (m, J), 0 for missing} and writes {"joints": (n, J, 3), null for missing, "labels": (m,)}.

Greedy: the two groups of detections whose joints meet best in space become one, as long as they meet within some pixels
and have no view in common.
"""

import json
import sys

import numpy as np

FAR = 15.0  # pixels


def triangulate(P, points, scores):
    """The direct linear transform of one joint: its place, None where fewer than two views have it."""
    seen = scores > 0
    if seen.sum() < 2:
        return None
    rows = np.concatenate([x[:, None] * P[seen, 2] - P[seen, k] for k, x in enumerate(points[seen].T)])
    place = np.linalg.svd(rows)[2][-1]
    return (place[:3] / place[3]).tolist()


def place(P, keypoints, scores):
    """The joints of a group of detections."""
    return [triangulate(P, keypoints[:, joint], scores[:, joint]) for joint in range(keypoints.shape[1])]


def error(P, keypoints, scores):
    """How far, in pixels, the joints of a group are from where they were seen, typically."""
    errors = []
    for joint, there in enumerate(place(P, keypoints, scores)):
        if there is not None:
            seen = scores[:, joint] > 0
            projected = P[seen] @ np.append(there, 1.0)
            errors.append(np.linalg.norm(projected[:, :2] / projected[:, 2:] - keypoints[seen, joint], axis=1).max())
    return float(np.median(errors)) if errors else np.inf


def main():
    frame = json.load(sys.stdin)
    P, view = np.array(frame["P"]), np.array(frame["view"], int)
    keypoints, scores = np.array(frame["keypoints"]), np.array(frame["scores"])

    def apart(group):
        return error(P[view[group]], keypoints[group], scores[group])

    groups = [[index] for index in range(len(view))]
    while True:
        pairs = [
            (apart(one + other), one, other)
            for index, one in enumerate(groups)
            for other in groups[:index]
            if not set(view[one]) & set(view[other])
        ]
        best, one, other = min(pairs, default=(np.inf, [], []))
        if best > FAR:
            break
        groups = [group for group in groups if group not in (one, other)] + [one + other]
    people = [group for group in groups if len(group) > 1]
    labels = [next((k for k, group in enumerate(people) if index in group), -1) for index in range(len(view))]
    joints = [place(P[view[group]], keypoints[group], scores[group]) for group in people]
    joints = [[[None] * 3 if there is None else there for there in person] for person in joints]
    json.dump({"joints": joints, "labels": labels}, sys.stdout)


if __name__ == "__main__":
    main()
