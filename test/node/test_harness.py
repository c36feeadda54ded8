"""The harness itself: what it records, and how it fails."""

import time

import numpy as np
import pytest

from tp_sim.harness import Client, ClosedLoop, HarnessError, PrivateDomain


def test_the_record_is_consistent_with_itself(config):
    with ClosedLoop(config / 'a4_position_joint.yaml') as loop:
        loop.run(2.0)
        record = loop.record
    assert record.time == pytest.approx(np.arange(121) / 60.0, abs=1e-6)
    # Every command is integrated over one period.
    assert np.diff(record.q, axis=0) == pytest.approx(record.qd[:-1] / 60.0, abs=1e-12)
    for task in ('ee_position', 'joint_1_position'):
        assert record.error_norm[task] == pytest.approx(np.linalg.norm(record.error[task], axis=1))
        assert record.error[task] == pytest.approx(record.desired[task] - record.current[task])
        assert record.requested[task] == pytest.approx(record.error[task])
    assert record.achieved['joint_1_position'] == pytest.approx(record.qd[:, :1])
    assert np.all(record.solve_time > 0.0)


def test_real_time_runs_as_long_as_asked_and_records_from_the_first_cycle(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        begin = time.monotonic()
        loop.run(1.0)
        assert time.monotonic() - begin >= 1.0
        # A busy machine brings the messages later.
        loop.client.wait_for(lambda: loop.time > 0.8, 'a second of cycles')
        record = loop.record
    assert record.q[0] == pytest.approx([0.0, 0.6, 0.3])
    assert record.error_norm['ee_position'][-1] < record.error_norm['ee_position'][0]


@pytest.mark.parametrize('by', [0.02, 1.0])
def test_after_a_reset_the_arm_is_where_it_was_put_and_the_command_answers_the_tasks(config, by):
    """A jump by a little looks like an arm that does not follow, which is braked for a while."""
    with ClosedLoop(config / 'a4_position_joint.yaml') as loop:
        loop.run(0.5)
        braking = []
        loop.client.on_state.append(lambda state: braking.append(state.braking))
        place = {f'joint_{i + 1}': float(q + by) for i, q in enumerate(loop.record.q[-1])}
        begin = loop.time
        loop.reset(place)
        assert any(braking)
        assert not loop.state.braking
        assert list(loop.state.position) == pytest.approx(list(place.values()), abs=1e-9)
        assert np.abs(loop.state.command).max() > 0.1
        assert loop.time - begin < 2.0
        for name in ('ee_position', 'joint_1_position'):
            loop.set_parameters({f'tasks.{name}.enabled': False})
        loop.reset()
        assert loop.state.braking
        assert list(loop.state.position) == pytest.approx([0.0, 0.6, 0.3], abs=1e-9)


def test_a_node_that_refuses_its_parameters_is_reported_with_its_message(config):
    changes = {'tp_controller': {'hierarchy': ['hand']}}
    with pytest.raises(HarnessError, match="status 2:\ntp_controller: hierarchy: got 'hand'"):
        ClosedLoop(config / 'a4_position_joint.yaml', changes)


def test_a_node_that_dies_is_reported(config):
    with ClosedLoop(config / 'a4_position_joint.yaml') as loop:
        loop.controller.stop()
        with pytest.raises(HarnessError, match='controller ended with status 0'):
            loop.run(1.0)


def test_two_robots_in_namespaces_do_not_disturb_each_other(config):
    with (
        ClosedLoop(config / 'a1_position.yaml', namespace='arm_1') as one,
        ClosedLoop(config / 'a1_position.yaml', namespace='arm_2') as two,
    ):
        two.send_goal('ee_position', [0.3, 1.2])
        one.run(5.0)
        two.run(5.0)
        topics = dict(one.client.node.get_topic_names_and_types())
    assert '/arm_1/joint_states' in topics
    assert one.record.current['ee_position'][-1] == pytest.approx([1.0, 0.5], abs=0.01)
    assert two.record.current['ee_position'][-1] == pytest.approx([0.3, 1.2], abs=0.02)


def test_domains_are_private_until_closed():
    domains = [PrivateDomain() for _ in range(5)]
    assert len({domain.number for domain in domains}) == 5
    for domain in domains:
        assert domain.environment()['ROS_DOMAIN_ID'] == str(domain.number)
        domain.close()


def test_a_domain_that_others_are_on_is_not_private(monkeypatch):
    """Their nodes hold no lock; with a robot among them it would move."""
    with_it = PrivateDomain()
    first = Client(with_it)
    taken = PrivateDomain()
    # The second participant of this process, as is one that stays when the first one leaves.
    client = Client(taken)
    monkeypatch.setattr('tp_sim.harness.domain.DOMAINS', range(taken.number, taken.number + 1))
    # As if somebody else had made that node, without a lock.
    taken.close()
    with pytest.raises(HarnessError, match='in use'):
        PrivateDomain()
    client.close()
    PrivateDomain().close()
    first.close()
    with_it.close()
