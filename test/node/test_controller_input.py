"""Joint states and commands of the controller: by name, every one answered, bad ones ignored."""

import numpy as np
import pytest

from tp_interfaces.msg import ControllerState
from tp_sim.harness import GoalRejected

START = [0.0, 0.6, 0.3]
UNTIMED = {'/**': {'rate': None}}
"""Without a rate it is not judged whether the arm does what it is commanded to: it may jump."""
PATIENT = {'tp_controller': {'timeouts': {'joint_state': 60.0}}}
"""Every joint state is answered, however busy the machine is."""


def test_order_of_joints_and_extra_joints_do_not_change_the_command(lone_controller):
    controller = lone_controller(UNTIMED)
    plain = controller.ask(START)
    permuted = controller.ask([0.3, 0.0, 0.6], ['joint_3', 'joint_1', 'joint_2'])
    extra = controller.ask(
        [9.0, 0.6, np.nan, 0.3, 0.0], ['gripper', 'joint_2', 'camera', 'joint_3', 'joint_1']
    )
    assert plain == permuted == extra
    assert controller.commands[-1].name == ['joint_1', 'joint_2', 'joint_3']
    assert controller.state.ignored_states == controller.held_up


def seen(state):
    """Joint states that the controller has answered or counted otherwise."""
    return state.cycles + state.skipped + state.ignored_states


def test_the_newest_state_is_answered_with_its_stamp_and_older_ones_are_counted(lone_controller):
    controller = lone_controller(UNTIMED)
    controller.ask(START)
    # In bursts that the controller's queue holds, as after a process was not scheduled.
    for _ in range(4):
        for _ in range(50):
            controller.give(START)
        count = controller.stamp
        controller.client.wait_for(
            lambda count=count: seen(controller.state) == count, 'all to be seen'
        )
        if controller.state.ignored_states == 0:
            assert controller.state.header.stamp.sec == count
    cycles = controller.state.cycles

    def answered():
        return [c.header.stamp.sec for c in controller.commands if any(c.velocity)]

    controller.client.wait_for(lambda: len(set(answered())) >= cycles, 'all commands')
    stamps = [stamp for stamp in answered() if stamp <= count]
    assert len(stamps) == cycles
    assert stamps == sorted(set(stamps))
    assert controller.state.overtaken == 0


def test_the_state_of_every_cycle_arrives_though_the_next_joint_state_comes_at_once(
    lone_controller,
):
    controller = lone_controller(UNTIMED | PATIENT)
    controller.ask(START)
    states = []
    controller.client.on_state.append(states.append)
    for _ in range(100):
        # The next one is sent when the command is there, whether its state is or not.
        stamp = controller.give(START).header.stamp
        controller.client.wait_for(
            lambda stamp=stamp: controller.commands[-1].header.stamp == stamp, 'the command'
        )
    controller.client.wait_for(lambda: controller.state.header.stamp == stamp, 'the last state')
    sent = {c.header.stamp.sec: list(c.velocity) for c in controller.commands}
    told = [state for state in states if state.status == ControllerState.RUNNING]
    cycles = [state.cycles for state in told]
    assert cycles == list(range(cycles[0], cycles[-1] + 1))
    assert all(list(state.command) == sent[state.header.stamp.sec] for state in told)


@pytest.mark.parametrize('speed', [1.0, 0.1])
def test_no_component_exceeds_its_limit_and_the_direction_is_kept(lone_controller, speed):
    limits = [speed, speed / 2.0, speed / 4.0]
    free = lone_controller({'/**': {'rate': None, 'robot': {'limits': None}}})
    limited = lone_controller({'/**': {'rate': None, 'robot': {'limits': {'velocity': limits}}}})
    for position in ([0.0, 0.6, 0.3], [1.0, -2.0, -0.4], [-2.0, 0.1, 2.5]):
        wanted = np.array(free.ask(position))
        command = np.array(limited.ask(position))
        assert np.all(np.abs(command) <= limits)
        scale = min(1.0, float(np.min(np.array(limits) / np.abs(wanted))))
        assert command == pytest.approx(scale * wanted, rel=1e-12)
        assert limited.state.scale == pytest.approx(scale)


def test_bad_joint_states_are_ignored_counted_and_explained(lone_controller):
    controller = lone_controller()
    before = controller.ask(START)
    answered = len(controller.commands)
    assert 'finite' in controller.give_bad([0.0, np.nan, 0.3])
    assert 'finite' in controller.give_bad([0.0, np.inf, 0.3])
    assert "no 'joint_2'" in controller.give_bad([0.0, 0.3], ['joint_1', 'joint_3'])
    assert "'joint_1' 2 times" in controller.give_bad(
        [0.0, 0.0, 0.6, 0.3], ['joint_1', 'joint_1', 'joint_2', 'joint_3']
    )
    assert '2 values for 3 names' in controller.give_bad([0.0, 0.6])
    assert controller.give_bad([], []) != ''
    assert controller.state.ignored_states == 6 + controller.held_up
    assert all(
        list(command.velocity) == [0.0, 0.0, 0.0] for command in controller.commands[answered:]
    ), 'only the zero command of a stale state may follow'
    assert controller.ask(START) == before
    assert controller.state.status == ControllerState.RUNNING


