"""One kinematic model for every arm, on Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.limits import Limits

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Robot:
    """An arm's kinematics at one configuration at a time.

    Parameters
    ----------
    model
        Pinocchio model whose universe is the base frame and whose joints are those of
        ``joints``, in that order.
    joints
        Joint names (n,).
    base_frame
        Name of the frame that everything is expressed in.
    limits
        Joint limits; absent means unlimited.

    Raises
    ------
    InvalidValue
        If there is no joint or a name stands twice.
    """

    def __init__(
        self,
        model: pin.Model,
        joints: Sequence[str],
        base_frame: str = 'base',
        limits: Limits | None = None,
    ) -> None:
        self.joints = tuple(joints)
        if not self.joints:
            raise InvalidValue('robot.joints', 'no joint', 'one or more joint names')
        if len(set(self.joints)) != len(self.joints):
            raise InvalidValue('robot.joints', shown(self.joints), 'every joint once')
        self.n = len(self.joints)
        self.base_frame = base_frame
        self.limits = limits if limits is not None else Limits(self.n)
        self._model = model
        self._data = model.createData()
        self._q = np.zeros(self.n)
        self._root: Vector = np.array(model.jointPlacements[1].translation)
        self._frames = {
            frame.name: Frame(model, self._data, i)
            for i, frame in enumerate(model.frames)
            if frame.type in (pin.OP_FRAME, pin.BODY)
        }
        if base_frame in self._frames:
            raise InvalidValue(
                'robot.base_frame',
                shown(base_frame),
                f'a name that no link frame has ({listed(self.frames)})',
            )
        self.update(self._q)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames that tasks can control, from the base outwards."""
        return tuple(self._frames)

    @property
    def q(self) -> Vector:
        """Configuration (n,) [rad, m] of the last update; a read-only view."""
        view = self._q.view()
        view.flags.writeable = False
        return view

    def frame(self, name: str) -> Frame:
        """Frame of that name, the same object at every call.

        Raises
        ------
        InvalidValue
            If the robot has no such frame.
        """
        try:
            return self._frames[name]
        except KeyError:
            raise InvalidValue('frame', shown(name), f'one of {listed(self.frames)}') from None

    def skeleton(self) -> Matrix:
        """Points (m, 3) [m] that a line through the arm connects, from the base outwards."""
        return np.array([self._root, *(frame.position for frame in self._frames.values())])

    def joint_indices(self, names: Sequence[str]) -> list[int]:
        """Indices of the named joints.

        Raises
        ------
        InvalidValue
            If the robot has no such joint, or one is named twice.
        """
        for name in names:
            if name not in self.joints:
                raise InvalidValue('joints', shown(name), f'some of {listed(self.joints)}')
        if len(set(names)) != len(names):
            raise InvalidValue('joints', shown(list(names)), 'every joint once')
        return [self.joints.index(name) for name in names]

    def update(self, q: Vector) -> None:
        """Move every frame to configuration ``q`` (n,) [rad, m]."""
        self._q[:] = q
        pin.computeJointJacobians(self._model, self._data, self._q)
        pin.updateFramePlacements(self._model, self._data)
        for frame in self._frames.values():
            frame.moved()


class Frame:
    """Pose and Jacobian of one frame at the robot's present configuration."""

    def __init__(self, model: pin.Model, data: pin.Data, index: int) -> None:
        self.name: str = model.frames[index].name
        self._model = model
        self._data = data
        self._index = index
        self._jacobian: Matrix | None = None
        # Views into Pinocchio's data: they follow every update without a call.
        pose = data.oMf[index]
        self.position: Vector = pose.translation
        """Origin (3,) [m] in the base frame; a read-only view."""
        self.rotation: Matrix = pose.rotation
        """Orientation (3, 3) in the base frame; a read-only view."""
        self.position.flags.writeable = False
        self.rotation.flags.writeable = False

    @property
    def jacobian(self) -> Matrix:
        """Jacobian (6, n) to the frame's twist [v; ω], both in the base frame; read-only."""
        if self._jacobian is None:
            jacobian = pin.getFrameJacobian(
                self._model, self._data, self._index, pin.LOCAL_WORLD_ALIGNED
            )
            # A single column arrives as a vector.
            self._jacobian = jacobian.reshape(6, -1)
            self._jacobian.flags.writeable = False
        return self._jacobian

    def moved(self) -> None:
        """Forget the Jacobian of the configuration before."""
        self._jacobian = None
