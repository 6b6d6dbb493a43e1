"""People with hands, faces and feet, and their detections."""

import numpy as np
from people import crowd

from mvpose import COCO17
from mvpose.wholebody import with_body_boxes


def standing(skeleton, count=3, *, shift=0.0, seed=0):
    """People in a row with all joints of a skeleton, near the joint of COCO17 above each, (n, J, 3)."""
    offsets = np.random.default_rng(seed).normal(0, 0.05, (count, len(skeleton), 3))
    bodies = crowd(count) + [shift, 0.0, 0.0]
    joints = np.empty((count, len(skeleton), 3))
    for row, joint in enumerate(skeleton.joints):
        parent = row
        while parent >= 0 and skeleton.joints[parent] not in COCO17.joints:
            parent = skeleton.parents[parent]
        anchor = COCO17.index(skeleton.joints[parent]) if parent >= 0 else 5
        joints[:, row] = bodies[:, anchor] + (0.0 if joint in COCO17.joints else offsets[:, row])
    return joints


def seen(rig, joints, skeleton, *, noise=1.0, seed=1):
    """Detections of all people in all views, with noise, some missing keypoints, and scores."""
    rng = np.random.default_rng(seed)
    pixels = rig.project(joints)
    pixels = pixels + noise * rng.normal(size=pixels.shape)
    view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
    scores = rng.uniform(0.5, 1.0, (len(view), len(skeleton)))
    scores[rng.random(scores.shape) < 0.1] = 0.0
    order = rng.permutation(len(view))
    keypoints = pixels[view, person]
    return with_body_boxes(view[order], keypoints[order], scores[order], skeleton=skeleton), person[order]
