"""A controller without a simulator, which a test asks for one command at a time."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_interfaces.msg import ControllerState
from tp_sim.harness import (
    Client,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

JOINTS = ['joint_1', 'joint_2', 'joint_3']


class LoneController:
    """The controller's process, joint states for it and the commands that come back."""

    def __init__(self, path: Path, command_type: type, ros_arguments: Sequence[str]) -> None:
        self.domain = PrivateDomain()
        self.process = NodeProcess(
            'tp_controller', 'controller', path, self.domain.environment(), ros_arguments
        )
        self.client = Client(self.domain)
        self.commands: list[Any] = self.client.collect(command_type, 'joint_velocity_command')
        self.stamp = 0
        self.held_up = 0
        """Joint states that a busy machine held up until they were too old, see `ask`."""

    def wait_until_up(self) -> None:
        """Wait until it speaks, and hears and is heard."""
        self.client.wait_for(lambda: self.client.state is not None, 'the controller')
        node = self.client.node
        self.client.wait_for(
            lambda: node.count_publishers('joint_velocity_command') == 1, 'its commands'
        )

    def give(
        self, position: Sequence[float], names: Sequence[str] = JOINTS, **fields: Any
    ) -> JointState:
        """Publish a joint state with a stamp of its own."""
        self.stamp += 1
        msg = JointState(name=list(names), position=list(position), **fields)
        msg.header.stamp.sec = self.stamp
        self.client.publish('joint_states', msg)
        return msg

    def ask(
        self, position: Sequence[float], names: Sequence[str] = JOINTS, **fields: Any
    ) -> list[float]:
        """Publish a joint state and return the velocities that answer it.

        A busy machine may hold it up until it is too old: then another one is published.
        """
        while True:
            stamp = self.give(position, names, **fields).header.stamp
            ignored = self.state.ignored_states

            def answers(stamp: Time = stamp) -> list[JointState]:
                return [command for command in self.commands if command.header.stamp == stamp]

            self.client.wait_for(
                lambda stamp=stamp, ignored=ignored, answers=answers: (
                    (answers() and self.state.header.stamp == stamp)
                    or self.state.ignored_states > ignored
                ),
                'a command and its state',
            )
            if found := answers():
                return list(found[0].velocity)
            self.held_up += 1

    def give_bad(self, position: Sequence[float], names: Sequence[str] = JOINTS) -> str:
        """Publish a joint state that is to be ignored; return what is said about it."""
        before = self.state.ignored_states
        self.give(position, names)
        self.client.wait_for(lambda: self.state.ignored_states == before + 1, 'it to be counted')
        return self.state.message

    @property
    def state(self) -> ControllerState:
        """Newest state."""
        assert self.client.state is not None
        return self.client.state

    def close(self) -> None:
        """Stop everything."""
        self.process.stop()
        self.client.close()
        self.domain.close()


@pytest.fixture
def lone_controller(config: Path, tmp_path: Path) -> Iterator[Any]:
    """Make controllers from A4 with changes."""
    made: list[LoneController] = []

    def make(
        changes: Mapping[str, Any] | None = None,
        ros_arguments: Sequence[str] = (),
        wait: bool = True,
        name: str = 'a4_position_joint',
    ) -> LoneController:
        document = edited(read_document(config / f'{name}.yaml'), changes or {})
        path = tmp_path / f'parameters_{len(made)}.yaml'
        write_document(document, path)
        array = document['/**'].get('command', {}).get('type') == 'float64_multi_array'
        controller = LoneController(
            path, Float64MultiArray if array else JointState, ros_arguments
        )
        made.append(controller)
        if wait:
            controller.wait_until_up()
        return controller

    yield make
    for controller in made:
        controller.close()
