"""Task priority of planar arms in plain numpy, for notebooks where the library is missing.

`Stack` takes the parameters of the library and of the controller node, as a nested dictionary,
and answers configurations with joint velocities as the library does with `settle: false`. It
knows what the notebooks need: arms in the xy plane, the tasks of `KINDS`, and the schemes of
`Stack.SCHEMES`. Everything else is refused with the name of the key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import laws

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Unknown(ValueError):
    """A parameter that the plain numpy path does not know."""

    def __init__(self, key: str, got: object, accepts: object):
        super().__init__(f'{key}: {got!r}; without the library {accepts}')


class Arm:
    """Arm in the xy plane from the block ``robot``: Denavit-Hartenberg parameters.

    A vector of the plane is one complex number here: a turn by an angle is a product.
    """

    def __init__(self, robot: Mapping[str, Any]):
        dh = robot['dh']
        self.n = n = len(dh['a'])
        zeros = [0.0] * n
        kinds = dh.get('types', ['revolute'] * n)
        self.turns = np.array([kind == 'revolute' for kind in kinds])
        self.joints = list(robot.get('joints', [f'joint_{i + 1}' for i in range(n)]))
        poses = [_base(dh.get('base_pose', [0.0] * 6))]
        rows = (dh.get('theta', zeros), dh.get('d', zeros), dh['a'], dh.get('alpha', zeros))
        for row in zip(*rows, strict=True):
            poses.append(poses[-1] @ _joint(*row))
        axes = np.array([pose[:3, 2] for pose in poses[:-1]])
        places = np.array([pose[0, 3] + 1j * pose[1, 3] for pose in poses])
        self.axes = np.where(self.turns, axes[:, 2], 0.0)
        self.slides = np.where(self.turns, 0.0, axes[:, 0] + 1j * axes[:, 1])
        self.start, self.links = places[0], np.diff(places)
        self.angles = np.array([np.arctan2(pose[1, 0], pose[0, 0]) for pose in poses])
        self.velocity = np.full(n, np.inf)
        self.velocity[:] = robot.get('limits', {}).get('velocity', np.inf)

    def pose(self, q: Vector) -> Pose:
        """Places of the base and of all links at the positions q (n,)."""
        turned = np.zeros(self.n + 1)
        (self.axes * q).cumsum(out=turned[1:])
        ways = np.exp(1j * turned)
        points = np.empty(self.n + 1, dtype=complex)
        points[0] = self.start
        slid = ways[:-1] * self.slides
        (ways[1:] * self.links + slid * q).cumsum(out=points[1:])
        points[1:] += self.start
        return Pose(points, turned, slid)

    def place(self, pose: Pose, link: int) -> tuple[Vector, Matrix]:
        """x, y [m] and angle [rad] (3,) of a link, and their Jacobian (3, n)."""
        end = pose.points[link]
        ways = 1j * self.axes * (end - pose.points[:-1]) + pose.slid
        J = np.array([ways.real, ways.imag, self.axes])
        J[:, link:] = 0.0
        return np.array([end.real, end.imag, pose.turned[link] + self.angles[link]]), J


class Pose(NamedTuple):
    """An arm at some positions."""

    points: NDArray[np.complex128]
    """Origins of the base and of the links (n + 1,) [m]."""
    turned: Vector
    """Angles (n + 1,) [rad] by which they have turned."""
    slid: NDArray[np.complex128]
    """Directions (n,) of the slides."""


def _joint(theta: float, d: float, a: float, alpha: float) -> Matrix:
    """Pose (4, 4) of a link before its joint has moved, in the frame of the link before."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s]]
    return np.array([*rows, [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]])


