"""3D pictorial structures straight from all detections, without matching (the paper's "No matching", section 4.2).

This is the approach of earlier methods (Belagiannis et al., PAMI 2016; Joo et al., PAMI 2017): the pictorial structure
itself decides which keypoints of different views belong together, for all people at once.

1. The states of a joint are the points where the rays of any two views meet (:mod:`mvpose.reconstruction.hypotheses`).
   The unary of a state is the sum over views of ``log(1 + score * exp(-e^2 / (2 sigma^2)) / floor)`` of the best
   keypoint that supports it: its log-likelihood ratio against a joint that is not there.
2. Max-product over the tree, with the log-Gaussian prior on bone lengths, finds the best pose; it may lack joints. The
   tree is used as it is and in the mirror, and the better pose counts, so that neither side is preferred.
3. The keypoints that support a pose, one per view and joint, are explained and serve no other pose. Step 2 is repeated
   with the remaining keypoints until no pose has enough joints.

Besides its cost, the approach has a weakness that tuning cannot remove: the keypoints of one detection are not known
to belong to one body until the pose is found, so a pose may take a limb of a nearby person where the bones fit. That
is why the paper matches first.
"""

from dataclasses import dataclass, replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.checks import check_numbers
from mvpose.kernels import njit
from mvpose.ordering import number_views
from mvpose.rays import Rays
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.bone_length_prior import bone_lengths
from mvpose.reconstruction.hypotheses import hypothesize, link
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.poses import Poses
from mvpose.reconstruction.refinement import refine
from mvpose.skeleton import Skeleton

_SHARED = 3  # least number of joints of a detection that a person must explain to be its label


@dataclass(frozen=True)
class UnmatchedPictorialStructure:
    """Reconstruction by 3DPS from all detections at once, without matching.

    Raises:
        ValueError: a parameter that is not above 0 (``apart``: below 0).
    """

    noise: Noise = Noise()
    """Error model of keypoints."""
    agreement: float = 3.0
    """Greatest distance between two rays that propose a state, in standard deviations."""
    reach: float = 4.0
    """Greatest error of a bone length, in standard deviations of the length and of the states at its ends."""
    least_joints: int = 6
    """Least number of joints of a person on which two or more views agree. It exceeds the five joints of a face: they
    lie within a hand's breadth, so all five agree where the rays of two faces meet by chance."""
    apart: float = 0.15
    """Least mean distance between corresponding joints of two people, metres; a chest is 0.25 m deep (ANSUR II). A
    nearer pose is the same person found again, with left and right exchanged or not."""
    most_states: int = 8
    """Greatest number of states that a keypoint proposes, the likeliest ones."""
    most_detections: int = 500
    """Greatest number of detections that are used; of more, the same number of each view, those with the greatest sums
    of scores. It bounds the time, which grows with the cube of this number."""

    def __post_init__(self) -> None:
        check_numbers(
            self,
            "the unmatched pictorial structure",
            positive=("agreement", "reach", "least_joints", "most_states", "most_detections"),
            not_negative=("apart",),
        )

    def __call__(self, rays: Rays, skeleton: Skeleton) -> tuple[Poses, Integers]:
        """Find all people.

        Args:
            rays: the m detections of all views.
            skeleton: the J joints.

        Returns:
            The poses, without joints on which no two views agree; and the person of each detection, (m,): the one who
            explains most of its joints, at least three, or -1. A person has two or more detections, at most one per
            view.
        """
        view = number_views(rays.view)
        order = np.argsort(view, kind="stable")
        by_view = replace(rays.select(order), view=view[order])
        used = _strongest(by_view, self.most_detections)
        order, by_view = order[used], by_view.select(used)
        found = self._find(by_view, skeleton)
        labels = np.full(len(rays), -1)
        labels[order] = _label(found, by_view.view)
        # People are numbered by their first detection; a pose with a single detection is dropped.
        people = [pose for pose in dict.fromkeys(labels.tolist()) if pose >= 0 and (labels == pose).sum() > 1]
        number = np.full(len(found.poses) + 1, -1)  # the last entry stays -1, for the label -1
        number[people] = np.arange(len(people))
        return Poses(*_polish(by_view, skeleton, found, people, self.noise)), number[labels]

    def _find(self, rays: Rays, skeleton: Skeleton) -> "_FoundPoses":
        space = hypothesize(rays, skeleton, noise=self.noise, agreement=self.agreement, most=self.most_states)
        trees = link(space, skeleton, noise=self.noise, reach=self.reach)
        graph = bone_graph(skeleton)
        found = _FoundPoses([], [], np.full(rays.weights.shape, -1), np.zeros(rays.weights.shape))
        unary = np.ones(len(space.points))
        _weigh(unary, rays.view, found.owner, space)
        while True:
            best = [_best_pose(unary, space, tree) for tree in trees]
            if max(bound for _, _, bound in best) < _SHARED:
                return found
            core, _, _ = max(best, key=itemgetter(1))
            pose = _attach(core, unary, rays.view, found.owner, space, trees[0], trees[-1], graph)
            if (pose >= 0).sum() < self.least_joints:
                unary[core[core >= 0]] = 0.0
                continue
            joints = np.where(pose[:, None] >= 0, space.points[pose], np.nan)
            found.person.append(_same_person(joints, found, skeleton, self.apart))
            _explain(pose, len(found.poses), rays.view, found.owner, found.evidence, space)
            found.poses.append(joints)
            _weigh(unary, rays.view, found.owner, space)


