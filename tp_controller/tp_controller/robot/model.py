"""One kinematic model for every arm, on Pinocchio."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.frames import Coupling, Frame
from tp_controller.robot.limits import Limits
from tp_controller.robot.motions import FIXED
from tp_controller.robot.reach import Crossing, Path, crossings, joint_path, path_speeds
from tp_controller.robot.response import Response
from tp_controller.robot.shapes import Shape
from tp_controller.robot.space import Space
from tp_controller.robot.state import State

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LINKS = (pin.OP_FRAME, pin.BODY)
"""Kinds of frames that tasks may control."""


class Robot:
    """An arm's kinematics at one configuration at a time.

    Parameters
    ----------
    model
        Pinocchio model whose universe is the base frame.
    joints
        Names of the controlled joints, or the `Space` of these.
    base_frame
        Name of the frame that everything is expressed in.
    limits
        Joint limits; absent means unlimited.
    coupling
        How the model follows the velocities; absent means that they are the same, in the same
        order.
    lines
        Pairs that a picture of the arm connects: a frame or a fixed point (3,) [m], and a
        frame beyond it.
    wrapping
        For every joint whether whole turns make no difference; absent means no. A space says so
        itself.

    Raises
    ------
    InvalidValue
        If there is no joint or a name stands twice.

    Attributes
    ----------
    space
        The configuration space: names of coordinates and velocities, and how they belong together.
    joints
        Names of the velocities (n,), in the order of commands. Of revolute and prismatic joints
        these are the names of the joints.
    n
        Number of the velocities.
    """

    def __init__(
        self,
        model: pin.Model,
        joints: Sequence[str] | Space,
        base_frame: str = 'base',
        limits: Limits | None = None,
        coupling: Coupling | None = None,
        lines: Sequence[tuple[str | Vector, str]] = (),
        wrapping: Sequence[bool] | None = None,
    ) -> None:
        space = joints if isinstance(joints, Space) else Space(joints, None, wrapping)
        self.space = space
        self.joints = space.velocities
        if not self.joints:
            raise InvalidValue('robot.joints', 'no joint', 'one or more joint names')
        for names in (space.velocities, space.coordinates):
            if len(set(names)) != len(names):
                raise InvalidValue('robot.joints', shown(names), 'every joint once')
        self.n = space.nv
        self.base_frame = base_frame
        self.limits = limits if limits is not None else Limits(self.n, ranged=space.ranged)
        self.response = Response.of(self.n)
        """What the arm makes of its commands; ideal at first. Tasks and stacks that are made
        later go by it."""
        self._model = model
        self._data = model.createData()
        self.coupling = coupling
        """How the model follows the velocities, None if they are the same."""
        self._q = space.neutral.copy()
        self._q_view = self._q.view()
        self._q_view.flags.writeable = False
        # Scalar joints without a coupling have the model's configuration as their own.
        own = coupling is None and not space.blocks
        self._q_model = self._q if own else pin.neutral(model)
        self._places = _places(model, space)
        self._stamp = [0]
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
        base: str = FIXED,
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
        base
            What the root stands on: ``fixed``, ``planar``, ``floating`` or ``differential``.

        Raises
        ------
        InvalidValue
            If there is no such file or it cannot be used.
        """
        from tp_controller.robot.make import robot_from_urdf

        return robot_from_urdf(
            path, joints, base_frame, limits, rest_positions, link_radius, srdf, base
        )

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
            ``base_pose``, ``convention`` and ``base`` as `dh_robot`, ``limits`` and
            ``link_radius`` as `from_urdf`.

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

    @cached_property
    def _crossings(self) -> tuple[Crossing, ...]:
        """Facts about every joint, see `crossings`."""
        return crossings(self._model)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames that tasks can control, from the base outwards."""
        return tuple(self._frames)

    @property
    def q(self) -> Vector:
        """Configuration (nq,) [rad, m] of the last update; a read-only view."""
        return self._q_view

    @property
    def nq(self) -> int:
        """Number of coordinates of a configuration."""
        return self.space.nq

    @property
    def nv(self) -> int:
        """Number of velocities, `n`."""
        return self.space.nv

    @property
    def neutral(self) -> Vector:
        """Configuration (nq,) with joints at zero and poses at the origin; a copy."""
        return self.space.neutral.copy()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names (nq,) of the coordinates, in the order of configurations."""
        return self.space.coordinates

    @property
    def wrapping(self) -> tuple[bool, ...]:
        """For every coordinate whether whole turns make no difference (nq,)."""
        return self.space.wrapping

    @property
    def positions(self) -> Vector:
        """Positions (n,) [rad, m] of the last update, zero for the velocities of a pose."""
        return self.space.positions(self._q_view)

    def integrate(self, q: Vector, v_dt: Vector) -> Vector:
        """Configuration (nq,) that velocities lead to.

        Parameters
        ----------
        q
            Configuration (nq,) [rad, m].
        v_dt
            Constant velocities times the time (n,) [rad, m].
        """
        return self.space.integrate(q, v_dt)

    def difference(self, q0: Vector, q1: Vector) -> Vector:
        """Velocities times the time (n,) [rad, m] that lead from q0 to q1, both (nq,).

        It undoes `integrate`, except for whole turns, and for what the robot has no velocity for:
        a differential drive that is beside its place is not led there.
        """
        return self.space.difference(q0, q1)

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

    def corners(self) -> Matrix:
        """Ends (m, 3) [m] of the segments, each once."""
        found: dict[object, Vector] = {}
        for start, end in self._lines:
            if isinstance(start, str):
                found[start] = self._frames[start].position
            else:
                found[tuple(start)] = start
            found[end] = self._frames[end].position
        return np.array(list(found.values())).reshape(-1, 3)

    def joint_indices(self, names: Sequence[str]) -> list[int]:
        """Indices of the named coordinates.

        Raises
        ------
        InvalidValue
            If the robot has no such coordinate, or one is named twice.
        """
        for name in names:
            if name not in self.coordinates:
                raise InvalidValue('joints', shown(name), f'some of {listed(self.coordinates)}')
        if len(set(names)) != len(names):
            raise InvalidValue('joints', shown(list(names)), 'every joint once')
        return [self.coordinates.index(name) for name in names]

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
            slides[joint.idx_v] = joint.nv == 1 and joint.shortname().startswith('JointModelP')
        if self.coupling is None:
            return slides
        moves: NDArray[np.bool_] = (self.coupling.S[slides] != 0.0).any(axis=0)
        return moves

    def update(self, q: Vector) -> None:
        """Move every frame to configuration ``q`` (nq,) [rad, m]."""
        self._take(q)
        pin.computeJointJacobians(self._model, self._data, self._q_model)
        pin.updateFramePlacements(self._model, self._data)
        self._stamp[0] += 1

    def state(self, q: ArrayLike) -> State:
        """Return a configuration with its frames and Jacobians, as a value.

        The robot stays where it is.

        Parameters
        ----------
        q
            Configuration (nq,) [rad, m].

        Raises
        ------
        InvalidValue
            For a wrong number of values, or one that is not finite.
        """
        return State(self, q)

    def twin(self) -> Robot:
        """Return kinematics of the same model that move on their own, without shapes."""
        return Robot(self._model, self.space, self.base_frame, self.limits, self.coupling)

    def place(self, q: Vector) -> None:
        """Move every frame to ``q`` (nq,) [rad, m], positions only.

        Quicker than `update`, which has to follow before anything else is asked for.
        """
        self._take(q)
        pin.framesForwardKinematics(self._model, self._data, self._q_model)

    def _take(self, q: Vector) -> None:
        self._q[:] = q
        if self._q_model is self._q:
            return
        if self.coupling is not None and not self.space.blocks:
            np.dot(self.coupling.S, self._q, out=self._q_model)
            self._q_model += self.coupling.offset
            return
        x = self.positions
        if self.coupling is not None:
            x = self.coupling.S @ x + self.coupling.offset
        self._q_model[self._places.scalar_q] = x[self._places.scalar_v]
        for block, place in zip(self.space.blocks, self._places.poses, strict=True):
            self._q_model[place] = block.motion.model(self._q[block.q])


class _Places(NamedTuple):
    """Where joints are in a configuration of Pinocchio."""

    scalar_q: NDArray[np.int64]
    """Coordinates of joints that have one."""
    scalar_v: NDArray[np.int64]
    """Their velocities."""
    poses: list[slice]
    """Coordinates of planar and floating joints, in the order of the space."""


def _places(model: pin.Model, space: Space) -> _Places:
    scalars = [(joint.idx_q, joint.idx_v) for joint in model.joints[1:] if joint.nq == 1]
    found = np.array(scalars, dtype=np.int64).reshape(-1, 2)
    poses = []
    for block in space.blocks:
        joint = model.joints[model.getJointId(block.joint)]
        poses.append(slice(joint.idx_q, joint.idx_q + joint.nq))
    return _Places(found[:, 0], found[:, 1], poses)


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
