"""Exact inference on the bones of a person: the best combination of states, and the covariances of the joints.

Both eliminate the joints in the order of :class:`mvpose.reconstruction.bone_graph.BoneGraph`: what a joint says is
passed on to the one or two joints that it is still joined to. A second pass in the opposite order completes the result.
"""

import numpy as np

from mvpose.kernels import njit
from mvpose.reconstruction.likelihood import solve
from mvpose.reconstruction.limb_direction_prior import direction_log_likelihood


@njit(cache=True)
def max_product(states, unary, count, graph, length, precision, pull):
    """Find the combination of states with the greatest sum of unaries and of pairwise terms of the bones.

    These are log-Gaussian in the length of a bone, and von Mises-Fisher in its direction.

    Args:
        states: candidate positions, (J, S, 3), metres.
        unary: log-likelihoods of the states, (J, S).
        count: number of valid states for each joint, (J,). A joint without any is skipped: it does not constrain its
            neighbours.
        graph: bones of the skeleton, :class:`mvpose.reconstruction.bone_graph.BoneGraph`.
        length: mean bone lengths, (B,), metres.
        precision: inverse variances of the lengths, (B,), 1/m^2; 0 for no constraint.
        pull: von Mises-Fisher parameters of the directions of bones, (B, 3); zeros for no constraint.

    Returns:
        Index of the chosen state of every joint, (J,), 0 for a joint without states; and that sum.
    """
    joints, most = len(count), 1
    for joint in range(joints):
        most = max(most, count[joint])
    belief, choice = np.zeros((joints, most)), np.empty((joints, most, most), np.int64)
    pairs = np.empty((joints, 2, most, most))  # terms of each joint with the joints that it is eliminated before
    for joint in range(joints):
        for s in range(count[joint]):
            belief[joint, s] = unary[joint, s]
        for slot in range(2):
            bone, other = graph.joint_bones[joint, slot], graph.later[joint, slot]
            others = count[other] if other >= 0 else 0
            for s in range(max(count[joint], 1)):
                for o in range(max(others, 1)):
                    pairs[joint, slot, s, o] = 0.0
            if bone < 0 or precision[bone] == 0.0:
                continue
            bent = pull[bone].any()
            for s in range(count[joint]):
                for o in range(others):
                    x = states[joint, s, 0] - states[other, o, 0]
                    y = states[joint, s, 1] - states[other, o, 1]
                    z = states[joint, s, 2] - states[other, o, 2]
                    error = np.sqrt(x * x + y * y + z * z) - length[bone]
                    pairs[joint, slot, s, o] = -0.5 * precision[bone] * error * error
                    if bent:
                        outward = graph.children[bone] == joint
                        pairs[joint, slot, s, o] += direction_log_likelihood(
                            states[joint, s], states[other, o], outward, pull[bone]
                        )
    chosen, total = np.zeros(joints, np.int64), 0.0
    for joint in graph.order:  # a joint without states takes part with one state that says nothing
        first, second = graph.later[joint]
        firsts, seconds = max(count[first], 1) if first >= 0 else 1, max(count[second], 1) if second >= 0 else 1
        for a in range(firsts):
            for b in range(seconds):
                best, argument = -np.inf, 0
                for s in range(max(count[joint], 1)):
                    value = belief[joint, s] + pairs[joint, 0, s, a] + pairs[joint, 1, s, b]
                    if value > best:
                        best, argument = value, s
                choice[joint, a, b] = argument
                if second >= 0:
                    pairs[first, _slot(graph, first, second), a, b] += best
                elif first >= 0:
                    belief[first, a] += best
                else:
                    total += best
    for joint in graph.order[::-1]:
        first, second = graph.later[joint]
        chosen[joint] = choice[joint, chosen[first] if first >= 0 else 0, chosen[second] if second >= 0 else 0]
    return chosen, total


@njit(cache=True, borrows=True)
def _slot(graph, joint, other):
    """Return the place of another joint among the two that a joint is eliminated before."""
    return 0 if graph.later[joint, 0] == other else 1


