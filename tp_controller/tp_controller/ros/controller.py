"""The controller node."""

from __future__ import annotations

import gc
import math
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.executors import Executor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.timer import Timer

from tp_controller.config import HOLD, PRESENT, RESUME, START, build_settings, read_parameters
from tp_controller.ros.braking_to_rest import ZEROS
from tp_controller.ros.control import Control
from tp_controller.ros.cycle import ControlFailed
from tp_controller.ros.diagnostics import Diagnostics
from tp_controller.ros.hold import HELD, INACTIVE, Hold, refuse_at_rest
from tp_controller.ros.intake import Intake
from tp_controller.ros.lifecycle import ManagedNode
from tp_controller.ros.live_parameters import LiveParameters
from tp_controller.ros.robot_node import HEARTBEAT
from tp_controller.ros.stack_services import StackServices
from tp_controller.ros.state_publication import StatePublication
from tp_controller.ros.state_watch import StateWatch
from tp_controller.ros.surroundings import Surroundings
from tp_controller.ros.warnings import PERIOD as WARNING_PERIOD
from tp_controller.ros.warnings import Warnings
from tp_controller.tasks import Task
from tp_interfaces.msg import ControllerState

if TYPE_CHECKING:
    from tp_controller.ros.around import Around
    from tp_controller.ros.reach import ReachServer

STATE_QUEUE_DEPTH = 100
SERVE_PERIOD = 0.03
"""Time [s] between two looks for other things to do at least,"""
SERVE_AGAIN = 0.02
"""right after a joint state was answered, or while joint states wait all the time,"""
SERVE_SOON = 0.001
"""and while there is more to do."""
EARLIEST = 0.9
"""Least time [periods] between two commands of braking."""
TRANSITION = 'transition to a changed stack'
"""Told in the state while one is under way."""
IN_A_ROW = 3
"""So many joint states are answered before other work, if they wait already."""