class _FoundPoses(NamedTuple):
    """Poses in the order in which they were found, and the keypoints that they explain."""

    poses: list[Floats]  # (J, 3), NaN where absent
    person: list[int]  # index of the first pose of the same person, often the pose itself
    owner: Integers  # pose that explains each keypoint, -1 for none, (m, J)
    evidence: Floats  # evidence of each keypoint for its owner, (m, J)


def _strongest(rays: Rays, most: int) -> Integers:
    """Return the indices of the detections to use, in their order: all, or the strongest of each view.

    Views take turns, so that a view full of false detections does not displace the detections of the others.
    """
    if len(rays) <= most:
        return np.arange(len(rays))
    strength = rays.weights.sum(axis=1)
    order = np.lexsort([-strength, rays.view])
    views, first = np.unique(rays.view[order], return_index=True)
    rank = np.empty(len(rays), np.int64)
    rank[order] = np.arange(len(rays)) - first[np.searchsorted(views, rays.view[order])]
    return np.sort(np.lexsort([-strength, rank])[:most])


def _same_person(joints: Floats, found: _FoundPoses, skeleton: Skeleton, apart: float) -> int:
    """Return the earlier pose that this one repeats, possibly with left and right exchanged, or else a new index."""
    if not found.poses:
        return 0
    earlier = np.stack(found.poses)
    same = np.zeros(len(earlier), bool)
    for poses in (earlier, earlier[:, list(skeleton.mirror)]):
        distance = np.linalg.norm(joints - poses, axis=2)
        shared = np.isfinite(distance).sum(axis=1)
        same |= (shared > 0) & (np.nansum(distance, axis=1) < apart * shared)
    return found.person[int(np.argmax(same))] if same.any() else len(earlier)


def _label(found: _FoundPoses, view: Integers) -> Integers:
    """Assign detections to people by the number of explained joints, the clearest first, (m,)."""
    votes, evidence = np.zeros((2, len(view), len(found.poses)))
    detection, joint = np.nonzero(found.owner >= 0)
    person = np.array(found.person, np.int64)[found.owner[detection, joint]]
    np.add.at(votes, (detection, person), 1)
    np.add.at(evidence, (detection, person), found.evidence[detection, joint])
    labels, taken = np.full(len(view), -1), set()
    detection, person = np.nonzero(votes >= _SHARED)
    for k in np.lexsort([-evidence[detection, person], -votes[detection, person]]):
        place = (view[detection[k]], person[k])
        if labels[detection[k]] < 0 and place not in taken:
            labels[detection[k]] = person[k]
            taken.add(place)
    return labels


