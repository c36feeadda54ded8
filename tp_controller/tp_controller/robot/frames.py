"""Frames of a robot at its present configuration, and how a model follows the velocities."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.robot.reach import joint_path
from tp_controller.robot.space import Space

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Coupling(NamedTuple):
    """How the m velocities of a model follow the n that can be chosen: ``v_model = S qd``.

    Joints with one coordinate follow in the same way, ``q_model = S q + offset``.
    """

    S: Matrix
    """(m, n)."""
    offset: Vector
    """(m,) [rad, m]."""


def coupled(
    model: pin.Model,
    space: Space,
    followers: Mapping[str, tuple[str, float, float]] | None = None,
) -> Coupling | None:
    """How a model follows the velocities of a space; None if they are the same.

    Parameters
    ----------
    model
        The model; its joints are those of the space, by name, and their followers.
    space
        The space. Of a differential drive the model's planar joint has a velocity more.
    followers
        For joints that follow another: its name, a factor and an offset [rad, m].
    """
    S, offset = np.zeros((model.nv, space.nv)), np.zeros(model.nv)
    first = dict(zip(space.joints, space.first_v, strict=True))
    kept = {block.joint: block.kept for block in space.blocks}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        leader, factor, shift = (followers or {}).get(name, (name, 1.0, 0.0))
        for i, row in enumerate(kept.get(name, (0,))):
            S[joint.idx_v + row, first[leader] + i] = factor
        offset[joint.idx_v] = shift
    same = S.shape[0] == S.shape[1] and np.array_equal(S, np.eye(len(S)))
    return None if same and not offset.any() else Coupling(S, offset)


class Frame:
    """Pose and Jacobian of one frame at the robot's present configuration."""

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        index: int,
        coupling: Coupling | None,
        stamp: list[int],
    ) -> None:
        self.name: str = model.frames[index].name
        self._model = model
        self._data = data
        self.index = index
        self._coupling = coupling
        self._stamp = stamp
        self._jacobian: Matrix = np.zeros((6, 0))
        self._hessian: NDArray[np.float64] = np.zeros((6, 0, 0))
        self._jacobian_stamp = self._hessian_stamp = -1
        self._own_chain: NDArray[np.int64] | None = None
        # Views into Pinocchio's data: they follow every update without a call.
        pose = data.oMf[index]
        self.position: Vector = pose.translation
        """Origin (3,) [m] in the base frame; a read-only view."""
        self.rotation: Matrix = pose.rotation
        """Orientation (3, 3) in the base frame; a read-only view."""
        self.position.flags.writeable = False
        self.rotation.flags.writeable = False

    @classmethod
    def standing(cls, name: str, n: int) -> Frame:
        """Frame at the origin that none of the n joints moves."""
        model = pin.Model()
        frame = cls(model, model.createData(), 0, None, [0])
        frame.name = name
        frame._jacobian = np.zeros((6, n))
        frame._hessian = np.zeros((6, n, n))
        frame._jacobian_stamp = frame._hessian_stamp = 0
        return frame

    @property
    def jacobian(self) -> Matrix:
        """Jacobian (6, n) to the frame's twist [v; ω], both in the base frame; read-only."""
        if self._jacobian_stamp != self._stamp[0]:
            jacobian = self.model_jacobian()
            self._jacobian = jacobian if self._coupling is None else jacobian @ self._coupling.S
            self._jacobian.flags.writeable = False
            self._jacobian_stamp = self._stamp[0]
        return self._jacobian

    @property
    def hessian(self) -> NDArray[np.float64]:
        """Derivative (6, n, n) of the Jacobian by the joints, the last index; read-only."""
        if self._hessian_stamp != self._stamp[0]:
            # Compiled, or loaded, for those that need it.
            from tp_controller.robot.curvature import chain_hessian

            jacobian = self.model_jacobian()
            hessian = np.zeros((6, jacobian.shape[1], jacobian.shape[1]))
            if self._own_chain is None:
                self._own_chain = self.chain()
            chain_hessian(jacobian, self._own_chain, self.joint_of, hessian)
            if self._coupling is not None:
                S = self._coupling.S
                hessian = np.einsum('rij,ik,jl->rkl', hessian, S, S)
            self._hessian = hessian
            self._hessian.flags.writeable = False
            self._hessian_stamp = self._stamp[0]
        return self._hessian

    def chain(self, reference: Frame | None = None) -> NDArray[np.int64]:
        """Velocity indices of the model's joints (p,) from a reference, or the base, to here."""
        frames = self._model.frames
        start = 0 if reference is None else frames[reference.index].parentJoint
        path = joint_path(self._model, frames[self.index].parentJoint, start)
        joints = [self._model.joints[joint] for joint, _ in reversed(path)]
        return np.array([joint.idx_v + i for joint in joints for i in range(joint.nv)], int)

    @cached_property
    def joint_of(self) -> NDArray[np.int64]:
        """Joint (m,) that each velocity of the model belongs to."""
        counts = [joint.nv for joint in self._model.joints[1:]]
        return np.repeat(np.arange(len(counts), dtype=np.int64), counts)

    def model_jacobian(self) -> Matrix:
        """Jacobian (6, m) to the twist in the base frame, by the joints of the model."""
        jacobian = pin.getFrameJacobian(
            self._model, self._data, self.index, pin.LOCAL_WORLD_ALIGNED
        )
        # A single column arrives as a vector.
        return jacobian.reshape(6, -1)
