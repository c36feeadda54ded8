"""One kinematic model for every arm, on Pinocchio."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.limits import Limits
from tp_controller.robot.reach import Path, crossings, joint_path, path_speeds
from tp_controller.robot.response import Response
from tp_controller.robot.shapes import Shape

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LINKS = (pin.OP_FRAME, pin.BODY)
"""Kinds of frames that tasks may control."""


class Coupling(NamedTuple):
    """How the m joints of a model follow the n controlled ones: ``q_model = S q + offset``."""

    S: Matrix
    """(m, n)."""
    offset: Vector
    """(m,) [rad, m]."""


class Robot:
    """An arm's kinematics at one configuration at a time.

    Parameters
    ----------
    model
        Pinocchio model whose universe is the base frame and whose joints have one position
        each.
    joints
        Names of the controlled joints (n,).
    base_frame
        Name of the frame that everything is expressed in.
    limits
        Joint limits; absent means unlimited.
    coupling
        How the joints of the model follow the controlled ones; absent means that they are
        the same, in the same order.
    lines
        Pairs that a picture of the arm connects: a frame or a fixed point (3,) [m], and a
        frame beyond it.
    wrapping
        For every joint whether whole turns make no difference (n,); absent means no.

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
        coupling: Coupling | None = None,
        lines: Sequence[tuple[str | Vector, str]] = (),
        wrapping: Sequence[bool] | None = None,
    ) -> None:
        self.joints = tuple(joints)
        if not self.joints:
            raise InvalidValue('robot.joints', 'no joint', 'one or more joint names')
        if len(set(self.joints)) != len(self.joints):
            raise InvalidValue('robot.joints', shown(self.joints), 'every joint once')
        self.n = len(self.joints)
        self.base_frame = base_frame
        self.limits = limits if limits is not None else Limits(self.n)
        self.response = Response.of(self.n)
        """What the arm makes of its commands; ideal at first. Tasks and stacks that are made
        later go by it."""
        self.wrapping = tuple(wrapping) if wrapping is not None else (False,) * self.n
        self._model = model
        self._data = model.createData()
        self._crossings = crossings(model)
        self.coupling = coupling
        """How the joints of the model follow the controlled ones, None if they are the same."""
        self._q = np.zeros(self.n)
        self._q_view = self._q.view()
        self._q_view.flags.writeable = False
        # Without a coupling the model's configuration is the robot's own.
        self._q_model = self._q if coupling is None else np.zeros(model.nq)
        self._stamp = np.zeros(1, dtype=np.int64)
        self._frames = {
            frame.name: Frame(model, self._data, i, coupling, self._stamp)
            for i, frame in enumerate(model.frames)
            if frame.type in LINKS
        }
        # Views into Pinocchio's data: they follow every update without a call.
        self.twists: Matrix = self._data.J.reshape(6, -1, order='F').T
        """Twist (m, 6) [v; ω] of every joint of the model per unit of its speed, in the base
        frame, of the last update."""
        self.poses = _poses(self._data)
        """Columns of the rotation, then position [m] (nf, 4, 3) of every frame of the model."""
        self.base: Frame = Frame.standing(base_frame, self.n)
        """The base frame itself, which never moves."""
        self._lines = lines
        self.disabled_pairs: frozenset[frozenset[str]] = frozenset()
        """Pairs of links that need not be kept apart, by name."""
        self.body_source: Callable[[], Mapping[str, tuple[Shape, ...]]] = dict
        """Makes `bodies` when they are first asked for."""
        self.update(self._q)

    @staticmethod
    def from_urdf(
        path: str | os.PathLike[str],
        joints: Sequence[str] | None = None,
        base_frame: str | None = None,
        limits: Mapping[str, float | Sequence[float]] | None = None,
        rest_positions: Mapping[str, float] | None = None,
        link_radius: float | Sequence[float] | None = None,
        srdf: str | None = None,
    ) -> Robot:
        """Make a robot of a URDF file; its links are the frames.

        Parameters
        ----------
        path
            A path, or ``package://<package>/<path>``, see `read_description`.
        joints, base_frame, rest_positions
            As `urdf_robot`.
        limits
            Limits by name in place of the description's, as the arguments of `Limits`.
        link_radius
            Radius [m] of capsules along the links, see `robot_bodies`; the description's
            collision shapes when left out.
        srdf
            Path of an SRDF whose ``disable_collisions`` tasks leave out.

        Raises
        ------
        InvalidValue
            If there is no such file or it cannot be used.
        """
        from tp_controller.robot.make import robot_from_urdf

        return robot_from_urdf(path, joints, base_frame, limits, rest_positions, link_radius, srdf)

    @staticmethod
    def from_dh(
        a: Sequence[float],
        alpha: Sequence[float] | None = None,
        d: Sequence[float] | None = None,
        theta: Sequence[float] | None = None,
        types: Sequence[str] | None = None,
        **others: Any,
    ) -> Robot:
        """Make a robot of Denavit-Hartenberg parameters, with the frames ``link_1`` and so on.

        Parameters
        ----------
        a, alpha, d, theta
            Link lengths [m], twists [rad], offsets [m] and angles [rad] of the joints (n,), see
            `DHParameters`; zero when left out.
        types
            ``revolute`` or ``prismatic`` (n,); revolute when left out.
        others
            ``joints`` (names; ``joint_1`` and so on when left out), ``base_frame``,
            ``base_pose``, ``convention`` as `dh_robot`, ``limits`` and ``link_radius`` as
            `from_urdf`.

        Raises
        ------
        InvalidValue
            As `dh_robot`.
        """
        from tp_controller.robot.make import robot_from_dh

        return robot_from_dh(a, alpha, d, theta, types, **others)

    @property
    def model(self) -> pin.Model:
        """Pinocchio's model, for computations of one's own."""
        return self._model

    @property
    def data(self) -> pin.Data:
        """Pinocchio's results at the present configuration, not to be written to."""
        return self._data

    @cached_property
    def bodies(self) -> Mapping[str, tuple[Shape, ...]]:
        """Shapes of the links, see `robot_bodies`; none without a `body_source`."""
        return self.body_source()

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames that tasks can control, from the base outwards."""
        return tuple(self._frames)

    @property
    def q(self) -> Vector:
        """Configuration (n,) [rad, m] of the last update; a read-only view."""
        return self._q_view

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

    def segments(self) -> Matrix:
        """Straight lines (s, 2, 3) [m] from the origin of every link to those beyond it."""
        return np.array(
            [
                (
                    self._frames[start].position if isinstance(start, str) else start,
                    self._frames[end].position,
                )
                for start, end in self._lines
            ]
        )

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

    def reach(self, name: str) -> Vector:
        """Bound (n,) on the speed of a frame's origin per joint speed, at any configuration.

        Metres per radian for a turning joint: the length of the chain beyond it, without
        what lies along its axis. Infinite where that has a sliding joint without limits.
        Joints that do not move the frame have zero.

        Raises
        ------
        InvalidValue
            If the robot has no such frame.
        """
        frame = self._model.frames[self.frame(name).index]
        path = joint_path(self._model, frame.parentJoint, 0)
        return self.path_reach(path, frame.placement.translation[None], 0.0)

    def path_reach(self, path: Path, points: Matrix, radius: float) -> Vector:
        """Bound (n,) on the speed of a shape seen from the end of a path, per joint speed.

        As `reach`; the shape and the path as for `path_speeds`.
        """
        farthest = np.maximum(-self.limits.position_min, self.limits.position_max)
        if self.coupling is None:
            return path_speeds(self._crossings, farthest, path, points, radius)
        S, offset = self.coupling
        slides = np.abs(offset) + _products(S, farthest).sum(axis=1)
        speeds = path_speeds(self._crossings, slides, path, points, radius)
        return _products(S.T, speeds).sum(axis=1)

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Whether each joint moves a sliding one of the model (n,)."""
        slides = np.zeros(self._model.nv, dtype=np.bool_)
        for joint in self._model.joints[1:]:
            slides[joint.idx_v] = joint.shortname().startswith('JointModelP')
        if self.coupling is None:
            return slides
        moves: NDArray[np.bool_] = (self.coupling.S[slides] != 0.0).any(axis=0)
        return moves

    def update(self, q: Vector) -> None:
        """Move every frame to configuration ``q`` (n,) [rad, m]."""
        self._take(q)
        pin.computeJointJacobians(self._model, self._data, self._q_model)
        pin.updateFramePlacements(self._model, self._data)
        self._stamp += 1

    def place(self, q: Vector) -> None:
        """Move every frame to ``q`` (n,) [rad, m], positions only.

        Quicker than `update`, which has to follow before anything else is asked for.
        """
        self._take(q)
        pin.framesForwardKinematics(self._model, self._data, self._q_model)

    def _take(self, q: Vector) -> None:
        self._q[:] = q
        if self.coupling is not None:
            np.dot(self.coupling.S, self._q, out=self._q_model)
            self._q_model += self.coupling.offset


