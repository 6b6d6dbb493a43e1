"""What a planned motion asks of the muscles: inverse dynamics, with the ground carrying what floats.

A servo that is to carry weight alone must first give way. So the torques that a plan needs are reckoned beforehand:
accelerations and gravity ask for a wrench on the pelvis, which nothing holds but the contacts of feet, hands or seat;
their forces are shared out so that they are small (weighted least squares; Featherstone, "Rigid Body Dynamics
Algorithms", 2008, section 9), and passed on through the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import mujoco
import numpy as np

from mvpose.arrays import Floats, Integers

_NEAR = 0.02  # metres: what is this near begins to carry, and so nothing is loaded at a blow
_LOOSE = 0.03  # regularises: a wrench that the contacts could hold only by great opposed forces is not asked of them
_LEVER = 0.3  # metres, which make a torque comparable with a force


class InverseDynamics:
    """Reckons with plans for all people of one model.

    Args:
        model: everybody and everything; it is copied.
        root_dofs, hinge_dofs: of every person, in ``qvel``, (6,) and (D,).
    """

    def __init__(self, model: mujoco.MjModel, root_dofs: Sequence[Integers], hinge_dofs: Sequence[Integers]) -> None:
        self._model = copy(model)
        self._model.geom_margin[:] = _NEAR
        self._data = mujoco.MjData(self._model)
        self._root_dofs, self._hinge_dofs = root_dofs, hinge_dofs
        pelvises = [int(model.dof_bodyid[dofs[0]]) for dofs in root_dofs]
        owner = {int(model.body_rootid[pelvis]): i for i, pelvis in enumerate(pelvises)}
        self._owner = np.array([owner.get(int(root), -1) for root in model.body_rootid])
        self._all = np.empty(model.nv)
        # Which velocities move which body: those of its own joints and of its ancestors'.
        self._moves = np.zeros((model.nbody, model.nv))
        for body in range(1, model.nbody):
            self._moves[body] = self._moves[model.body_parentid[body]]
            self._moves[body, model.body_dofadr[body] :][: model.body_dofnum[body]] = 1.0
        self._dofs = [np.concatenate([root, hinges]) for root, hinges in zip(root_dofs, hinge_dofs, strict=True)]

    def torques(self, qpos: Floats, qvel: Floats, qacc: Floats, mocap: Sequence[tuple[int, Floats]]) -> Floats:
        """What the hinges must do at one instant, (P, D) N m.

        Args:
            qpos: planned configuration of the whole model.
            qvel: its velocity.
            qacc: its acceleration.
            mocap: index and pose (7,) of what moves by itself.
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
        result = np.stack([self._all[hinges] for hinges in self._hinge_dofs])
        contact = data.contact
        bodies = model.geom_bodyid[contact.geom]
        carries = np.clip(1 - contact.dist / _NEAR, 0.0, 1.0) ** 2
        for i, root in enumerate(self._root_dofs):
            theirs, side = np.nonzero((self._owner[bodies] == i) & (carries > 0)[:, None])
            if len(theirs):
                jacobian = self._jacobians(i, contact.pos[theirs], bodies[theirs, side])
                forces = _shared_out(self._all[root], jacobian[..., :6], carries[theirs])
                result[i] -= np.einsum("mk,mkd->d", forces, jacobian[..., 6:])
        return result

    def _jacobians(self, person: int, places: Floats, bodies: Integers) -> Floats:
        """How points (m, 3) of bodies (m,) move with a person's pelvis and hinges, (m, 3, 6 + D)."""
        data, dofs = self._data, self._dofs[person]
        spin, drift = data.cdof[dofs, :3], data.cdof[dofs, 3:]  # about the person's centre of mass
        lever = places - data.subtree_com[self._model.body_rootid[bodies[0]]]
        moved = drift + np.cross(spin, lever[:, None])  # (m, 6 + D, 3)
        return (moved * self._moves[bodies][:, dofs, None]).swapaxes(1, 2)


def _shared_out(wanted: Floats, jacobian: Floats, carries: Floats) -> Floats:
    """Forces (m, 3) at contacts of jacobians (m, 3, 6) that together are a wrench (6,) on the pelvis."""
    scale = np.array([1.0, 1.0, 1.0, 1 / _LEVER, 1 / _LEVER, 1 / _LEVER])
    hold = (jacobian * scale).reshape(-1, 6)  # (3 m, 6)
    weight = np.repeat(carries, 3)
    share = np.linalg.solve(hold.T @ (weight[:, None] * hold) + _LOOSE * np.eye(6), scale * wanted)
    return (weight * (hold @ share)).reshape(-1, 3)