class ControllerNode(ManagedNode):
    """Answers joint states with joint velocity commands.

    It waits for joint states alone and answers the newest in `work`. What else there is to do,
    which takes an executor longer than a cycle to look for, follows an answer at times, as long
    as no state waits.
    """

    def __init__(self) -> None:
        # An undeclared name then reaches `_check_parameters`, which knows what is meant.
        super().__init__('tp_controller', allow_undeclared_parameters=True)
        self._state_publisher = self.create_publisher(
            ControllerState, '~/state', STATE_QUEUE_DEPTH
        )
        self._diagnostics = Diagnostics(self)
        self._added: set[str] = set()
        """Names of tasks that came while running."""
        self.begin()

    def check(self, given: Mapping[str, Any]) -> None:
        """Check parameters as far as that is possible without the robot."""
        read_parameters(given)

    def show_waiting(self, message: str) -> None:
        """Publish what is waited for."""
        state = ControllerState(status=ControllerState.WAITING, scale=1.0, message=message)
        self._state_publisher.publish(state)
        self._diagnostics.wait(message)

    def start(self, given: Mapping[str, Any], description: str | None) -> None:
        """Build the stack of tasks and listen to joint states and goals."""
        self._settings = build_settings({START: HOLD, **given}, description, find_rate=True)
        self._added.clear()
        values = self._settings.values
        self._stack = self._settings.stack
        rate, limit = values['rate'], values['timeouts.joint_state']
        period = 1.0 / rate if rate else math.inf

        self._warnings = Warnings(self.log.warning, self.log.info)
        watch = StateWatch(limit, period, time.monotonic() - time.time())
        self._intake = Intake(self, watch, self._stack.robot.coordinates)
        control = Control(
            self,
            self._settings,
            self._intake,
            watch,
            limit,
            self._warnings,
            self.log,
            self._refuse_at_rest,
            self._found_rate,
        )
        self._state, self._inputs = control.state, control.inputs
        self._commands, self._cycle = control.commands, control.cycle
        self._live_parameters = LiveParameters(self, self._settings, self._state.follow_hierarchy)
        for task in self._stack.tasks.values():
            list(self._listen(task))
        if self._settings.values[START] == HOLD:
            self._warn_of_feedforwards('from the start, though start is hold')
        self._positions = control.positions
        if control.missing_rate:
            self._warnings.warn('rate', control.missing_rate, lasting=not control.positions)
        self._surroundings = Surroundings(self, control, self._diagnostics)
        self._publication = StatePublication(self._state_publisher, control, self._texts)
        self._heartbeat_at = -math.inf
        # Steady times [s] at which things are due.
        self._look_at = self._serve_at = self._served = -math.inf
        self._brake_at = math.inf
        self._answered = False
        self._hold = Hold(self, self._settings, self.log, self._on_hold)
        self._reach: ReachServer | None = None
        self._around: Around | None = None
        self._description_given = description
        self._later: Iterator[None] | None = self._begin_later()
        StackServices(self, self._settings, self._on_task_added, self._on_task_removed)
        self._state.msg.status = ControllerState.INACTIVE
        self._targets: dict[str, Any] | None = None
        """Targets of the tasks when the node was deactivated, None before."""
        # What is there now stays: the collector need not look at it again, which takes long.
        gc.collect()
        gc.freeze()

    def _begin_later(self) -> Iterator[None]:
        """Listen to trajectories and ``~/reach``, with pauses, which need not wait for the start.

        All of it takes 50 ms.
        """
        for task in list(self._stack.tasks.values()):
            if task.name in self._stack.tasks:
                yield from self._inputs.listen_to_trajectories(task)
        import tp_interfaces.action

        yield
        import rclpy.action

        _ = tp_interfaces.action, rclpy.action
        yield
        import tp_controller.planning.remote

        _ = tp_controller.planning.remote
        yield
        from tp_controller.ros.around import Around
        from tp_controller.ros.reach import ReachServer

        yield
        velocity, settings = self._commands.velocity, self._settings
        self._around = Around(
            settings, self._description_given, velocity, self.log, self._on_rearranged
        )
        if any(task.around for task in self._stack.tasks.values()):
            self._around.prepare()
        self._surroundings.around = self._around
        self._inputs.answered.follow(self._around)
        self._reach = ReachServer(
            self, self._stack, self._inputs, velocity, self.log, self._refuse_at_rest, self._around
        )
        self._inputs.aimed = self._reach.watch

    def activate(self) -> None:
        """Answer joint states from now on, as at the start."""
        if self._targets is not None and self._settings.values[RESUME] == PRESENT:
            self._stack.forget_targets(self._targets)
        self._cycle.begin()
        self._inputs.active = True
        levels = ', '.join(self._stack.hierarchy) or 'none, the arm rests'
        self.log.info(f'waiting for joint states; tasks by level: {levels}')
        self._publication.due = True

    def deactivate(self) -> str:
        """Bring the arm to rest inside its limits; nothing is sent afterwards."""
        stack = self._stack
        held = stack.held
        self._end_goals('deactivated')
        stack.hold()
        try:
            return self._cycle.end()
        except Exception:
            self._commands.send(0.0)
            raise
        finally:
            if not held:
                stack.resume(targets=True)
            # Goals that come from now on count.
            self._inputs.release.end_all()
            self._inputs.feedforwards.end_all()
            self._inputs.active = False
            self._inputs.robot_lost()
            self._targets = {name: task.settings[0] for name, task in stack.tasks.items()}
            self._cycle.show_held()
            self._state.refresh(self._commands.velocity)
            self._publication.publish()

    def added(self, key: str) -> bool:
        """Whether a parameter is one of a task that was added."""
        block, _, name = key.partition('.')
        return block == 'tasks' and name.partition('.')[0] in self._added

    def close(self) -> None:
        """Let parameters be, and the action."""
        self._live_parameters.close()
        self._later = None
        if self._reach is not None:
            self._reach.close()
        self._surroundings.close()

    def _refuse_at_rest(self, key: str) -> None:
        refuse_at_rest(key, self._stack.held, self.active)

    def _end_goals(self, cause: str) -> None:
        """End all that is under way to goals or along paths."""
        if self._reach is not None:
            self._reach.interrupt(cause)
        self._inputs.end_motion()

    def stop(self) -> str:
        """Bring the robot to rest."""
        if not (self.started and self.active):
            return ''
        try:
            return self._cycle.braking.finish()
        except Exception as error:
            self._commands.send(0.0)
            self._commands.wait_until_arrived()
            return (
                f'{self._commands.rest} sent, as braking failed: {type(error).__name__}: {error}'
            )

    def survives(self, error: Exception) -> bool:
        """Go on if control itself is not concerned; say so."""
        if not self.started or isinstance(error, ControlFailed | rclpy_implementation.RCLError):
            return False
        trace = ''.join(traceback.format_exception(error))
        self.get_logger().error(
            f'a callback failed, control goes on: {type(error).__name__}: {error}\n{trace}',
            throttle_duration_sec=WARNING_PERIOD,
        )
        return True

    def _warn_of_feedforwards(self, when: str) -> None:
        for name, task in self._stack.tasks.items():
            if self._stack.level_of(name) >= 0 and task.feedforward.any():
                self.log.warning(f'tasks.{name}.feedforward moves the arm {when}')

    def _found_rate(self, rate: float) -> None:
        """Tell that ranges are kept from now on."""
        self._diagnostics.health.rate = rate
        self._warnings.clear('rate', '')
        self._warnings.warn(
            'found rate', f'rate: {rate:.4g} Hz, found from the joint states; ranges are kept'
        )
        for task in self._stack.tasks.values():
            self._warn_of(task)

    def _warn_of(self, task: Task) -> None:
        for warning in task.warnings:
            self.log.warning(warning)

    # Tasks

    def _listen(self, task: Task) -> Iterator[None]:
        """Take inputs of a task, with pauses, and say what there is to say about it."""
        yield from self._inputs.listen(task)
        self._warn_of(task)

    def _on_task_added(self, task: Task) -> Iterator[None]:
        self._follow_tasks()
        yield
        self._added.add(task.name)
        yield from self._live_parameters.declare(task)
        yield from self._listen(task)
        yield from self._inputs.listen_to_trajectories(task)

    def _on_task_removed(self, task: Task, keys: Sequence[str]) -> Iterator[None]:
        self._inputs.forget(task)
        self._follow_tasks()
        yield
        self._live_parameters.forget(keys)
        self._added.discard(task.name)

    def _follow_tasks(self) -> None:
        self._state.follow_tasks()
        self._surroundings.follow_tasks()

    def _on_rearranged(self) -> None:
        """Show that other levels act; before the next step there is nothing to explain."""
        self._state.follow_hierarchy()
        self._publication.rearranged = True

    def _on_hold(self) -> None:
        """Show at once that a hold has begun or ended, or that the arm has come to rest."""
        self._cycle.show_held()
        self._publication.due = True
        if self._stack.held:
            self._end_goals(HELD)
        if not self._stack.held and self._settings.values[RESUME] == PRESENT:
            self._warn_of_feedforwards('after the hold, though resume is present')

    # Cycle, and what is done between two of them

    def spin(self, executor: Executor) -> None:
        """Do what is due, else wait for a joint state; see `RobotNode.spin`."""
        if not (self.started and self.active):
            super().spin(executor)
            return
        now = time.monotonic()
        answered, self._answered = self._answered, False
        if now >= self._brake_at:
            # What was missed is not caught up: every command of braking is a step of it.
            period = self._cycle.braking.period
            self._brake_at = max(self._brake_at + period, now + EARLIEST * period)
            self._brake()
        elif now >= self._look_at:
            self._look_at = now + self._cycle.braking.look_period
            self._look()
        elif self._later is not None:
            if next(self._later, self) is self:
                self._later = None
        elif now >= self._serve_at or (answered and now >= self._served + SERVE_AGAIN):
            self._serve(executor)
        else:
            until = min(self._brake_at, self._look_at, self._serve_at)
            if now < (ready := self._cycle.ready_at):
                # A state that waits would end every wait for one.
                time.sleep(min(until, ready) - now)
            else:
                self._intake.wait(until - now)

    def _serve(self, executor: Executor) -> None:
        """Execute callbacks that are ready, one or more, until a joint state waits."""
        pause = SERVE_PERIOD
        while True:
            try:
                handler, entity, _ = executor.wait_for_ready_callbacks(timeout_sec=0.0)
            except TimeoutException:
                break
            if not isinstance(entity, Timer):
                pause = SERVE_SOON
            handler()
            if (error := handler.exception()) is not None:
                raise error
            if self._intake.waits():
                pause = SERVE_AGAIN
                break
        self._served = time.monotonic()
        self._serve_at = self._served + pause

    def work(self) -> None:
        """Answer the newest joint state; without one, take over goals that wait."""
        if not self.started:
            return
        if not self.active:
            self._idle()
            return
        for turn in range(1, IN_A_ROW + 1):
            if not self._control():
                break
            self._answered = True
            self._publication.publish_cycle(turn < IN_A_ROW)
        else:
            return
        if not self._answered:
            self._publication.due |= self._inputs.handle(self._cycle.duration)
        self._publication.publish_change()

    def _idle(self) -> None:
        """Take goals over and show that the node lives, while it is inactive."""
        self._intake.take()
        self._publication.due |= self._inputs.handle(HEARTBEAT)
        now = time.monotonic()
        if self._publication.due or now - self._heartbeat_at >= HEARTBEAT:
            self._heartbeat_at = now
            self._publication.publish()

    def _control(self) -> bool:
        """Answer the newest joint state that waits, if there is one; return whether it was."""
        if not self._cycle.work():
            return False
        if self._cycle.running:
            self._brake_at = math.inf
            self._inputs.robot_seen()
        self._hold.look()
        if self._reach is not None and self._reach.active:
            self._reach.look()
        if self._inputs.release:
            self._inputs.release.look()
        return True

    def _texts(self) -> Iterable[str]:
        """What the state tells beside the warnings."""
        return (
            '' if self.active else INACTIVE,
            self._hold.message,
            self._around.text if self._around is not None else '',
            TRANSITION if self._stack.in_transition else '',
        )

    def _look(self) -> None:
        """Bring the robot to rest when joint states stop, and show that the node lives."""
        if self._control():
            self._publication.publish_cycle(False)
        self._diagnostics.health.see()
        self._surroundings.look(self._cycle.braking.look_period)
        for task in self._stack.tasks.values():
            for notice in task.take_notices():
                self._warnings.warn(f'{task.name} contact', notice)
        now = time.monotonic()
        if self._cycle.look():
            self._brake()
            self._brake_at = now + self._cycle.braking.period
            self._heartbeat_at = -math.inf
        if self._reach is not None and self._reach.active and not self._cycle.running:
            self._reach.look_without_states()
        if self._cycle.running or now - self._heartbeat_at < 0.999 * HEARTBEAT:
            return
        self._heartbeat_at = now
        if self._cycle.braking.zeros >= ZEROS and not self._positions:
            # An old position could make an arm jump that comes back somewhere else.
            self._cycle.braking.send_next()
        self._publication.publish()

    def _brake(self) -> None:
        self._cycle.braking.send_next()
        self._hold.look()
        self._state.refresh(self._commands.velocity)
        if self._cycle.braking.zeros >= ZEROS:
            self._brake_at = math.inf