def _poses(data: pin.Data) -> NDArray[np.float64]:
    """View (nf, 4, 3) of the poses, which Pinocchio keeps one after the other."""
    size = len(data.oMf)
    first = data.oMf[0].rotation.T
    poses = np.lib.stride_tricks.as_strided(first, (size, 4, 3), (96, 24, 8))
    if not np.shares_memory(poses[-1, 3], data.oMf[size - 1].translation):
        raise RuntimeError('this Pinocchio keeps poses in another way')
    return poses


def _products(S: Matrix, bounds: Vector) -> Matrix:
    """Every ``|S_ij| bounds_j``, where nothing times an infinite bound is nothing."""
    shares = np.zeros_like(S)
    np.multiply(np.abs(S), bounds, out=shares, where=S != 0.0)
    return shares


class Frame:
    """Pose and Jacobian of one frame at the robot's present configuration."""

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        index: int,
        coupling: Coupling | None,
        stamp: NDArray[np.int64],
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
        frame = cls(model, model.createData(), 0, None, np.zeros(1, dtype=np.int64))
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
            self._jacobian_stamp = int(self._stamp[0])
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
            chain_hessian(jacobian, self._own_chain, hessian)
            if self._coupling is not None:
                S = self._coupling.S
                hessian = np.einsum('rij,ik,jl->rkl', hessian, S, S)
            self._hessian = hessian
            self._hessian.flags.writeable = False
            self._hessian_stamp = int(self._stamp[0])
        return self._hessian

    def chain(self, reference: Frame | None = None) -> NDArray[np.int64]:
        """Velocity indices of the model's joints (p,) from a reference, or the base, to here."""
        frames = self._model.frames
        start = 0 if reference is None else frames[reference.index].parentJoint
        path = joint_path(self._model, frames[self.index].parentJoint, start)
        return np.array([self._model.joints[joint].idx_v for joint, _ in reversed(path)], int)

    def model_jacobian(self) -> Matrix:
        """Jacobian (6, m) to the twist in the base frame, by the joints of the model."""
        jacobian = pin.getFrameJacobian(
            self._model, self._data, self.index, pin.LOCAL_WORLD_ALIGNED
        )
        # A single column arrives as a vector.
        return jacobian.reshape(6, -1)
