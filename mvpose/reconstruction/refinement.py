"""Local refinement of one person's pose, and the covariance of every joint.

Expectation maximisation alternates between the responsibilities of the keypoints given the joints, and the joints
given the responsibilities; each joint is a 3 x 3 solve with the bones to its neighbours linearised. Two joints that are
mirror images and joined by a bone, such as the shoulders, are solved together, so that neither side comes first. No
step lowers the posterior. The covariances are the marginals of the Gaussian at the maximum, with the error scale
estimated from the person's residuals.
"""

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.error_scale import add_shared, fit_variances, observe, person_scale
from mvpose.reconstruction.inference import marginalize
from mvpose.reconstruction.likelihood import Noise, accumulate, anchor, log_likelihood, solve
from mvpose.reconstruction.limb_direction_prior import direction_log_likelihood
from mvpose.reconstruction.poses import MISSING_SCORE, gather
from mvpose.skeleton import Skeleton


def refine(
    joints: Floats, rays: Rays, skeleton: Skeleton, *, noise: Noise, length: Floats, deviation: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Move a pose of one person to the nearby maximum of likelihood times bone-length prior.

    Args:
        joints: initial pose, (J, 3), metres; NaN for a joint to leave out.
        rays: rays of the person's n detections.
        skeleton: the J joints.
        noise: error model of keypoints.
        length: mean bone lengths, (B,), metres, of :func:`mvpose.reconstruction.bone_graph.bone_graph`.
        deviation: standard deviations of the lengths, (B,), metres; infinite for no constraint.

    Returns:
        Joints (J, 3), scores (J,), covariances (J, 3, 3) and degrees of freedom (J,), as
        :class:`mvpose.reconstruction.poses.Poses`.
    """
    views = gather(
        np.zeros(len(rays), np.int64),
        0,
        rays.origins,
        rays.directions[:, :, None],
        rays.weights[:, :, None],
        noise.pixels * rays.pixel,
    )
    refined, scores = np.array(joints, float), np.zeros(len(joints))
    covariance, freedom = np.full((len(joints), 3, 3), np.nan), np.full(len(joints), np.nan)
    graph = bone_graph(skeleton)
    skeletal = (graph, length, graph.share / deviation**2)
    climb(refined, *views, noise.sigmas(skeleton), noise.floor, *skeletal)
    pose, sigmas = (refined, scores, covariance, freedom), noise.sigmas(skeleton)
    write_uncertainty(pose, views, sigmas, sigmas, noise.floor, graph, skeletal[2], np.zeros((len(length), 3)))
    return refined, scores, covariance, freedom


_SWEEPS = 8
_HALVINGS = 4
_CONVERGED = 1e-6  # m^2
_LONG = 4e-4  # m^2; a step below 2 cm turns no bone by much, so it cannot overshoot


@njit(cache=True)
def climb(joints, origins, directions, weights, pixel, sigmas, floor, graph, length, precision):
    """Move the joints (J, 3) to a maximum of the posterior, in place; joints that are NaN are skipped."""
    keypoints, bones = (origins, directions, weights, pixel, sigmas, floor), (graph.neighbours, graph.bones)
    work = np.empty((3, 3)), np.empty(3), np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3))
    for _ in range(_SWEEPS):
        if _sweep(joints, keypoints, graph.visits, graph.mate, bones, length, precision, work) < _CONVERGED:
            break


@njit(cache=True, borrows=True)
def _sweep(joints, keypoints, visits, mates, bones, length, precision, work):
    """Move each joint once, or together with its mate; return the squared length of the longest step, m^2."""
    origins, directions, weights, pixel, sigmas, floor = keypoints
    A, b, inverse, target, trial = work
    furthest = 0.0
    for j in visits:
        mate = mates[j]
        if mate < j and not np.isnan(joints[mate, 0]):
            continue  # moved together with its mate
        if np.isnan(joints[mate, 0]):
            mate = j
        if np.isnan(joints[j, 0]):
            continue
        members = (j, mate)
        size, shared, moved = (1 if mate == j else 2), -1, 0.0
        for k in range(size):
            joint = members[k]
            anchor(A, b)
            accumulate(
                joints[joint], origins, directions[joint], weights[joint], pixel, sigmas[joint], floor, 1.0, A, b
            )
            between = _add_bones(A, b, joint, members[1 - k], joints, bones, length, precision)
            shared = max(shared, between)
            if not solve(A, b, inverse[k], target[k]):
                target[k] = 0.0
                inverse[k] = 0.0
            for r in range(3):
                target[k, r] += joints[joint, r]
        if shared >= 0:
            _join(target, inverse, joints[j], joints[mate], length[shared], precision[shared])
        for k in range(size):
            step2 = 0.0
            for r in range(3):
                step2 += (target[k, r] - joints[members[k], r]) ** 2
            moved = max(moved, step2)
        goal = target
        if moved > _LONG:
            # The bones are linearised, so a long step can overshoot: it is taken only if the posterior rises.
            for k in range(size):
                for r in range(3):
                    trial[k, r] = joints[members[k], r]
            current = _local_posterior(trial, members, size, shared, joints, keypoints, bones, length, precision)
            step, climbs = 1.0, False
            for _ in range(_HALVINGS):
                for k in range(size):
                    for r in range(3):
                        trial[k, r] = joints[members[k], r] + step * (target[k, r] - joints[members[k], r])
                proposed = _local_posterior(trial, members, size, shared, joints, keypoints, bones, length, precision)
                climbs = proposed >= current
                if climbs:
                    break
                step *= 0.5
            if not climbs:
                continue
            goal = trial
        for k in range(size):
            for r in range(3):
                joints[members[k], r] = goal[k, r]
        furthest = max(furthest, moved)
    return furthest


@njit(cache=True, borrows=True)
def _join(target, inverse, here, there, length, precision):
    """Add the bone between two joints to their solutions (2, 3) without it, exactly for the linearised bone.

    The bone measures one length, so it changes both solutions by one force along it (Sherman-Morrison).
    """
    reach, softness, error = max(_distance(here, there), 1e-9), 1.0 / precision, -length
    for r in range(3):
        along = (here[r] - there[r]) / reach
        error += along * (target[0, r] - target[1, r])
        for c in range(3):
            softness += along * (inverse[0, r, c] + inverse[1, r, c]) * (here[c] - there[c]) / reach
    force = error / softness
    for r in range(3):
        for c in range(3):
            along = (here[c] - there[c]) / reach
            target[0, r] -= force * inverse[0, r, c] * along
            target[1, r] += force * inverse[1, r, c] * along


@njit(cache=True)
def fit_scale(joints, origins, directions, weights, pixel, sigmas, floor):
    """Return the ratio of the person's squared errors to those of the error model, at a pose (J, 3).

    Scaling the variances of the likelihood by this ratio has the same maximum as scaling the precision of the prior
    by it. See :func:`mvpose.reconstruction.error_scale.person_scale`.
    """
    count = len(joints)
    misfit, responsibilities = np.zeros(count), np.zeros(count)
    A, b = np.empty((3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            A[:] = 0.0
            b[:] = 0.0
            _, responsibilities[j], misfit[j] = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, A, b
            )
    return person_scale(misfit, responsibilities)


@njit(cache=True, borrows=True)
def _add_bones(A, b, j, mate, joints, bones, length, precision):
    """Add the bones that end in joint j to the normal equations of its step, linearised along their current directions.

    The bone to the mate is left out; its index is returned, or -1 where there is none.
    """
    shared = -1
    for slot in range(bones[0].shape[1]):
        other, bone = bones[0][j, slot], bones[1][j, slot]
        if other < 0 or precision[bone] == 0.0 or np.isnan(joints[other, 0]):
            continue
        if other == mate:
            shared = bone
            continue
        x, y, z = joints[j, 0] - joints[other, 0], joints[j, 1] - joints[other, 1], joints[j, 2] - joints[other, 2]
        current = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        x, y, z = x / current, y / current, z / current
        along = length[bone] - current
        weight = precision[bone]
        A[0, 0] += weight * x * x
        A[1, 1] += weight * y * y
        A[2, 2] += weight * z * z
        A[0, 1] += weight * x * y
        A[1, 0] += weight * x * y
        A[0, 2] += weight * x * z
        A[2, 0] += weight * x * z
        A[1, 2] += weight * y * z
        A[2, 1] += weight * y * z
        b[0] += weight * x * along
        b[1] += weight * y * along
        b[2] += weight * z * along
    return shared


@njit(cache=True, borrows=True)
def _local_posterior(points, members, size, shared, joints, keypoints, bones, length, precision):
    """Return the terms of the log-posterior that change when one or two joints move to ``points``, (2, 3)."""
    origins, directions, weights, pixel, sigmas, floor = keypoints
    value = 0.0
    for k in range(size):
        j, mate = members[k], members[1 - k]
        value += log_likelihood(points[k], origins, directions[j], weights[j], pixel, sigmas[j], floor)
        for slot in range(bones[0].shape[1]):
            other, bone = bones[0][j, slot], bones[1][j, slot]
            if other >= 0 and other != mate and precision[bone] > 0.0 and not np.isnan(joints[other, 0]):
                value -= 0.5 * precision[bone] * (_distance(points[k], joints[other]) - length[bone]) ** 2
    if shared >= 0:
        value -= 0.5 * precision[shared] * (_distance(points[0], points[1]) - length[shared]) ** 2
    return value


@njit(cache=True, borrows=True)
def _distance(a, b):
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


_MOST_ALIKE = 0.95  # of the variances; the keypoints of a detector never agree perfectly


@njit(cache=True)
def write_uncertainty(pose, views, sigmas, deviations, floor, graph, precision, pull):
    """Write scores (J,), covariances (J, 3, 3) and degrees of freedom (J,) of a pose at the maximum of its posterior.

    A pose is its joints (J, 3) and these three arrays, as in :class:`mvpose.reconstruction.poses.Poses`; its views are
    those of :func:`mvpose.reconstruction.poses.gather`. The pose was found with the standard deviations ``deviations``;
    those of the error model are ``sigmas``, (J,), metres. See :mod:`mvpose.reconstruction.error_scale`. A joint that is
    NaN is skipped, and one that no view supports becomes NaN.
    """
    joints, scores, covariance, freedom = pose
    origins, directions, weights, pixel = views
    n, count = len(pixel), len(joints)
    misfit, responsibilities, supports = np.zeros(count), np.zeros(count), np.zeros(count)
    information, b = np.zeros((count, 3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            support, _, _ = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, deviations[j], floor, 1.0, information[j], b
            )
            if support / n > MISSING_SCORE:
                scores[j] = support / n
                supports[j], responsibilities[j], misfit[j] = accumulate(
                    joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, information[j], b
                )
            else:  # no view supports it: placed by the prior alone
                for r in range(3):
                    joints[j, r] = np.nan
    relative, absolute = fit_variances(misfit, responsibilities, supports, sigmas)
    # Errors of calibration move all joints of a person alike, so that no bone shows or reduces them: their share of the
    # covariance from the keypoints bypasses the bones.
    alike, unused = np.zeros((count, 3, 3)), np.empty(3)
    b[:] = 0.0
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            view = origins, directions[j], weights[j], pixel, sigmas[j], floor
            freedom[j], share = observe(joints[j], view, relative, absolute, information[j])
            if share > 0.0:
                solve(information[j], b, alike[j], unused)
                share = min(share, _MOST_ALIKE)
                for r in range(3):
                    for c in range(3):
                        alike[j, r, c] *= share
                        information[j, r, c] /= 1.0 - share
    marginalize(joints, information, covariance, graph, precision)
    for j in range(count):
        for r in range(3):
            for c in range(3):
                covariance[j, r, c] += alike[j, r, c]
        add_shared(covariance[j], sigmas[j])
    _add_ambiguity(covariance, joints, origins, directions, weights, graph, precision, pull)


@njit(cache=True)
def _add_ambiguity(covariance, joints, origins, directions, weights, graph, precision, pull):
    """Add the depth ambiguity of joints that only one view sees, whose bones also fit at a second depth.

    The second moment around the chosen depth grows by the squared distance between the two depths times the
    probability of the other one (:mod:`mvpose.reconstruction.limb_direction_prior`). Single-view children of such a
    joint inherit its ambiguity. A joint whose child is seen by several views has none. With two parents, one of them a
    mirror image, the second depth and the inherited ambiguity are means.
    """
    count = len(joints)
    mirrored = np.empty(3)
    view, ambiguity = np.full(count, -1), np.zeros(count)  # the only view that sees a joint, and the added variance
    for j in range(count):
        views = 0
        for v in range(weights.shape[1]):
            if weights[j, v, 0] > 0.0:
                views, view[j] = views + 1, v
        if views != 1 or np.isnan(joints[j, 0]):
            view[j] = -1
    for j in graph.visits[::-1]:
        only, held, parents = view[j], False, 0
        if only < 0:
            continue
        depth, parent_depth, inherited = 0.0, 0.0, 0.0
        for r in range(3):
            depth += (joints[j, r] - origins[only, r]) * directions[j, only, 0, r]
        for slot in range(graph.neighbours.shape[1]):
            other, bone = graph.neighbours[j, slot], graph.bones[j, slot]
            if other < 0 or np.isnan(joints[other, 0]):
                continue
            if other != graph.inner[j, 0] and other != graph.inner[j, 1]:
                held = held or view[other] < 0
            elif precision[bone] > 0.0:
                parents += 1
                if other != graph.mate[j]:  # neither of two mates is the parent of the other
                    inherited += ambiguity[other]
                for r in range(3):
                    parent_depth += (joints[other, r] - origins[only, r]) * directions[j, only, 0, r]
        if held or parents == 0:
            continue
        parent_depth /= parents
        ambiguity[j] = inherited / parents
        if 2.0 * parent_depth - depth > 0.0:  # the other depth, in front of the camera
            for r in range(3):
                mirrored[r] = joints[j, r] + 2.0 * (parent_depth - depth) * directions[j, only, 0, r]
            log_odds = 0.0
            for slot in range(graph.neighbours.shape[1]):
                other, bone = graph.neighbours[j, slot], graph.bones[j, slot]
                if other >= 0 and graph.children[bone] == j and not np.isnan(joints[other, 0]):
                    log_odds += direction_log_likelihood(joints[j], joints[other], True, pull[bone])
                    log_odds -= direction_log_likelihood(mirrored, joints[other], True, pull[bone])
            ambiguity[j] += 4.0 * (parent_depth - depth) ** 2 / (1.0 + np.exp(log_odds))
        for r in range(3):
            for c in range(3):
                covariance[j, r, c] += ambiguity[j] * directions[j, only, 0, r] * directions[j, only, 0, c]
