"""/diagnostics: what is told of a controller that works, gets bad goals, and hears nothing."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from tp_controller.ros.diagnostics import CYCLE, GOALS, JOINT_STATES, MOTION, PARTS, Health
from tp_interfaces.msg import ControllerState
from tp_sim.harness import ClosedLoop, GoalRejected


def judged(state, warnings=(), received=60):
    """Status of every part after one second."""
    health = Health(state, 60.0)
    second = health.count(1.0, received)._replace(passed=1.0)
    statuses = health.statuses(second, ['joint_1 velocity'], dict(warnings))
    assert [status.name for status in statuses] == list(PARTS)
    return {status.name: status for status in statuses}


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_everything_is_in_order_while_joint_states_are_answered():
    state = ControllerState(status=ControllerState.RUNNING, scale=0.5, cycles=59, overruns=2)
    found = judged(state)
    assert {status.level for status in found.values()} == {DiagnosticStatus.OK}
    assert values(found[JOINT_STATES])['actual frequency (Hz)'] == '60.0'
    assert values(found[CYCLE])['late in the last second'] == '2'
    assert values(found[MOTION])['limits met'] == 'joint_1 velocity'


def test_joint_states_that_have_stopped_are_an_error_and_those_yet_to_come_a_warning():
    for status, level in (
        (ControllerState.STALE, DiagnosticStatus.ERROR),
        (ControllerState.WAITING, DiagnosticStatus.WARN),
        (ControllerState.INACTIVE, DiagnosticStatus.OK),
    ):
        found = judged(ControllerState(status=status))
        assert found[JOINT_STATES].level == level
        if level != DiagnosticStatus.OK:
            assert 'joint states' in found[JOINT_STATES].message
        assert found[CYCLE].level == DiagnosticStatus.OK


def test_a_warning_is_told_by_the_part_that_it_is_about():
    state = ControllerState(status=ControllerState.RUNNING)
    for subject, part in (
        ('late', CYCLE),
        ('rate', JOINT_STATES),
        ('/joint_states', JOINT_STATES),
        ('oscillation', MOTION),
        ('hand goal', GOALS),
        ('/tp_controller/hand/goal type', GOALS),
    ):
        found = judged(state, {subject: 'it is so'})
        assert (found[part].level, found[part].message) == (DiagnosticStatus.WARN, 'it is so')
        assert sum(status.level == DiagnosticStatus.WARN for status in found.values()) == 1


def test_a_running_controller_tells_of_refused_goals_and_of_joint_states_that_stop(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        client, newest = loop.client, {}

        def keep(msg):
            newest.update({status.name.partition(': ')[2]: status for status in msg.status})

        client.subscribe(DiagnosticArray, '/diagnostics', keep)

        def wait_for(part, level, message):
            def there():
                status = newest.get(part)
                return status and status.level == level and message in status.message

            client.wait_for(there, f'{part}: {message}')

        wait_for(MOTION, DiagnosticStatus.OK, 'running')
        assert newest[MOTION].name == 'tp_controller: motion'
        assert newest[MOTION].hardware_id == 'dh_arm'
        for _ in range(3):
            with pytest.raises(GoalRejected):
                loop.send_goal('ee_position', [1.0, 0.5], 'map')
        wait_for(GOALS, DiagnosticStatus.WARN, "header.frame_id: got 'map'")
        assert values(newest[GOALS])['refused since start'] == '3'
        client.set_parameters('tp_sim', {'plant.silent': True})
        wait_for(JOINT_STATES, DiagnosticStatus.ERROR, 'no joint state for 0.1 s')
        client.set_parameters('tp_sim', {'plant.silent': False})
        wait_for(JOINT_STATES, DiagnosticStatus.OK, 'ok')
        wait_for(GOALS, DiagnosticStatus.OK, 'ok')
        lines = loop.controller.output.splitlines()
    assert any('goal rejected' in line for line in lines)
    # A busy machine may hold joint states up for longer than that, too.
    stops = sum('no joint state for 0.1 s' in line for line in lines)
    assert 1 <= stops < sum(line.endswith(': running') for line in lines)
