"""One case: simulator, relay and controller on a private domain, goals, recovery and judgement."""

from __future__ import annotations

import shlex
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PointStamped

from tp_sim.faults import arm
from tp_sim.faults.disturbances import Disturbance, passed_on
from tp_sim.faults.judge import Findings, judge
from tp_sim.faults.pauses import PauseWatch
from tp_sim.faults.record import Command, longest
from tp_sim.faults.relay import PLANT_COMMANDS, PLANT_STATES, Relay, Topics
from tp_sim.harness import (
    Client,
    HarnessError,
    PrivateDomain,
    Process,
    executable_path,
    write_document,
)

REACHED = 0.01
"""Distance [m] from a goal that counts as reached."""
LONGEST_WAY = 15.0
"""Time [s] in which a goal has to be reached, start of a process and all."""
LONGEST_START = 30.0
"""Time [s] in which the arm has to move, start of a process and all."""
AGAIN = 0.2
"""Time [s] after which a goal is sent again until the arm moves."""
MOVING = 0.3
"""Share of the time of a disturbance for which the arm has to move, where nothing else is said."""
LEG = 1.5
"""Time [s] between goals while the arm is kept moving."""
NODES = ('simulator', 'controller')
CRASHES = ('Traceback', 'terminate called', 'Segmentation fault', 'Fatal Python error')
STOPPING = 0.05
"""Time [s] beyond `arm.HOLD` in which an arm without commands comes to rest."""


@dataclass(frozen=True)
class Judged:
    """The controller that is judged.

    Attributes
    ----------
    command
        Its command line; ``{parameters}`` is replaced by the parameter file of the arm. Empty for
        this project's controller.
    node
        Name of its node.
    topics
        Names of its topics.
    """

    command: str = ''
    node: str = 'tp_controller'
    topics: Topics = field(default_factory=Topics)

    def line(self, parameters: Path) -> list[str]:
        """Program and arguments, to which ROS arguments may be added."""
        if self.command:
            return shlex.split(self.command.replace('{parameters}', str(parameters)))
        own = str(executable_path('tp_controller', 'controller'))
        return [own, '--ros-args', '--params-file', str(parameters)]