def _base(pose: Sequence[float]) -> Matrix:
    """Pose (4, 4) of x, y, z [m], roll, pitch, yaw [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(pose[3:]), np.sin(pose[3:])
    matrix = np.eye(4)
    matrix[:3, 3] = pose[:3]
    matrix[:3, :3] = (
        np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        @ np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    )
    return matrix


class Task:
    """A task with its error, Jacobian and desired velocity; the attributes of the library."""

    def __init__(self, name: str, arm: Arm, block: Mapping[str, Any]):
        self.name, self.type, self.arm = name, block['type'], arm
        if self.type not in KINDS:
            raise Unknown(f'tasks.{name}.type', self.type, f'one of {", ".join(KINDS)}')
        self.set_based = self.type in ('obstacle', 'joint_limits')
        named = arm.joints if self.type == 'posture' else block.get('joints', arm.joints)
        self.columns = [arm.joints.index(joint) for joint in named]
        self.link = int(str(block.get('frame', 'link_0')).rpartition('_')[2])
        rows = block.get('axes', 'z' if self.type == 'orientation' else 'xy')
        if self.type == 'pose':
            rows = block['position_axes'] + block['orientation_axes']
        self.rows = ['xyz'.index(axis) for axis in rows]
        self.k = len(self.columns) if 'frame' not in block else len(self.rows)
        self.k = 1 if self.type == 'obstacle' else self.k
        self.K = _matrix(block.get('gain', [1.0]), self.k)
        self.feedforward: Any = block.get('feedforward', np.zeros(self.k))
        self.target: Any = block.get('center' if self.type == 'obstacle' else 'target')
        self.radius, self.low, self.high = (block.get(x) for x in ('radius', 'min', 'max'))
        self.hysteresis = block.get('switching') == 'hysteresis'
        self.activation, self.margin = block.get('activation'), block.get('margin')
        self.release = block.get('release')
        if self.set_based and None in (self.activation, self.release or self.margin):
            key = 'release' if self.hysteresis else 'margin'
            raise Unknown(f'tasks.{name}', 'no value', f'activation and {key} have to be given')
        self.wraps = self.on = np.zeros(self.k, dtype=bool)
        if not self.set_based:
            on_joints = self.type in ('joint', 'posture')
            self.wraps = arm.turns[self.columns] if on_joints else np.array(self.rows) == 2
        self.wrapped = bool(self.wraps.any())
        self.error, self.J = np.zeros(self.k), np.zeros((self.k, arm.n))

    @property
    def active(self) -> bool:
        """Whether a set-based task acts."""
        return bool(self.on.any())

    def update(self, q: Vector, pose: Pose) -> None:
        """Compute error, Jacobian and, of set-based tasks, distance."""
        if self.type in ('joint', 'posture', 'joint_limits'):
            self.current, self.J = q[self.columns], np.eye(self.arm.n)[self.columns]
        else:
            place, J = self.arm.place(pose, self.link)
            self.current, self.J = place[self.rows], J[self.rows]
        if self.set_based:
            self._switch()
            return
        if self.target is None:
            self.target = self.current.copy()
        self.error = np.asarray(self.target) - self.current
        if self.wrapped:
            turn = 2.0 * np.pi * np.round(self.error / (2.0 * np.pi))
            self.error = self.error - self.wraps * turn

    def _switch(self) -> None:
        """Measure the distances, and let rows come in and go out."""
        if self.type == 'obstacle':
            way = self.current - np.asarray(self.target)
            length = np.linalg.norm(way)
            self.distance, self.J = np.array([length - self.radius]), (way / length @ self.J)[None]
        else:
            below, above = self.current - np.array(self.low), np.array(self.high) - self.current
            self.distance = np.minimum(below, above)
            self.J = self.J * np.where(below < above, 1.0, -1.0)[:, None]
        self.error = np.zeros(self.k)
        if self.hysteresis:
            self.on = self.distance <= np.where(self.on, self.release, self.activation)
            self.J = self.J * self.on[:, None]
            self.error[self.on] = (2 * self.release - self.activation - self.distance)[self.on]

    def velocity(self) -> Vector:
        """Desired task velocity (k,), ``K e`` + feedforward; of dampers the least rate."""
        if not self.set_based or self.hysteresis:
            return self.K.dot(self.error) + self.feedforward
        time = (self.activation - self.margin) / self._fastest()
        beyond = self.distance - self.margin
        return np.where(beyond > 0.0, -beyond / time, -self.K.diagonal() * beyond)

    def _fastest(self) -> float:
        """Bound on the speed [m/s, rad/s] of the distances at the velocity limits."""
        if self.type == 'joint_limits':
            return float(self.arm.velocity[self.columns].max())
        lengths = np.abs(self.arm.links[: self.link])
        return float(np.cumsum(lengths[::-1])[::-1] @ self.arm.velocity[: self.link])


KINDS = ('position', 'orientation', 'pose', 'joint', 'posture', 'obstacle', 'joint_limits')


def _matrix(gain: Any, k: int) -> Matrix:
    """Gain matrix (k, k) of one value, one per row, or a full matrix row by row."""
    gain = np.ravel(gain).astype(float)
    return gain.reshape(k, k) if gain.size == k * k and k > 1 else np.diag(np.resize(gain, k))


class LevelResult(NamedTuple):
    """What one level asked for and got."""

    tasks: tuple[str, ...]
    requested: Vector
    achieved: Vector


class Step(NamedTuple):
    """Joint velocity (n,), the factor of the scaling to the limits, and all levels."""

    command: Vector
    scale: float
    levels: tuple[LevelResult, ...]


class Stack:
    """Tasks in levels of priority on a planar arm; the part of the library's that is needed."""

    SCHEMES = ('recursive', 'augmented', 'extended_jacobian', 'hqp')

    def __init__(self, parameters: Mapping[str, Any]):
        self.robot = Arm(parameters['robot'])
        solver = dict(parameters.get('solver', {}))
        self.scheme = solver.get('type', 'recursive')
        if self.scheme not in self.SCHEMES:
            raise Unknown('solver.type', self.scheme, f'one of {", ".join(self.SCHEMES)}')
        self.damping = 0.0 if solver.get('inverse') == 'pinv' else solver.get('damping', 0.1)
        adaptive = solver.get('inverse') == 'adaptive'
        self.region = solver.get('singular_region', 0.1) if adaptive else np.inf
        self.bounded = np.isfinite(self.robot.velocity).any()
        self.uniform = solver.get('saturation') == 'uniform'
        if self.bounded and not self.uniform and self.scheme == 'recursive':
            raise Unknown('solver.saturation', 'null_space', 'uniform')
        if self.scheme == 'hqp' and self.damping:
            raise Unknown('solver.damping', self.damping, '0 with hqp')
        self.objective = solver.get('objective')
        self.tasks = {
            name: Task(name, self.robot, block) for name, block in parameters['tasks'].items()
        }
        self.hierarchy = list(parameters['hierarchy'])

    def step(self, q: Vector) -> Step:
        """Joint velocity for the measured positions q (n,)."""
        q = np.asarray(q, dtype=float)
        pose = self.robot.pose(q)
        for task in self.tasks.values():
            task.update(q, pose)
        results, levels, least, dampers = [], [], [], []
        for level in self.hierarchy:
            members = [self.tasks[name] for name in level.split(' + ')]
            J, v = members[0].J, members[0].velocity()
            for task in members[1:]:
                J, v = np.vstack([J, task.J]), np.concatenate([v, task.velocity()])
            results.append((tuple(task.name for task in members), J, v))
            if members[0].set_based and not members[0].hysteresis:
                dampers += [(members[0], i) for i in range(members[0].k)]
                least += [(J[i : i + 1], v[i : i + 1]) for i in range(members[0].k)]
                continue
            if not any(task.set_based for task in members):
                levels.append((J, v))
                continue
            on = np.concatenate([task.on | (not task.set_based) for task in members])
            if on.any():
                levels.append((J[on], v[on]))
        qd, active = laws.with_rows(least, levels, lambda some: self._solve(q, some))
        for i, (task, row) in enumerate(dampers):
            task.on[row] = i in active
        command, scale = laws.scaled(qd, self.robot.velocity) if self.bounded else (qd, 1.0)
        return Step(command, scale, tuple(LevelResult(x, v, J @ command) for x, J, v in results))

    def _solve(self, q: Vector, levels: laws.Levels) -> Vector:
        if self.scheme == 'hqp' and self.bounded:
            return laws.best_in_bounds(levels, -self.robot.velocity, self.robot.velocity)
        if self.scheme in ('recursive', 'hqp'):
            return laws.recursion(levels, self.damping, self.region, self.robot.n)
        if self.objective is not None and self.scheme == 'extended_jacobian':
            levels = [*levels, self._optimum(q)]
        return laws.stacked(levels, self.damping, self.region)

    def _optimum(self, q: Vector) -> tuple[Matrix, Vector]:
        """Level of the objective ``H = -½ ‖q - q₀‖²`` in the null space of the tasks."""
        posture = np.array(self.objective['positions'])
        members = [self.tasks[name] for level in self.hierarchy for name in level.split(' + ')]

        def jacobian(q: Vector) -> Matrix:
            pose = self.robot.pose(q)
            return np.vstack([self.robot.place(pose, t.link)[1][t.rows] for t in members])

        def gradient(q: Vector) -> Vector:
            return posture - q

        return laws.optimum_level(q, jacobian, gradient, self.objective.get('gain', 1.0))
