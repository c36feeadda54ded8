"""Simulator and controller as a closed loop over real DDS."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tp_controller.config import read_parameter_file
from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState
from tp_interfaces.srv import Reset, Step
from tp_sim.harness.client import Client, ReachCall
from tp_sim.harness.document import Document, edited, read_document, write_document
from tp_sim.harness.domain import PrivateDomain
from tp_sim.harness.errors import HarnessError
from tp_sim.harness.process import NodeProcess
from tp_sim.harness.record import Record, Recorder
from tp_sim.harness.recording import LoopRecording

LONGEST_BRAKING = 5.0
"""Simulated time [s] for which the controller may brake."""
CHUNK = 50
"""Steps of one request: fewer than the states that the controller's queue holds."""


class ClosedLoop:
    """The two executables on a private domain, with a client and a record.

    In lockstep the simulator waits for the answer to every joint state: the loop runs as
    fast as the machine allows and is repeatable to the last bit. In real time the loop
    runs from the start, and `run` waits for the wall clock.

    Parameters
    ----------
    parameters
        A parameter file, or its blocks as a dictionary (see `read_document`).
    changes
        Changes to it by block name, nested; None removes a key.
    lockstep
        Whether to step instead of running in real time.
    namespace
        Namespace of both nodes.
    on_state
        Called with every state of the controller.
    description
        URDF to publish as ``robot_description``, for nodes whose parameters name no robot.
    record
        MCAP file into which the whole run is recorded until `stop`; replaced if there is one.

    Raises
    ------
    HarnessError
        If a node does not start or the loop does not close, with what the nodes printed.
    """

    def __init__(
        self,
        parameters: str | Path | Document,
        changes: Mapping[str, Any] | None = None,
        *,
        lockstep: bool = True,
        namespace: str = '',
        on_state: Callable[[ControllerState], None] | None = None,
        description: str | None = None,
        record: str | Path | None = None,
    ) -> None:
        document = parameters if isinstance(parameters, Mapping) else read_document(parameters)
        mode = {'tp_sim': {'lockstep': lockstep, 'paused': lockstep}}
        document = edited(edited(document, changes or {}), mode)
        self._lockstep = lockstep
        self._folder = tempfile.TemporaryDirectory(prefix='tp_loop_')
        path = Path(self._folder.name) / 'parameters.yaml'
        write_document(document, path)
        self.parameter_file = path
        """Parameters of both nodes, for further processes."""
        simulated = read_parameter_file(path, 'tp_sim')
        self._rate = float(simulated.get('rate', 60.0))
        self._loses = bool(simulated.get('plant.state_loss', 0.0))
        self._recorder = Recorder()
        self._domain = PrivateDomain()
        ros_arguments = ['-r', f'__ns:=/{namespace.strip("/")}'] if namespace else []
        self.environment = self._domain.environment()
        """Environment for further processes on the same domain."""
        self.simulator: NodeProcess | None = None
        self.controller: NodeProcess | None = None
        self.client = Client(self._domain, namespace, self._check_alive)
        """For everything beyond the methods here: topics, services, waiting."""
        self.client.on_state.append(self._recorder.add)
        if on_state is not None:
            self.client.on_state.append(on_state)
        if description is not None:
            self.client.publish_description(description)
        self.recording: LoopRecording | None = None
        try:
            if record is not None:
                self.recording = LoopRecording(self.client.make_node('recorder'), record)
            self.controller = NodeProcess(
                'tp_controller', 'controller', path, self.environment, ros_arguments
            )
            if not lockstep or self.recording is not None:
                # The first cycle comes when the simulator does: then it is recorded too.
                self._wait_for_controller()
            if self.recording is not None:
                self.client.wait_for(self.recording.ready, 'the recording')
            self.simulator = NodeProcess(
                'tp_sim', 'simulator', path, self.environment, ros_arguments
            )
            self._close_loop()
        except BaseException:
            self.stop()
            raise

    def __enter__(self) -> ClosedLoop:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop both nodes and leave the domain."""
        processes = [p for p in (self.controller, self.simulator) if p is not None]
        for process in processes:
            process.interrupt()
        for process in processes:
            process.stop()
        try:
            if self.recording is not None:
                self.recording.close()
                self.recording = None
        finally:
            self.client.close()
            self._domain.close()
            self._folder.cleanup()

    @property
    def record(self) -> Record:
        """Everything since the start or the last `clear_record`."""
        return self._recorder.record()

    @property
    def time(self) -> float:
        """Time [s] of the newest cycle, as in the record."""
        return self._recorder.time

    @property
    def state(self) -> ControllerState:
        """Newest state of the controller."""
        state = self.client.state
        assert state is not None
        return state

    def clear_record(self) -> None:
        """Begin a new record; in lockstep it begins with the present state."""
        self._recorder.clear()
        if self._lockstep:
            self.step(0)

    def run(self, seconds: float) -> None:
        """Let the loop run for a time [s], simulated in lockstep, else real.

        Raises
        ------
        HarnessError
            If a node dies or a cycle is lost.
        """
        if not self._lockstep:
            self.client.spin_for(seconds)
            return
        steps = round(seconds * self._rate)
        while steps > 0:
            self.step(min(steps, CHUNK))
            steps -= CHUNK

    def run_a_little(self) -> None:
        """Let one cycle pass in lockstep, else a fiftieth of a second: for moving targets."""
        if self._lockstep:
            self.step()
        else:
            self.client.spin_for(0.02)

    def step(self, steps: int = 1) -> None:
        """Integrate that many steps in lockstep, and wait until all are recorded.

        With a ``plant.state_loss`` those are recorded that are not lost, the last one always.

        Raises
        ------
        HarnessError
            If a node dies, a cycle is lost, or the loop is not in lockstep.
        """
        before, cycles = len(self._recorder), self._recorder.cycles
        response = self.client.call(Step, 'tp_sim/step', Step.Request(steps=steps))
        if not response.success:
            raise HarnessError(response.message)
        end = response.stamp.sec * 1_000_000_000 + response.stamp.nanosec
        # The present state is answered anew, then every further one.
        least = cycles if self._loses else cycles + steps
        self.client.wait_for(
            lambda: self._recorder.cycles > least and self._recorder.newest >= end,
            'the last cycle',
        )
        if self._loses:
            return
        if len(self._recorder) < before + steps:
            lost = before + steps - len(self._recorder)
            raise HarnessError(f'{lost} of {steps} cycles were lost on their way to the record')

    def reset(self, q: Mapping[str, float] | None = None) -> None:
        """Put joints at positions [rad, m] by name; all at the initial ones if None.

        To the controller the arm has jumped, and it brakes. This waits until tasks count again:
        the arm is at these positions then, and its next command answers the tasks.

        Raises
        ------
        HarnessError
            If the simulator refuses, or the controller goes on braking.
        """
        cycles = self.state.cycles
        self._reset(q or {})
        if self._lockstep:
            # The controller believes that the arm has jumped when a second state says so.
            self.step(0)
            self._reset(q or {})
            self.step(0)
        else:
            self.client.wait_for(lambda: self.state.cycles > cycles + 1, 'an answer')
        self.wait_until_tasks_count()

    def wait_until_tasks_count(self) -> None:
        """Run until the command answers the tasks, and does not brake; at once if none is to act.

        Raises
        ------
        HarnessError
            If it goes on braking.
        """
        if not self._lockstep:
            self.client.wait_for(lambda: not self._brakes, 'the end of braking')
            return
        steps = 0
        while self._brakes:
            if steps > LONGEST_BRAKING * self._rate:
                raise HarnessError(f'the controller goes on braking: {self.state.message}')
            self.step()
            steps += 1

    @property
    def _brakes(self) -> bool:
        """Whether the controller brakes though it answers joint states and a task is to act."""
        state = self.state
        acts = any(task.enabled for task in state.tasks)
        return acts and state.status == ControllerState.RUNNING and state.braking

    def _reset(self, q: Mapping[str, float]) -> None:
        request = Reset.Request(name=list(q), position=[float(value) for value in q.values()])
        response = self.client.call(Reset, 'tp_sim/reset', request)
        if not response.success:
            raise HarnessError(response.message)

    def send_goal(self, name: str, values: Sequence[float], frame: str = '') -> None:
        """Send a goal to a task; see `Client.send_goal`."""
        self.client.send_goal(name, values, frame)

    def reach(
        self,
        goals: Mapping[str, Sequence[float]],
        tolerance: float | None = None,
        time_limit: float = 0.0,
        frame: str = '',
        around: bool = False,
    ) -> Reach.Result:
        """Run until goals are reached or cannot be; see `Client.start_reach`.

        Raises
        ------
        HarnessError
            If a node dies or a cycle is lost.
        """
        return self.finish(self.client.start_reach(goals, tolerance, time_limit, frame, around))

    def finish(self, call: ReachCall) -> Reach.Result:
        """Run until a goal that was sent has ended."""
        while self._lockstep and call.result is None:
            self.step(CHUNK // 5)
        return call.wait()

    def send_feedforward(self, name: str, values: Sequence[float], frame: str = '') -> None:
        """Send a feedforward to a task; see `Client.send_feedforward`."""
        self.client.send_feedforward(name, values, frame)

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the controller by dotted key, all of them or none.

        Raises
        ------
        GoalRejected
            If the controller refuses, with its reason.
        """
        self.client.set_parameters('tp_controller', values)

    def _wait_for_controller(self) -> None:
        self.client.wait_for(lambda: self.client.state is not None, 'the controller')

    def _close_loop(self) -> None:
        if self._lockstep:
            self._wait_for_controller()
            self.step(0)
        else:
            self.client.wait_for(
                lambda: self.state.status == ControllerState.RUNNING, 'the first cycle'
            )

    def _check_alive(self) -> None:
        for process in (self.simulator, self.controller):
            if process is not None and not process.running:
                raise HarnessError(
                    f'{process.name} ended with status {process.wait()}:\n{process.output}'
                )
