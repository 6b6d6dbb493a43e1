"""Inputs of methods: cameras of their own for methods of users, and digests by which a change is noticed.

All variants share the detections of a frame. NumPy protects them from writes in Python only, not from those of C code
or of a tensor that shares their memory.
"""

import copy
import hashlib

import numpy as np

from mvpose import Detections, Rig

_copies: dict[str, tuple[Rig, Rig]] = {}  # by variant: the last rig, and the copy that the variant has of it


def own_rig(variant: str, rig: Rig) -> Rig:
    """Return a copy of the cameras that no other variant has; the same object in all frames of a rig."""
    original, own = _copies.get(variant, (None, rig))
    if original is not rig:
        own = copy.deepcopy(rig)
        _copies[variant] = (rig, own)
    return own


def input_digest(rig: Rig, detections: Detections) -> bytes:
    """Return a digest of cameras and detections. Heat maps are left out: they are large, and drawn for each frame."""
    digest = hashlib.blake2b(digest_size=16)
    cameras = [array for camera in rig for array in (camera.K, camera.R, camera.t, camera.distortion)]
    cameras += [rig.packed, rig.centers]  # kept by the rig, and read by kernels
    found = (detections.view, detections.keypoints, detections.scores, detections.boxes, detections.box_scores)
    for array in (*cameras, *found, detections.descriptors, detections.time):
        digest.update(b"" if array is None else np.ascontiguousarray(array).data)
    return digest.digest()