def _polish(
    rays: Rays, skeleton: Skeleton, found: _FoundPoses, people: list[int], noise: Noise
) -> tuple[Floats, Floats, Floats, Floats]:
    """Refine poses on the keypoints that they explain, with the keypoints of a view taken as one detection."""
    shape = (len(people), len(skeleton))
    joints, scores = np.zeros((*shape, 3)), np.zeros(shape)
    covariance, freedom = np.zeros((*shape, 3, 3)), np.zeros(shape)
    length, deviation = bone_lengths(skeleton)
    for k, pose in enumerate(people):
        detection, joint = np.nonzero(found.owner == pose)
        views, first, row = np.unique(rays.view[detection], return_index=True, return_inverse=True)
        directions, weights = np.zeros((len(views), shape[1], 3)), np.zeros((len(views), shape[1]))
        directions[row, joint] = rays.directions[detection, joint]
        weights[row, joint] = rays.weights[detection, joint]
        representative = detection[first]
        joints[k], scores[k], covariance[k], freedom[k] = refine(
            found.poses[pose],
            Rays(views, rays.origins[representative], directions, weights, rays.pixel[representative]),
            skeleton,
            noise=noise,
            length=length,
            deviation=deviation,
        )
    return joints, scores, covariance, freedom


@njit(cache=True)
def _weigh(unary, view, owner, space):
    """Update unaries from the keypoints not yet explained; 0, permanently, where fewer than two views give support."""
    for joint in range(len(space.start) - 1):
        for state in range(space.start[joint], space.start[joint + 1]):
            if unary[state] == 0.0:
                continue
            total, best, views, last = 0.0, 0.0, 0, -1
            for k in range(space.support_start[state], space.support_start[state + 1]):
                if owner[space.support[k], joint] >= 0:
                    continue
                if view[space.support[k]] != last:
                    last = view[space.support[k]]
                    total += best
                    best = 0.0
                    views += 1
                best = max(best, space.evidence[k])
            unary[state] = total + best if views > 1 else 0.0


@njit(cache=True)
def _best_pose(unary, space, tree):
    """Find the connected part of a tree, and its states, with the greatest sum of unaries minus bone costs.

    Returns:
        State of every joint, (J,), -1 where the pose lacks it; that sum; and an upper bound on the number of joints of
        a pose.
    """
    order, parents = tree.order, tree.parents
    joints, most = len(parents), 0
    for joint in range(joints):
        most = max(most, space.start[joint + 1] - space.start[joint])
    value, size = unary.copy(), np.ones(len(unary), np.int64)  # of the best pose with the state at its root
    choice = np.full((joints, most), -1)  # best state of a joint for each state of its parent
    message, larger = np.zeros(most), np.zeros(most, np.int64)
    chosen, root, top, best, bound = np.full(joints, -1), 0, -1, 0.0, 0
    for joint in order[::-1]:
        parent = parents[joint]
        message[:] = 0.0
        larger[:] = 0
        for state in range(space.start[joint], space.start[joint + 1]):
            if unary[state] == 0.0:
                continue
            bound = max(bound, size[state])
            if value[state] > best:
                best, root, top = value[state], joint, state
            for k in range(tree.start[state], tree.start[state + 1]):
                slot = tree.state[k] - space.start[parent]
                larger[slot] = max(larger[slot], size[state])
                if value[state] - tree.cost[k] > message[slot]:
                    message[slot] = value[state] - tree.cost[k]
                    choice[joint, slot] = state
        if parent >= 0:
            for slot in range(space.start[parent + 1] - space.start[parent]):
                value[space.start[parent] + slot] += message[slot]
                size[space.start[parent] + slot] += larger[slot]
    if top >= 0:
        chosen[root] = top
        for joint in order:
            if parents[joint] >= 0 and chosen[parents[joint]] >= 0:
                chosen[joint] = choice[joint, chosen[parents[joint]] - space.start[parents[joint]]]
    return chosen, best, bound