class Rig:
    """Processes of a case and what is done with them.

    Parameters
    ----------
    judged
        The controller.
    watch
        Tells pauses of the machine.
    namespace
        Of both nodes.
    domain
        Where the nodes are; one of its own when left out.
    started
        Whether to start both nodes and wait until they are connected.
    rate
        Joint states per second [Hz].
    """

    def __init__(
        self,
        judged: Judged,
        watch: PauseWatch,
        namespace: str = '',
        domain: PrivateDomain | None = None,
        started: bool = True,
        rate: float = arm.RATE,
    ) -> None:
        self.judged = judged
        self.watch = watch
        self.namespace = namespace
        self.rate = rate
        self._own_domain = PrivateDomain() if domain is None else None
        self.domain = domain or self._own_domain
        assert self.domain is not None
        self.folder = Path(tempfile.mkdtemp(prefix='tp_faults_'))
        self.environment = self.domain.environment() | {'ROS_LOG_DIR': str(self.folder / 'log')}
        self.parameters = self.folder / 'parameters.yaml'
        write_document(arm.parameters(rate=rate), self.parameters)
        self.relay = Relay(self.domain, judged.topics, namespace)
        self.client = Client(self.domain, namespace, self._check)
        self.client.ignore_state()
        self.processes: list[Process] = []
        self.stamped = judged.topics.stamped
        """Whether stamps tell which joint state a command answers."""
        self.mixed = False
        """Whether there are several controllers or arms: changes of commands tell nothing then."""
        self.forwarded = False
        """Whether ages count from when a joint state was passed on."""
        self.recovery = self.way = float('nan')
        """Times [s] until the arm moved again, and until it was at its goal."""
        self.well = float('nan')
        """Time [s] from which on all was well."""
        self.wrong: list[str] = []
        """What was not allowed, beside the commands."""
        self.others: list[Findings] = []
        """What was seen of the commands of other robots of the case."""
        self.notes: list[str] = []
        """What is worth telling."""
        self._goal = 0
        self._goal_topic = judged.topics.goals
        if started:
            self.simulator = self.start_simulator()
            self.controller = self.start_controller()
            self.wait_until_connected()

    # Processes

    def start_simulator(
        self, start: Sequence[float] = arm.START, *more: str, root: str = ''
    ) -> Process:
        """Start a simulator behind the relay, whose topics it finds under a root."""
        parameters = self.parameters
        if tuple(start) != arm.START:
            parameters = self.folder / 'elsewhere.yaml'
            write_document(arm.parameters(start, self.rate), parameters)
        command = [str(executable_path('tp_sim', 'simulator')), '--ros-args']
        command += ['--params-file', str(parameters), *self._in_namespace()]
        for own, plant in (
            ('joint_states', PLANT_STATES),
            ('joint_velocity_command', PLANT_COMMANDS),
        ):
            command += ['-r', f'{own}:={root}{plant}']
        return self._start('simulator', [*command, *more])

    def start_controller(
        self,
        *ros_arguments: str,
        folder: Path | None = None,
        wrapped: Sequence[str] = (),
    ) -> Process:
        """Start a controller.

        Parameters
        ----------
        *ros_arguments
            Further arguments after ``--ros-args``.
        folder
            Where it runs.
        wrapped
            Command that runs it.
        """
        line = [*wrapped, *self.judged.line(self.parameters), '--ros-args']
        line += [*self._in_namespace(), *ros_arguments]
        return self._start('controller', line, folder or self.folder)

    def start_beside(self, name: str, *command: str) -> Process:
        """Start what is neither simulator nor controller."""
        return self._start(name, command)

    def _start(self, name: str, command: Sequence[str], folder: Path | None = None) -> Process:
        process = Process(name, command, self.environment, folder)
        self.processes.append(process)
        return process

    def _in_namespace(self) -> list[str]:
        return ['-r', f'__ns:=/{self.namespace}'] if self.namespace else []

    def _check(self) -> None:
        self.relay.check()

    def wait_for(self, condition: Callable[[], bool], what: str, timeout: float = 30.0) -> None:
        """Wait for a condition.

        Raises
        ------
        HarnessError
            If it does not hold in time [s], with what the nodes printed.
        """
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                printed = '\n'.join(f'{p.name}: {p.output}' for p in self.processes)
                raise HarnessError(f'waited {timeout:g} s in vain for {what}\n{printed}')
            self._check()
            time.sleep(0.005)

    def wait_until_connected(self) -> None:
        """Wait until joint states come and are listened to."""
        self.wait_for(lambda: bool(self.relay.motions), 'joint states of the simulator')
        self.wait_for(lambda: self.relay.listeners > 0, 'a controller that takes joint states')

    # Goals

    def move_goal_topic(self, topic: str) -> None:
        """Send goals to another topic from now on."""
        self._goal_topic = topic

    def next_goal(self) -> np.ndarray:
        """Send the next goal; return its position [m]."""
        self._goal = (self._goal + 1) % len(arm.GOALS)
        self._send_goal()
        return np.array(arm.GOALS[self._goal])

    def _send_goal(self) -> None:
        msg = PointStamped()
        msg.point.x, msg.point.y = arm.GOALS[self._goal]
        self.client.publish(self._goal_topic, msg)

    def move(self, seconds: float) -> None:
        """Keep the arm moving for a time [s], from goal to goal."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.next_goal()
            self.client.spin_for(min(left, LEG))

    def to_full_speed(self) -> None:
        """Send the next goal and wait until the arm is fast."""
        self.next_goal()
        self.client.spin_for(0.7)

    def disturb(self, disturbance: Disturbance, seconds: float, moving: bool = False) -> None:
        """Keep the arm moving while joint states are disturbed, and then let them pass again.

        Parameters
        ----------
        disturbance, seconds
            What happens to them, and how long [s].
        moving
            Whether it is wrong to rest meanwhile.
        """
        begin = time.time()
        self.relay.disturbance = disturbance
        self.move(seconds)
        self.relay.disturbance = passed_on
        seen = [arm.moves(m.velocity) for m in self.relay.motions if m.time > begin]
        if moving and sum(seen) < MOVING * len(seen):
            share = 100.0 * sum(seen) / len(seen)
            self.wrong.append(f'the arm moved for {share:.0f} % of the disturbance only')

    # Judgement

    def recover(self, longest_wait: float = LONGEST_WAY) -> None:
        """From now on all is well: send a goal and take the time until the arm is there."""
        begin = self.well = time.time()
        count, goal = len(self.relay.commands), self.next_goal()
        try:
            end = time.monotonic() + LONGEST_START
            while (first := self._first_move(count, begin)) is None:
                if time.monotonic() > end:
                    raise HarnessError(f'no motion in {LONGEST_START:g} s')
                # A goal may have gone to a node that was killed.
                self._send_goal()
                self.client.spin_for(AGAIN)
            self.recovery = max(0.0, first.time - begin)
            self.wait_for(lambda: self.distance(goal) < REACHED, 'the goal', longest_wait)
            self.way = time.time() - begin
        except HarnessError as error:
            self.wrong.append(f'no recovery: {str(error).splitlines()[0]}')

    def _first_move(self, count: int, begin: float) -> Command | None:
        for command in self.relay.commands[count:]:
            if command.time > begin and arm.moves(command.velocity):
                return command
        return None

    def distance(self, goal: np.ndarray) -> float:
        """Distance [m] of the arm's end from a position."""
        return float(np.linalg.norm(arm.end_position(self.relay.motions[-1].position) - goal))

    def expect_rest(self, since: float) -> None:
        """Take note if the arm moves although commands ended at a time [s]."""
        limit = since + arm.HOLD + STOPPING + longest(self.watch.pauses(since))
        for motion in reversed(self.relay.motions):
            if motion.time < limit:
                break
            if arm.moves(motion.velocity):
                late = motion.time - since
                self.wrong.append(f'the arm still moves {late:.3g} s after the last command')
                break

    def expect_zero_last(self) -> None:
        """Take note if the last command is not zero."""
        if not self.relay.commands or any(self.relay.commands[-1].velocity):
            self.wrong.append('the last command is not zero')

    def findings(self, begin: float) -> Findings:
        """Judge everything since a time [s]."""
        found = judge(
            self.relay.sent,
            self.relay.commands,
            arm.allowed(self.rate),
            pauses=self.watch.pauses(begin),
            stamped=self.stamped,
            mixed=self.mixed,
            forwarded=self.forwarded,
        )
        for other in self.others:
            found.include(other)
        found.wrong += self.wrong
        for process in self.processes:
            told = [text for text in CRASHES if text in process.output]
            if process.name in NODES:
                found.wrong += [f'{process.name} printed {text!r}' for text in told]
        return found

    def stop(self) -> None:
        """End both nodes in a planned way; the last command has to be zero."""
        for process in reversed(self.processes):
            if not process.running:
                continue
            status = process.stop()
            if process.name == 'controller':
                time.sleep(0.1)
                self.expect_zero_last()
            if status != 0 and process.name in NODES:
                self.wrong.append(f'{process.name} ended with status {status}')

    def close(self) -> None:
        """End what still runs and leave the domain."""
        for process in self.processes:
            if process.running:
                process.kill()
        self.relay.close()
        self.client.close()
        if self._own_domain is not None:
            self._own_domain.close()
        shutil.rmtree(self.folder, ignore_errors=True)
