"""Limbs of all views associated at once: written again from 4D Association, for one frame.

Zhang, An, Yu, Li, Li & Liu, "4D Association Graph for Realtime Multi-person Motion Capture Using Multiple Video
Cameras", CVPR 2020. Nodes are joints in views; parsing edges join the ends of a limb in a view, matching edges join a
joint of two views whose rays are near. Limb bundles are sets of limbs, one of each view at most, whose ends all have
matching edges; they are scored, and assembled from the best on, as Kruskal's algorithm takes edges, without conflict in
any view.

Left out: edges to the people of the frame before (frames are estimated alone here), and the fit of a skeleton with
fixed lengths, which needs a hundred frames; joints are triangulated. The parsing edges of the paper are part affinity
fields of a bottom-up network; here a limb is in a view where one given detection has both of its ends, and its edge has
their score, so that limbs of different detections are not joined anew. Weights and thresholds are those that the
authors publish for Shelf.
"""

from __future__ import annotations

import numpy as np

from benchmarks.methods.points import estimate_of, nearest_point, ray_distance
from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import viewing_rays
from mvpose.skeleton import Skeleton

FARTHEST = 0.15
"""Distance of the rays of a joint in two views, at most, metres."""

WEIGHTS = (2.0, 1.0, 2.0, 0.5)
"""Weights of matching edges, parsing edges, number of views, and of limbs near the trunk, in the score of a bundle."""

VIEWS = 1.5
"""Number of views at which the score of their number, 1 - exp(-n² / 2 c²) with c this number, saturates."""

ASSIGNED = 5
"""Fewest keypoints of a person."""

_MOST = 20_000  # bundles of one limb, a bound on time in crowds before many cameras
_TRUNK = ("shoulder", "hip")

REDUNDANT = (("shoulder", "shoulder"), ("hip", "hip"), ("shoulder", "hip"), ("nose", "shoulder"), ("ear", "shoulder"))
"""Parts that limbs join besides the bones of the skeleton: the trunk, and a head that is seen from behind, as the part
affinity fields of OpenPose join them."""


