"""The fault table with real nodes: a controller that passes, and one that does not."""

import sys
from dataclasses import replace

import pytest

from tp_sim.faults.case import Case, run_case
from tp_sim.faults.disturbances import corrupted, not_a_number
from tp_sim.faults.main import main
from tp_sim.faults.pauses import PauseWatch
from tp_sim.faults.rig import Judged
from tp_sim.faults.table import CASES

FAST = """
import rclpy
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node('fast')
out = node.create_publisher(JointState, 'joint_velocity_command', 10)
def answer(msg):
    out.publish(JointState(header=msg.header, name=msg.name, velocity=[2.0, 0.0, float('nan')]))
node.create_subscription(JointState, 'joint_states', answer, 10)
node.create_subscription(PointStamped, 'goal', lambda _: None, 10)
try:
    rclpy.spin(node)
finally:
    1 / 0
"""


@pytest.fixture(scope='module')
def watch():
    made = PauseWatch()
    yield made
    made.close()


def nan(rig):
    rig.disturb(corrupted(not_a_number, 0.5), 0.5)
    rig.recover()


def test_a_case_passes_and_tells_what_was_seen(watch):
    row = run_case(Case('nan', 'half of them NaN', nan), Judged(), watch)
    assert row.found.wrong == []
    assert row.found.speed == pytest.approx(1.0, abs=1e-6)
    assert 0.0 < row.found.age < 0.1
    assert row.way < 15.0


def test_another_controller_that_breaks_the_rules_fails(watch, tmp_path):
    script = tmp_path / 'fast.py'
    script.write_text(FAST)
    own = Judged()
    judged = Judged(f'{sys.executable} {script}', 'fast', replace(own.topics, goals='goal'))
    case = Case('fast', 'nothing', lambda rig: rig.move(0.3), recovery=1e9)
    told = ' '.join(run_case(case, judged, watch).found.wrong)
    assert 'nan' in told
    assert "controller printed 'Traceback'" in told
    assert 'controller ended with status 1' in told


def test_the_command_lists_its_cases(monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['faults', '--list'])
    assert main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [case.name for case in CASES]
    assert len({case.name for case in CASES}) == len(CASES)