@njit(cache=True)
def marginalize(joints, information, covariance, graph, precision):
    """Compute the marginal covariances of a Gaussian with bones that each measure one length.

    Args:
        joints: positions, (J, 3), metres; NaN for a joint to leave out.
        information: information of each joint without bones, (J, 3, 3), 1/m^2; overwritten.
        covariance: output, (J, 3, 3), square metres; unchanged for a joint that is left out.
        graph: bones of the skeleton, :class:`mvpose.reconstruction.bone_graph.BoneGraph`.
        precision: inverse variances of the bone lengths, (B,), 1/m^2.
    """
    count = len(joints)
    coupling = np.zeros((count, 2, 3, 3))  # blocks of the information matrix with the joints eliminated later
    gain, cross = np.zeros((count, 2, 3, 3)), np.zeros((count, 2, 3, 3))
    inverse, known = np.zeros((count, 3, 3)), np.zeros(count, np.bool_)
    _couple(joints, information, coupling, graph, precision)
    for j in range(count):
        known[j] = not np.isnan(joints[j, 0])
    _eliminate(information, coupling, gain, inverse, known, graph, (np.zeros(3), np.empty(3)))
    _substitute(covariance, gain, cross, inverse, known, graph)


@njit(cache=True, borrows=True)
def _couple(joints, information, coupling, graph, precision):
    """Add the bones to the information of the joints, (J, 3, 3), and to its blocks between joints, (J, 2, 3, 3)."""
    for j in range(len(joints)):
        for slot in range(2):
            bone, other = graph.joint_bones[j, slot], graph.later[j, slot]
            if bone < 0 or precision[bone] == 0.0 or np.isnan(joints[j, 0]) or np.isnan(joints[other, 0]):
                continue
            x, y, z = joints[j, 0] - joints[other, 0], joints[j, 1] - joints[other, 1], joints[j, 2] - joints[other, 2]
            weight = precision[bone] / max(x * x + y * y + z * z, 1e-18)
            along = (x, y, z)
            for r in range(3):
                for c in range(3):
                    value = weight * along[r] * along[c]
                    information[j, r, c] += value
                    information[other, r, c] += value
                    coupling[j, slot, r, c] -= value


@njit(cache=True, borrows=True)
def _eliminate(information, coupling, gain, inverse, known, graph, work):
    """Eliminate the joints in order: write the gain of each joint, (J, 2, 3, 3), and its inverse information."""
    b, unused = work
    for j in graph.order:
        known[j] = known[j] and solve(information[j], b, inverse[j], unused)
        if not known[j]:
            continue
        first, second = graph.later[j, 0], graph.later[j, 1]
        for slot in range(2):
            if graph.later[j, slot] >= 0:
                _multiply(inverse[j], coupling[j, slot], gain[j, slot])
                _subtract(coupling[j, slot], gain[j, slot], information[graph.later[j, slot]])
        if second >= 0:
            _subtract(coupling[j, 0], gain[j, 1], coupling[first, _slot(graph, first, second)])


@njit(cache=True, borrows=True)
def _substitute(covariance, gain, cross, inverse, known, graph):
    """Write the covariance of each joint, (J, 3, 3), and with the joints eliminated later, (J, 2, 3, 3), in reverse.

    With x the joint, y those eliminated later and G the gain: cov(x, y) = -G cov(y), cov(x) = inverse - cov(x, y) G'.
    """
    for j in graph.order[::-1]:
        if not known[j]:
            continue
        first, second = graph.later[j, 0], graph.later[j, 1]
        for slot in range(2):
            one, other = graph.later[j, slot], graph.later[j, 1 - slot]
            if one < 0:
                continue
            for r in range(3):
                for c in range(3):
                    value = 0.0
                    for k in range(3):
                        if known[one]:
                            value -= gain[j, slot, r, k] * covariance[one, k, c]
                        if other >= 0:  # the two are joined, so the block between them is known
                            between = _slot(graph, first, second)
                            value -= gain[j, 1 - slot, r, k] * (
                                cross[first, between, k, c] if slot == 1 else cross[first, between, c, k]
                            )
                    cross[j, slot, r, c] = value
        for r in range(3):
            for c in range(3):
                value = inverse[j, r, c]
                for slot in range(2):
                    for k in range(3):
                        value -= cross[j, slot, r, k] * gain[j, slot, c, k]
                covariance[j, r, c] = value


@njit(cache=True, borrows=True)
def _multiply(a, b, result):
    for r in range(3):
        for c in range(3):
            result[r, c] = a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c]


@njit(cache=True, borrows=True)
def _subtract(a, b, result):
    """Subtract ``a.T @ b`` in place."""
    for r in range(3):
        for c in range(3):
            result[r, c] -= a[0, r] * b[0, c] + a[1, r] * b[1, c] + a[2, r] * b[2, c]