class LimbAssociation:
    """Limb bundles over all views, assembled to people."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        rays = viewing_rays(rig, detections)
        order = np.argsort(rays.view, kind="stable")
        limbs, levels = _limbs(detections.skeleton)
        edges = _matching_edges(rays.view[order], rays.origins[order], rays.directions[order], rays.weights[order])
        limb, members, scores = _bundles(
            limbs, levels, rays.view[order], edges, rays.weights[order], len(rig), np.array(WEIGHTS)
        )
        best = np.argsort(-scores, kind="stable")
        owners = _assembled(limbs, limb[best], members[best], edges, rays.view[order])
        given = np.empty_like(owners)
        given[order] = owners
        people, joints, scores_3d = _triangulated(given, rays.origins, rays.directions, rays.weights)
        labels = _labels(given, people, rays.view)
        return estimate_of(joints, scores_3d, labels, detections.skeleton)


estimator = LimbAssociation()


def _limbs(skeleton: Skeleton) -> tuple[Integers, Floats]:
    """Return the limbs (L, 2) and how far from the trunk each is, 0 to 1, (L,).

    They are the bones of the skeleton and :data:`REDUNDANT` ones, of each side.
    """
    bones = set(map(frozenset, skeleton.edges))
    sides = [[f"left_{part}", f"right_{part}", part] for part in dict.fromkeys(sum(REDUNDANT, ()))]
    rows = {names[2]: [skeleton.joints.index(name) for name in names if name in skeleton.joints] for names in sides}
    for part, other in REDUNDANT:
        if part == other:
            bones.update([frozenset(rows[part])] if len(rows[part]) == 2 else [])
        elif len(rows[part]) == len(rows[other]):
            bones.update(map(frozenset, zip(rows[part], rows[other], strict=True)))
        else:
            bones.update(frozenset((one, two)) for one in rows[part] for two in rows[other])
    depth = np.full(len(skeleton), len(skeleton))
    depth[[k for k, part in enumerate(skeleton.parts) if part in _TRUNK]] = 0
    for _ in skeleton.joints:
        for bone in bones:
            one, two = sorted(bone)
            depth[one], depth[two] = min(depth[one], depth[two] + 1), min(depth[two], depth[one] + 1)
    limbs = np.array(sorted(sorted(bone) for bone in bones))
    level = depth[limbs].min(axis=1)
    return limbs, level / max(level.max(), 1)


@njit(cache=True)
def _matching_edges(view: Integers, origins: Floats, directions: Floats, weights: Floats) -> Floats:
    """Return the matching edges of each joint, (J, m, m): 1 for rays that meet, 0 for none; normalised as in the paper.

    Where the edges of a joint to one view add up to more than 1, they are divided by their sum.
    """
    m, joints = weights.shape
    edges = np.zeros((joints, m, m))
    for j in range(joints):
        for a in range(m):
            for b in range(m):
                if view[a] != view[b] and weights[a, j] > 0.0 and weights[b, j] > 0.0:
                    distance = ray_distance(origins[a], directions[a, j], origins[b], directions[b, j])
                    edges[j, a, b] = max(0.0, 1.0 - distance / FARTHEST)
        for _ in range(2):  # rows, then columns: the matrix is symmetric
            for a in range(m):
                start = 0
                while start < m:
                    end, total = start, 0.0
                    while end < m and view[end] == view[start]:
                        total += edges[j, a, end]
                        end += 1
                    if total > 1.0:
                        edges[j, a, start:end] /= total
                    start = end
            edges[j] = edges[j].T.copy()
    return edges


@njit(cache=True)
def _bundles(
    limbs: Integers, levels: Floats, view: Integers, edges: Floats, weights: Floats, views: int, shares: Floats
) -> tuple[Integers, Integers, Floats]:
    """Return all limb bundles: limb (k,), detection of each view or -1 (k, V), and score (k,)."""
    m = len(view)
    limb, members, scores = (
        [0 for _ in range(0)],
        [np.zeros(views, np.int64) for _ in range(0)],
        [0.0 for _ in range(0)],
    )
    start = np.zeros(views + 1, np.int64)
    for d in range(m):
        start[view[d] + 1] += 1
    start = np.cumsum(start)
    pick, chosen = np.empty(views, np.int64), np.full(views, -1)
    for index in range(len(limbs)):
        a, b = limbs[index]
        depth, count = 0, 0
        pick[0] = start[0] - 1  # one before the first: no detection of the view
        while depth >= 0:
            if depth == views:
                used = chosen[chosen >= 0]
                if len(used):
                    matching, pairs, parsing = 0.0, 0, 0.0
                    for p in range(len(used)):
                        parsing += np.sqrt(weights[used[p], a] * weights[used[p], b])
                        for q in range(p):
                            matching += 0.5 * (edges[a, used[p], used[q]] + edges[b, used[p], used[q]])
                            pairs += 1
                    score = shares[0] * (matching / pairs if pairs else 1.0) + shares[1] * parsing / len(used)
                    score += shares[2] * (1.0 - np.exp(-0.5 * (len(used) / VIEWS) ** 2))
                    score += shares[3] * (1.0 - levels[index] ** 4)
                    limb.append(index)
                    members.append(chosen.copy())
                    scores.append(score / shares.sum())
                    count += 1
                depth -= 1
                continue
            if count >= _MOST or pick[depth] >= start[depth + 1]:
                chosen[depth] = -1
                depth -= 1
                continue
            d = pick[depth]
            pick[depth] += 1
            if d < start[depth]:
                chosen[depth] = -1
            else:
                if not (weights[d, a] > 0.0 and weights[d, b] > 0.0):
                    continue
                fits = True
                for v in range(depth):
                    other = chosen[v]
                    fits = fits and (other < 0 or (edges[a, d, other] > 0.0 and edges[b, d, other] > 0.0))
                if not fits:
                    continue
                chosen[depth] = d
            depth += 1
            if depth < views:
                pick[depth] = start[depth] - 1
    k = len(limb)
    result = np.empty((k, views), np.int64)
    for row in range(k):
        result[row] = members[row]
    return np.array(limb), result, np.array(scores)


@njit(cache=True)
def _compatible(person: Integers, j: int, d: int, limbs: Integers, edges: Floats, view: Integers) -> int:
    """Return how many edges join a joint of a detection to a person (J, V), or -1 where one conflicts."""
    v, checks = view[d], 0
    if person[j, v] >= 0 and person[j, v] != d:
        return -1
    for index in range(len(limbs)):
        if limbs[index, 0] == j or limbs[index, 1] == j:
            other = person[limbs[index, 0] + limbs[index, 1] - j, v]
            if other >= 0:
                if other != d:  # no parsing edge joins two detections
                    return -1
                checks += 1
    for w in range(person.shape[1]):
        other = person[j, w]
        if w != v and other >= 0:
            if edges[j, d, other] <= 0.0:
                return -1
            checks += 1
    return checks


@njit(cache=True)
def _assembled(limbs: Integers, limb: Integers, members: Integers, edges: Floats, view: Integers) -> Integers:
    """Return the person of each joint of each detection, (m, J), or -1, from bundles in the order of their scores.

    All parts of a bundle are bundles as well, with scores of their own: where some views of one are in conflict, the
    others are taken now, and these are left for later.
    """
    joints, m = edges.shape[0], len(view)
    views = members.shape[1]
    owners = np.full((m, joints), -1)
    people = np.full((m * joints + 1, joints, views), -1)
    used = 0
    votes = np.zeros(m * joints + 1, np.int64)
    for row in range(len(limb)):
        ends, bundle = limbs[limb[row]], members[row][members[row] >= 0]
        votes[: used + 1] = 0
        for d in bundle:
            for j in ends:
                if owners[d, j] >= 0:
                    votes[owners[d, j]] += 1
        master = int(votes[:used].argmax()) if used else -1
        if master < 0 or votes[master] == 0:
            master = -1
            if len(bundle) == 1:  # a limb of one view joins the person to whom most edges lead
                most = 0
                for p in range(used):
                    one = _compatible(people[p], ends[0], bundle[0], limbs, edges, view)
                    two = _compatible(people[p], ends[1], bundle[0], limbs, edges, view)
                    if min(one, two) >= 0 and one + two > most:
                        master, most = p, one + two
            if master < 0:
                master = used
                used += 1
        for other in range(used):
            if other != master and votes[other] > 0 and _mergeable(people[master], people[other], limbs, edges, view):
                for j in range(joints):
                    for v in range(views):
                        if people[other, j, v] >= 0:
                            people[master, j, v] = people[other, j, v]
                            owners[people[other, j, v], j] = master
                people[other] = -1
        for d in bundle:
            fits = True
            for j in ends:
                fits = fits and owners[d, j] in (-1, master)
                fits = fits and _compatible(people[master], j, d, limbs, edges, view) >= 0
            if fits:
                for j in ends:
                    people[master, j, view[d]] = d
                    owners[d, j] = master
    return owners


@njit(cache=True)
def _mergeable(one: Integers, two: Integers, limbs: Integers, edges: Floats, view: Integers) -> bool:
    """Return whether two people (J, V) are without conflict in any view."""
    for j in range(two.shape[0]):
        for v in range(two.shape[1]):
            if two[j, v] >= 0 and _compatible(one, j, two[j, v], limbs, edges, view) < 0:
                return False
    return True


@njit(cache=True)
def _triangulated(
    owners: Integers, origins: Floats, directions: Floats, weights: Floats
) -> tuple[Integers, Floats, Floats]:
    """Return the people with enough keypoints (n,), their joints (n, J, 3), metres, and scores (n, J)."""
    m, joints = owners.shape
    count = owners.max() + 1 if owners.size else 0
    sizes = np.zeros(max(count, 1), np.int64)
    for d in range(m):
        for j in range(joints):
            if owners[d, j] >= 0:
                sizes[owners[d, j]] += 1
    people = np.flatnonzero(sizes >= ASSIGNED)
    result, scores = np.full((len(people), joints, 3), np.nan), np.zeros((len(people), joints))
    for row in range(len(people)):
        for j in range(joints):
            seen = np.flatnonzero(owners[:, j] == people[row])
            if len(seen) < 2:
                continue
            if nearest_point(origins[seen], directions[seen, j], weights[seen, j], result[row, j]):
                scores[row, j] = weights[seen, j].mean()
            else:
                result[row, j] = np.nan
    return people, result, scores


def _labels(owners: Integers, people: Integers, view: Integers) -> Integers:
    """Return the person of each detection, (m,): who owns most of its joints; one detection of a view in each."""
    votes = (owners[:, :, None] == people).sum(axis=1)
    labels = np.full(len(owners), -1)
    for flat in np.argsort(-votes, axis=None, kind="stable").tolist():
        detection, person = divmod(flat, max(len(people), 1))
        if not votes.size or votes[detection, person] == 0:
            break
        if labels[detection] < 0 and not ((labels == person) & (view == view[detection])).any():
            labels[detection] = person
    return labels