@njit(cache=True)
def _attach(core, unary, view, owner, space, tree, image, graph):
    """Add joints that a missing joint disconnects from the pose, where two detections of the person agree on them.

    The detection of the person in a view is the one that supports most joints of the pose, at least three.

    Args:
        core: state of every joint, (J,), -1 where the pose lacks it.
        unary: unaries of the states, (S,).
        view: camera of each detection, (m,).
        owner: pose that explains each keypoint, (m, J), -1 for none.
        space: states of all joints.
        tree: links along the kinematic tree.
        image: links along its mirror image.
        graph: bones of the skeleton.
    """
    pose = core.copy()
    votes = np.zeros(len(view))
    for joint in range(len(pose)):
        if pose[joint] >= 0:
            for k in range(space.support_start[pose[joint]], space.support_start[pose[joint] + 1]):
                if owner[space.support[k], joint] < 0:
                    votes[space.support[k]] += 1.0 + 1e-6 * space.evidence[k]  # the evidence breaks ties
    of_person = votes >= _SHARED
    for d in range(len(view)):
        for other in range(len(view)):
            if view[other] == view[d] and votes[other] > votes[d]:
                of_person[d] = False
    for joint in graph.visits[::-1]:
        mate = graph.mate[joint]
        if mate > joint:
            continue  # chosen together with its mate, so that neither side comes first
        state, total = _fitting_state(joint, pose, unary, of_person, owner, space, tree, image)
        other, other_total = _fitting_state(mate, pose, unary, of_person, owner, space, tree, image)
        if mate != joint and state >= 0 and other >= 0:
            pose[joint] = state
            if _fits(mate, other, pose, tree) and _fits(mate, other, pose, image):
                pose[mate] = other
            elif other_total > total:
                pose[joint], pose[mate] = -1, other
        elif state >= 0:
            pose[joint] = state
        elif other >= 0:
            pose[mate] = other
    return pose


@njit(cache=True)
def _fitting_state(joint, pose, unary, of_person, owner, space, tree, image):
    """Return the state of a missing joint that fits the pose with the greatest evidence, and that; -1 if none does."""
    best, chosen = 0.0, -1
    if pose[joint] >= 0:
        return chosen, best
    for state in range(space.start[joint], space.start[joint + 1]):
        if unary[state] == 0.0:
            continue
        total, views = 0.0, 0
        for k in range(space.support_start[state], space.support_start[state + 1]):
            if of_person[space.support[k]] and owner[space.support[k], joint] < 0:
                total += space.evidence[k]
                views += 1
        if views < 2 or total <= best:
            continue
        if _fits(joint, state, pose, tree) and _fits(joint, state, pose, image):
            best, chosen = total, state
    return chosen, best


@njit(cache=True)
def _fits(joint, state, pose, tree):
    """Return whether a state of a joint is a bone length away from those of its neighbours that the pose has."""
    fits = True
    for other in range(len(pose)):
        if pose[other] >= 0 and tree.parents[joint] == other:
            fits = fits and (not tree.known[joint] or _linked(state, pose[other], tree))
        elif pose[other] >= 0 and tree.parents[other] == joint:
            fits = fits and (not tree.known[other] or _linked(pose[other], state, tree))
    return fits


@njit(cache=True)
def _linked(child, parent, tree):
    return (tree.state[tree.start[child] : tree.start[child + 1]] == parent).any()


@njit(cache=True)
def _explain(pose, index, view, owner, strength, space):
    """Assign to a pose the best free keypoint of every view that supports each of its joints."""
    for joint in range(len(pose)):
        if pose[joint] < 0:
            continue
        best, last = -1, space.support_start[pose[joint] + 1]
        for k in range(space.support_start[pose[joint]], last):
            if owner[space.support[k], joint] < 0 and (best < 0 or space.evidence[k] > space.evidence[best]):
                best = k
            if best >= 0 and (k + 1 == last or view[space.support[k + 1]] != view[space.support[k]]):
                owner[space.support[best], joint] = index
                strength[space.support[best], joint] = space.evidence[best]
                best = -1
    # A keypoint is taken only after all keypoints of its view were compared, so no pose takes two per view and joint.
