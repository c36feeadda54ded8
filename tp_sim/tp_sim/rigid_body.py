"""Joints of rigid bodies, driven by velocity servos; no ROS is imported here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.robot import Robot
from tp_controller.robot.package_files import KEY
from tp_controller.robot.urdf import numbers
from tp_sim.integrator import Integrator
from tp_sim.plant_settings import Values

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LONGEST_STEP = 1e-3
"""Longest time [s] that the motion is integrated over at once."""
STICKING = 1e-3
"""Speed [rad/s, m/s] below which Coulomb friction becomes smaller."""


class ServoSettings(NamedTuple):
    """Motors, their servos and the friction of rigid-body joints."""

    bandwidth: float = 300.0
    """Rate [1/s] at which a joint alone approaches the commanded velocity."""
    integral: float | None = None
    """Rate [1/s] of the integral part; a tenth of the bandwidth if there is friction, else
    zero, when None."""
    rotor_inertia: Values = 0.1
    """Inertia [kg m², kg] of the motors, seen from the joints."""
    viscous_friction: Values = 0.0
    """Torque per speed [N m s/rad, N s/m]."""
    coulomb_friction: Values = 0.0
    """Torque [N m, N] against any motion."""
    effort: Values | None = None
    """Largest torque or force [N m, N] of the motors; that of the URDF when None."""


class RigidBodies:
    r"""Joints of rigid bodies whose motors follow velocity commands.

    With the configuration ``q``, its mass matrix ``M(q)`` (the motors' included) and the torques
    of gravity and of Coriolis and centrifugal forces ``h(q, qd)``,

    .. math::

        M \ddot q + h = \tau - D \dot q - C \operatorname{sign} \dot q

    and the servo of joint i with its commanded velocity ``u`` gives

    .. math::

        \tau_i = b M_{ii} \left( u_i - \dot q_i + k \int (u_i - \dot q_i) \right) + h_i

    with the bandwidth ``b`` and the integral part ``k``, held to the motor's effort. The servos
    know nothing of each other: what one joint's motion does to another is a disturbance. The
    integral stands still while its motor is at its limit.

    The velocity is integrated semi-implicitly, in equal steps of at most 1 ms: servo and friction
    act with the velocity at the end of a step, so that no gain makes it unstable. Coulomb friction
    becomes smaller below a speed of 1e-3 rad/s: instead of sticking a joint creeps.

    At an end of its range a joint is stopped dead, as by `Integrator`; the others are not shaken
    by that. Commands, not motions, are held to the velocity limits.

    Parameters
    ----------
    robot
        The robot, made of the description.
    description
        URDF with the masses and the motors' efforts.
    q
        Initial positions (n,) [rad, m].
    settings
        Servos and friction.
    stops
        Whether the ranges end in hard stops.

    Raises
    ------
    InvalidValue
        If the description has joints that move no mass, or inertias that no body has; if the
        initial positions cannot be had; for settings of the wrong size or sign.
    """

    stiffness = 0.3

    def __init__(
        self,
        robot: Robot,
        description: str,
        q: Sequence[float] | Vector,
        settings: ServoSettings | None = None,
        stops: bool = True,
    ) -> None:
        # Compiled, or loaded, only when it is needed: not to refuse a parameter file.
        from tp_sim.servo import drive

        self._drive = drive
        settings = settings or ServoSettings()
        if robot.space.blocks:
            got = 'rigid_body for a robot with a base that moves'
            raise InvalidValue('plant.type', got, 'kinematic')
        self.limits, self.space = robot.limits, robot.space
        self._stops = stops
        self._place = Integrator(q, robot.limits)
        self._q, self._n = self._place.q, robot.n
        self._qd, self._wanting = np.zeros((2, robot.n))
        self._coupling = robot.coupling
        root = ElementTree.fromstring(description)
        self._model = _heavy(robot, root)
        self._data = self._model.createData()
        self._take(settings, root, robot.joints)
        self._check_mass()

    def _take(self, given: ServoSettings, root: Element, joints: Sequence[str]) -> None:
        if not given.bandwidth > 0.0:
            raise InvalidValue('plant.bandwidth', shown(given.bandwidth), 'a number above 0')
        self._bandwidth = given.bandwidth
        self.servo_lag = 1.0 / given.bandwidth
        self._rotor, self._viscous, self._coulomb = (
            self._spread(key, getattr(given, key))
            for key in ('rotor_inertia', 'viscous_friction', 'coulomb_friction')
        )
        rubs = bool(self._viscous.any() or self._coulomb.any())
        default = 0.1 * given.bandwidth if rubs else 0.0
        self._integral = default if given.integral is None else given.integral
        if given.effort is None:
            self._effort = _efforts(root, joints)
        else:
            self._effort = self._spread('effort', given.effort)
            if not np.all(self._effort > 0.0):
                raise InvalidValue('plant.effort', shown(given.effort), 'numbers above 0')

    def _spread(self, key: str, given: Values) -> Vector:
        values = np.array(given, dtype=float).reshape(-1)
        if values.size not in (1, self._n):
            accepts = '1 value' if self._n == 1 else f'1 value or {self._n}, one per joint'
            raise InvalidValue(f'plant.{key}', plural(values.size, 'value'), accepts)
        if not np.all(np.isfinite(values)) or np.any(values < 0.0):
            raise InvalidValue(f'plant.{key}', shown(given), 'finite numbers of at least 0')
        return np.broadcast_to(values, (self._n,)).copy()

    def _check_mass(self) -> None:
        M, _ = self._dynamics(self._q, self._qd)
        try:
            np.linalg.cholesky(M)
        except np.linalg.LinAlgError:
            raise InvalidValue(KEY, 'inertias that no body has', 'positive ones') from None

    @property
    def q(self) -> Vector:
        """Positions (n,) [rad, m]; a copy."""
        return self._q.copy()

    @property
    def qd(self) -> Vector:
        """Velocities (n,) [rad/s, m/s]; a copy."""
        return self._qd.copy()

    @property
    def lag(self) -> Vector:
        """Time constants (n,) [s] that a controller may take the joints to have, without friction.

        At the present configuration, for joints that all change their speeds as much as their
        limits let them, in the worst directions: the sum of ``|M_ij| u_j / (b M_ii u_i)``.
        """
        M, _ = self._dynamics(self._q, np.zeros(self._n))
        M = np.abs(np.tril(M) + np.tril(M, -1).T)
        speed = np.where(np.isfinite(self.limits.velocity), self.limits.velocity, 1.0)
        return M @ speed / (self._bandwidth * np.diagonal(M) * speed)

    def check(self, q: Sequence[float] | Vector, key: str = 'initial_positions') -> Vector:
        """Copy of positions (n,) that the joints can have.

        Raises
        ------
        InvalidValue
            As `Integrator.check`.
        """
        return self._place.check(q, key)

    def reset(self, q: Sequence[float] | Vector | None = None) -> None:
        """Stand still at positions (n,), at the initial ones when none are given.

        Raises
        ------
        InvalidValue
            As `check`; the joints stay as they are then.
        """
        self._q = self._place.q if q is None else self.check(q, 'reset')
        self._qd[:] = self._wanting[:] = 0.0

    def step(self, qd: Vector, dt: float) -> None:
        """Move for ``dt`` [s] with velocities (n,) as the command."""
        aim = np.clip(qd, -self.limits.velocity, self.limits.velocity)
        count = max(1, math.ceil(dt / LONGEST_STEP - 1e-9))
        for _ in range(count):
            self._advance(aim, dt / count)

    def _advance(self, aim: Vector, dt: float) -> None:
        """One step [s] of integration towards the velocities (n,)."""
        M, h = self._dynamics(self._q, self._qd)
        self._drive(
            M,
            h,
            aim,
            self._bandwidth,
            self._integral,
            self._viscous,
            self._coulomb,
            self._effort,
            STICKING,
            dt,
            self._wanting,
            self._qd,
        )
        after = self._q + dt * self._qd
        if self._stops:
            held = np.clip(after, self.limits.position_min, self.limits.position_max)
            stopped = held != after
            self._qd[stopped] = self._wanting[stopped] = 0.0
            after = held
        self._q = after

    def _dynamics(self, q: Vector, qd: Vector) -> tuple[Matrix, Vector]:
        """Mass matrix (n, n), its lower half, with the motors' inertia; the other torques (n,)."""
        model, data = self._model, self._data
        S = None
        if self._coupling is not None:
            S, offset = self._coupling
            q, qd = S @ q + offset, S @ qd
        pin.crba(model, data, q)
        h = pin.nonLinearEffects(model, data, q, qd)
        M = data.M.T if S is None else S.T @ _symmetric(data.M) @ S
        M = np.array(M, order='C')
        M.ravel()[:: self._n + 1] += self._rotor
        return M, np.array(h if S is None else S.T @ h)


def _symmetric(upper: Matrix) -> Matrix:
    return np.triu(upper) + np.triu(upper, 1).T


def _heavy(robot: Robot, root: Element) -> pin.Model:
    """Model of a robot with the inertias of its description, which the controller's has not."""
    model = pin.Model(robot.model)
    frames = {frame.name: frame for frame in model.frames if frame.type == pin.BODY}
    children = set()
    for joint in root.findall('joint'):
        child = joint.find('child')
        children.add('' if child is None else child.get('link', ''))
    for link in root.findall('link'):
        name = link.get('name', '')
        frame, inertial = frames.get(name), link.find('inertial')
        if frame is None:
            continue
        if name not in children:
            # Gravity points down in the root of the description, whatever the base frame is.
            model.gravity.linear = frame.placement.rotation @ pin.Model.gravity981
        if inertial is not None and frame.parentJoint:
            model.inertias[frame.parentJoint] += frame.placement.act(_inertia(name, inertial))
    mass = np.array([inertia.mass for inertia in model.inertias])
    carried = [float(mass[list(tree)].sum()) for tree in model.subtrees]
    light = [model.names[i] for i in range(1, model.njoints) if not carried[i] > 0.0]
    if light:
        raise InvalidValue(
            'plant.type',
            f'rigid_body for joints that move no mass ({listed(light)})',
            'kinematic, or a URDF with <inertial> for the links',
        )
    return model


def _inertia(link: str, inertial: Element) -> pin.Inertia:
    """Inertia of a link in its frame."""

    def found(tag: str, attribute: str, default: str, count: int) -> list[float]:
        element = inertial.find(tag)
        text = default if element is None else element.get(attribute, default)
        return numbers(f'link {shown(link)} inertial {tag} {attribute}', text, count)

    (mass,) = found('mass', 'value', '0', 1)
    if mass < 0.0:
        raise InvalidValue(KEY, f'link {shown(link)} with a mass of {mass:g} kg', 'at least 0')
    xyz, rpy = (np.array(found('origin', key, '0 0 0', 3)) for key in ('xyz', 'rpy'))
    R = pin.rpy.rpyToMatrix(rpy)
    xx, xy, xz, yy, yz, zz = (
        found('inertia', key, '0', 1)[0] for key in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
    )
    about = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    try:
        return pin.Inertia(mass, xyz, 0.5 * (about + about.T))
    except RuntimeError:
        values = shown([xx, xy, xz, yy, yz, zz])
        raise InvalidValue(
            KEY, f'link {shown(link)} with the inertia {values}', 'one that a body can have'
        ) from None


def _efforts(root: Element, joints: Sequence[str]) -> Vector:
    """Efforts (n,) [N m, N] of the joints' motors; without one, or with zero, unlimited."""
    given = {}
    for joint in root.findall('joint'):
        limit, name = joint.find('limit'), joint.get('name', '')
        text = '0' if limit is None else limit.get('effort', '0')
        given[name] = numbers(f'joint {shown(name)} limit effort', text, 1)[0]
    return np.array([given[name] if given[name] > 0.0 else math.inf for name in joints])
