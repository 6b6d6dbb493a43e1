"""Feedforward joint torques of a planned motion: inverse dynamics of a floating base with contacts.

A servo alone carries weight only after it deviates from the plan. So the torques that a plan needs are computed in
advance: accelerations and gravity require a wrench on the pelvis, which only the contacts of feet, hands or seat can
provide; the contact forces are distributed to be small (weighted least squares; Featherstone, "Rigid Body Dynamics
Algorithms", 2008, section 9) and transmitted through the joints.
"""

from collections.abc import Sequence
from copy import copy

import mujoco
import numpy as np

from mvpose.arrays import Floats, Integers

_NEAR = 0.02  # metres: contacts carry from this distance on, so that loads change gradually
_REGULARISATION = 0.03  # avoids wrenches that contacts could provide only by large opposed forces
_LEVER = 0.3  # metres: scale between torques and forces


class InverseDynamics:
    """Inverse dynamics of the planned motions of all people in one model.

    Args:
        model: MuJoCo model of all people and solids; it is copied.
        root_dofs, hinge_dofs: indices of the degrees of freedom of each person in ``qvel``, (P, 6) and (P, D).
    """

    def __init__(self, model: mujoco.MjModel, root_dofs: Integers, hinge_dofs: Integers) -> None:
        self._model = copy(model)
        self._model.geom_margin[:] = _NEAR
        self._data = mujoco.MjData(self._model)
        self._root_dofs, self._hinge_dofs = root_dofs, hinge_dofs
        owner = {int(root): i for i, root in enumerate(model.body_rootid[model.dof_bodyid[root_dofs[:, 0]]])}
        self._owner = np.array([owner.get(int(root), -1) for root in model.body_rootid])
        self._all = np.empty(model.nv)
        # Degrees of freedom that move each body: those of its joints and of the joints of its ancestors.
        self._moves = np.zeros((model.nbody, model.nv))
        for body in range(1, model.nbody):
            self._moves[body] = self._moves[model.body_parentid[body]]
            self._moves[body, model.body_dofadr[body] :][: model.body_dofnum[body]] = 1.0
        self._dofs = np.concatenate([root_dofs, hinge_dofs], axis=1)

    def torques(self, qpos: Floats, qvel: Floats, qacc: Floats, mocap: Sequence[tuple[int, Floats]]) -> Floats:
        """Return the hinge torques at one time, (P, D), N m.

        Args:
            qpos: planned configuration of the whole model.
            qvel: planned velocity.
            qacc: planned acceleration.
            mocap: mocap index and pose (7,) of each moving solid.
        """
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
        for k, pose in mocap:
            data.mocap_pos[k], data.mocap_quat[k] = pose[:3], pose[3:]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, self._all)
        result = self._all[self._hinge_dofs]
        contact = data.contact
        bodies = model.geom_bodyid[contact.geom]
        carries = np.clip(1 - contact.dist / _NEAR, 0.0, 1.0) ** 2
        for i, root in enumerate(self._root_dofs):
            contacts, side = np.nonzero((self._owner[bodies] == i) & (carries > 0)[:, None])
            if len(contacts):
                jacobian = self._jacobians(i, contact.pos[contacts], bodies[contacts, side])
                forces = _contact_forces(self._all[root], jacobian[..., :6], carries[contacts])
                result[i] -= np.einsum("mk,mkd->d", forces, jacobian[..., 6:])
        return result

    def _jacobians(self, person: int, points: Floats, bodies: Integers) -> Floats:
        """Return the Jacobians of points (m, 3) on bodies (m,) by pelvis and hinges of a person, (m, 3, 6 + D)."""
        data, dofs = self._data, self._dofs[person]
        spin, drift = data.cdof[dofs, :3], data.cdof[dofs, 3:]  # about the centre of mass of the person
        lever = points - data.subtree_com[self._model.body_rootid[bodies[0]]]
        moved = drift + np.cross(spin, lever[:, None])  # (m, 6 + D, 3)
        return (moved * self._moves[bodies][:, dofs, None]).swapaxes(1, 2)


def _contact_forces(wrench: Floats, jacobian: Floats, carries: Floats) -> Floats:
    """Return forces (m, 3) at contacts with Jacobians (m, 3, 6) that together exert a wrench (6,) on the pelvis."""
    scale = np.array([1.0, 1.0, 1.0, 1 / _LEVER, 1 / _LEVER, 1 / _LEVER])
    transmission = (jacobian * scale).reshape(-1, 6)  # (3 m, 6)
    weight = np.repeat(carries, 3)
    normal_matrix = transmission.T @ (weight[:, None] * transmission) + _REGULARISATION * np.eye(6)
    return (weight * (transmission @ np.linalg.solve(normal_matrix, scale * wrench))).reshape(-1, 3)
