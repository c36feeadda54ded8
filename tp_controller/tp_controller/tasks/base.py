"""What every task is: an error, a Jacobian and a desired velocity."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import Parameter
from tp_controller.problem import Level
from tp_controller.robot import Limits, Robot, State, moved
from tp_controller.snapshot import unchanged
from tp_controller.tasks.task_settings import TaskSettings, do_nothing

if TYPE_CHECKING:
    from tp_controller.tasks.compiled import CompiledRows
    from tp_controller.tasks.parts import Part

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Task(TaskSettings):
    """A task variable to be brought to a desired value.

    The desired task velocity is ``K error + feedforward`` with ``error = desired - current``,
    made shorter to `max_speed` where it is longer.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    components
        Name of each of the k rows.

    Attributes
    ----------
    error
        Desired minus current (k,), rotations by the shortest way; filled by `update`.
    J
        Task Jacobian (k, n); filled by `update`.
    """

    parameters: ClassVar[Mapping[str, Parameter]]
    """Parameters of the kind beside the common ones, in parameter files."""
    set_based: ClassVar[bool] = False
    """Whether the rows come and go."""
    one_sided: bool = False
    """Whether the desired velocity is the least one allowed."""
    target_key: ClassVar[str] = 'target'
    """Parameter that the target is at the start."""
    without: ClassVar[tuple[str, ...]] = ()
    """Common parameters that the kind has no use for."""

    def __init__(self, name: str, robot: Robot, components: Sequence[str]) -> None:
        super().__init__(name, components)
        self.robot = robot
        self.error: Vector = np.zeros(self.k)
        self.J: Matrix = np.zeros((self.k, robot.n))
        self._rows: CompiledRows | None = None

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> Task:
        """Make the task from the checked values of its `parameters`.

        Unless overridden, the constructor is called with those that have a value, by name.
        """
        given = {key: values[key] for key in cls.parameters if values.get(key) is not None}
        return cls(name, robot, **given)

    @property
    def frame_name(self) -> str:
        """Name of the controlled frame, empty if there is none."""
        return ''

    @property
    def relative_to(self) -> str:
        """Name of the frame that the task is seen from, empty for the base."""
        return ''

    @property
    def active(self) -> bool:
        """Whether the task acts now."""
        return True

    def take_notices(self) -> list[str]:
        """What a user should know that was found in steps, one line each; each told once."""
        return []

    def prepare_limits(self, limits: Limits) -> Callable[[], None]:
        """Check limits that the robot is to have.

        Returns
        -------
        callable
            Makes the task follow them; it cannot fail. To be called when the robot has them.

        Raises
        ------
        InvalidValue
            If the task could not be made for a robot with these limits.
        """
        return do_nothing

    @property
    @abstractmethod
    def current(self) -> Vector:
        """Present value, in the form of a target if the task has one; a copy."""

    def hold(self) -> None:
        """Take the present value as the target."""
        self._target = self.current
        self.revision += 1

    @property
    def parts(self) -> tuple[Part, ...]:
        """Rows that compiled code can fill, all of them; none if `update` does it itself."""
        return ()

    def part_values(self) -> tuple[Vector, ...]:
        """Target of every part, as its kind of rows needs it."""
        return ()

    def update(self) -> None:
        """Compute `error` and `J` at the robot's present configuration."""
        if not self.parts:
            raise NotImplementedError(f'{type(self).__name__}: either parts or update')
        self._own_rows().fill()

    @property
    def memory(self) -> tuple[object, ...]:
        """Objects whose attributes are all that the task remembers: itself, unless overridden."""
        return (self,)

    def rows(self, state: State) -> Level:
        """Return what the task asks for at a state, as a level of a problem.

        An equality task has ``J qd = velocity`` with ``velocity = K error + feedforward``; a task
        with smooth switching has ``C qd >= least``. Rows that are out are zero. A task without a
        target takes its value at the state as the target. With hysteresis, whether rows are in
        also depends on whether they are in now.

        For the time of the call the robot is moved to the state. Afterwards robot and task are as
        they were before.

        Parameters
        ----------
        state
            A state of the task's robot.

        Returns
        -------
        Level
            Jacobian (k, n) and velocity (k,) [m/s, rad/s], with the task's inverse, its weight
            and names; the arrays are the caller's own.

        Raises
        ------
        InvalidValue
            If the state is another robot's.
        """
        state.check(self.robot)
        velocity = np.zeros(self.k)
        if self.parts:
            self._own_rows()  # is kept
        with unchanged(*self.memory), moved(self.robot, state.q):
            if self.target_size and not self._target.size:
                self.hold()
            self.update()
            self.desired_velocity(velocity)
            J, revision = self.J.copy(), self.revision
        if revision != self.revision:
            # What was compiled for that target may not be taken for the next one.
            self.revision = revision + 1
        names = tuple(f'{self.name} {component}' for component in self.components)
        if self.one_sided:
            return Level(None, None, J, velocity, self.weight, self.inverse, (self.name,), names)
        return Level(J, velocity, None, None, self.weight, self.inverse, (self.name,), names)

    def _own_rows(self) -> CompiledRows:
        if self._rows is None:
            from tp_controller.tasks.compiled import CompiledRows

            unused = np.zeros((2, self.k))
            self._rows = CompiledRows(self.robot, [(self, 0)], self.J, self.error, *unused)
        return self._rows

    @property
    def bend(self) -> Vector:
        """Bounds (k,) on the second derivatives of the variables by unit joint motions."""
        return np.zeros(self.k)

    def hessian(self, out: NDArray[np.float64]) -> None:
        """Write the second derivatives (k, n, n) of the variables, symmetric, to ``out``.

        They are those of ``-error`` at the last update; without parts zero unless overridden.
        Axes that turn with the robot are taken as they are then.
        """
        out[:] = 0.0
        if self.parts:
            self._own_rows().fill_hessians(out)

    def leave(self) -> None:
        """Forget what belongs to a place in the hierarchy; nothing, unless rows come and go."""
        return

    def place(self, J: Matrix, error: Vector) -> None:
        """Keep Jacobian and error in given arrays (k, n) and (k,) from now on."""
        J[:], error[:] = self.J, self.error
        self.J, self.error = J, error
        self._rows = None

    def desired_velocity(self, out: Vector) -> None:
        """Write ``K error + feedforward`` (k,) of the last update to ``out``, not too fast."""
        np.dot(self._K, self.error, out=out)
        out += self._feedforward
        if self._max_speed.size:
            out *= self._shares(out)

    def left_out(self) -> Vector:
        """What `max_speed` takes from ``K error + feedforward`` (k,) of the last update."""
        if not self._max_speed.size:
            return np.zeros(self.k)
        velocity = self._unlimited()
        return velocity * (1.0 - self._shares(velocity))

    @property
    def slowness(self) -> float:
        """By what `max_speed` divided the speed at the last update; 1 where it changed nothing."""
        if not self._max_speed.size:
            return 1.0
        return 1.0 / float(self._shares(self._unlimited()).min(initial=1.0))

    def limited_feedforward(self, out: Vector) -> None:
        """Write the part (k,) of the feedforward in the desired velocity to ``out``."""
        out[:] = self._feedforward
        if self._max_speed.size:
            out *= self._shares(self._unlimited())

    def _unlimited(self) -> Vector:
        """``K error + feedforward`` (k,) of the last update."""
        velocity: Vector = self._K @ self.error + self._feedforward
        return velocity

    def _shares(self, velocity: Vector) -> Vector:
        """Share (k,) of each row of a velocity that `max_speed` leaves."""
        shares = np.ones(self.k)
        for rows, most in zip(self.speed_groups, self._max_speed, strict=False):
            speed = float(np.linalg.norm(velocity[rows]))
            if speed > most:
                shares[rows] = most / speed
        return shares
