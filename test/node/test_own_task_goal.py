"""Goals of a task type that another package registers."""

import os

import pytest
from own_task_package import install
from std_msgs.msg import Float64

from tp_sim.harness import ClosedLoop, GoalRejected


def test_the_node_takes_goals_of_a_task_type_of_another_package(repository, tmp_path, monkeypatch):
    folder = install(repository, tmp_path)
    path = os.environ.get('PYTHONPATH', '')
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([str(folder), path]))
    with ClosedLoop(repository / 'examples' / 'own_task' / 'stack.yaml') as loop:
        loop.run(0.2)
        loop.client.publish_goal('apart', Float64(data=0.6))
        loop.run(5.0)
        assert loop.record.error_norm['apart'][-1] < 1e-4
        with pytest.raises(GoalRejected, match='a distance of at least 0'):
            loop.client.publish_goal('apart', Float64(data=-1.0))