def test_before_the_first_state_unknown_values_are_not_numbers(lone_controller):
    controller = lone_controller({'tp_controller': {'tasks': {'ee_position': {'target': None}}}})
    position, joint = controller.state.tasks
    assert np.isnan(position.error_norm)
    assert np.all(np.isnan([*position.error, *position.current, *position.desired]))
    assert list(joint.desired) == [0.0]
    assert np.all(np.isnan(controller.state.position))


def test_a_refused_goal_is_told_even_while_bad_states_are(lone_controller):
    controller = lone_controller()
    client = controller.client
    controller.ask(START)
    for number in range(3):
        controller.give_bad([0.0, np.nan, 0.3])
        with pytest.raises(GoalRejected, match=f'map_{number}'):
            client.send_goal('ee_position', [1.0, 0.5], frame=f'map_{number}')
        controller.process.wait_for_output(
            f"ee_position: goal rejected: header.frame_id: got 'map_{number}'"
        )


def test_when_states_stop_the_command_goes_to_zero_and_resumes(lone_controller):
    controller = lone_controller()
    assert controller.state.status == ControllerState.WAITING
    before = controller.ask(START)
    client = controller.client
    client.wait_for(lambda: controller.state.status == ControllerState.STALE, 'stale')
    client.spin_for(0.5)
    assert any(controller.commands[0].velocity)
    zeros = controller.commands[1:]
    assert len(zeros) > 10, 'zero commands are repeated'
    assert not any(any(command.velocity) for command in zeros)
    assert controller.ask(START) == before
    client.wait_for(lambda: controller.state.status == ControllerState.RUNNING, 'running')


def test_braking_shortens_the_time_of_the_next_state_alone(lone_controller):
    controller = lone_controller()
    controller.ask(START)
    client = controller.client
    client.wait_for(lambda: controller.state.status == ControllerState.STALE, 'stale')
    controller.ask(START)
    # By its stamp a second later, but at once: what held it up held the others up, too.
    controller.ask([0.4, 0.6, 0.3])
    assert 'jumped' not in controller.state.message


def test_bad_states_alone_make_the_controller_stale(lone_controller):
    controller = lone_controller()
    controller.ask(START)
    while controller.state.status != ControllerState.STALE:
        controller.give_bad([0.0, np.nan, 0.3])
    controller.client.wait_for(
        lambda: list(controller.commands[-1].velocity) == [0.0, 0.0, 0.0], 'a zero command'
    )


def test_array_commands_carry_the_same_velocities_in_the_order_of_the_joints(lone_controller):
    named = lone_controller()
    plain = lone_controller({'/**': {'command': {'type': 'float64_multi_array'}}} | PATIENT)
    expected = named.ask(START)
    while not plain.commands:
        # The first ones come while it asks who reads its commands.
        plain.give([0.3, 0.0, 0.6], ['joint_3', 'joint_1', 'joint_2'])
        plain.client.spin_for(0.02)
    assert list(plain.commands[0].data) == expected


def test_a_task_without_a_target_holds_its_first_value(lone_controller):
    untargeted = {'tp_controller': {'tasks': {'ee_position': {'target': None}}}}
    controller = lone_controller(UNTIMED | untargeted)
    controller.client.wait_for(lambda: controller.state is not None, 'a state')
    assert np.abs(controller.ask(START)).max() < 1e-12
    assert np.abs(controller.ask([0.1, 0.6, 0.3])).max() > 1e-3


def test_remapped_topics_and_namespaces_keep_robots_apart(lone_controller):
    controller = lone_controller(
        ros_arguments=[
            *('-r', 'joint_states:=/arm/joint_states'),
            *('-r', 'joint_velocity_command:=/arm/velocity'),
        ],
        wait=False,
    )
    client = controller.client
    client.wait_for(lambda: client.state is not None, 'the controller')
    topics = {'/arm/joint_states', '/arm/velocity'}
    client.wait_for(
        lambda: topics <= set(dict(client.node.get_topic_names_and_types())), 'its topics'
    )
    client.wait_for(lambda: client.node.count_publishers('/arm/velocity') == 1, 'its commands')


def test_joint_states_that_come_more_slowly_than_the_rate_says_are_warned_of(lone_controller):
    controller = lone_controller()
    # One a second, by their stamps.
    for burst in range(5):
        for _ in range(50):
            controller.give(START)
        count = 50 * (burst + 1)
        controller.client.wait_for(
            lambda count=count: seen(controller.state) == count, 'all to be seen'
        )
    warning = 'joint states come at 1 Hz, rate is 60: limits of position, acceleration and'
    controller.client.wait_for(lambda: warning in controller.process.output, 'the warning')


def test_a_first_joint_state_without_joints_is_ignored(lone_controller):
    controller = lone_controller()
    controller.give([], [])
    controller.client.wait_for(lambda: controller.state.ignored_states == 1, 'the count')
    assert "no 'joint_1' in ['gripper']" in controller.give_bad([0.1], ['gripper'])
    assert any(controller.ask(START))
