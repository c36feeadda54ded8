"""A planner's process that stops, ends or falls silent."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file
from tp_controller.planning import remote
from tp_controller.planning.messages import Failed, Request, asked_parameters, asked_targets
from tp_controller.ros.around import Around, End

CONFIG = Path(__file__).resolve().parents[2] / 'config'
GOAL = {'ee_position': np.array([0.3, 1.2])}
START = np.array([0.0, 0.6, 0.3])


class Lines:
    """A log whose lines nobody needs."""

    def info(self, text):
        """Take a line."""


@pytest.fixture
def settings():
    path = CONFIG / 'a4_position_joint.yaml'
    return build_settings(read_parameter_file(path, 'tp_controller') | {'rate': 60.0})


@pytest.fixture
def around(settings):
    found = Around(settings, None, np.zeros(3), Lines(), lambda: None)
    settings.stack.step(START)
    yield found
    found.close()


def begin(around):
    """Begin to look for a way that is not straight; what its end is comes into a list."""
    ends = []
    around.begin(GOAL, {'ee_position': 1e-3}, False, lambda end, why: ends.append((end, why)))
    return ends


def look_until(around, condition):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        around.look()
        time.sleep(0.01)


def child():
    """Process that the planner is."""
    tasks = Path('/proc/self/task').glob('*/children')
    children = [int(one) for task in tasks for one in task.read_text().split()]
    (found,) = [
        one for one in children if remote.MODULE in Path(f'/proc/{one}/cmdline').read_text()
    ]
    return found


def test_a_planner_that_is_stopped_ends_the_goal_and_the_next_one_is_planned(around, monkeypatch):
    begin(around)
    look_until(around, lambda: around.phase == 'following')
    around.end()
    os.kill(child(), signal.SIGSTOP)
    monkeypatch.setattr(remote, 'SILENCE', 0.2)
    ends = begin(around)
    look_until(around, lambda: ends)
    assert ends[0][0] is End.NONE
    assert 'the planner has not answered for' in ends[0][1]
    monkeypatch.undo()
    begin(around)
    look_until(around, lambda: around.phase == 'following')


def test_a_planner_that_ends_while_a_way_is_followed_is_no_matter(around):
    ends = begin(around)
    look_until(around, lambda: around.phase == 'following')
    os.kill(child(), signal.SIGKILL)
    for _ in range(20):
        around.look()
        time.sleep(0.01)
    assert around.phase == 'following'
    assert not ends


def test_a_process_that_has_ended_fails_only_its_own_requests(settings):
    planner = remote.RemotePlanner()
    parts = asked_parameters(settings), None, asked_targets(settings.stack), GOAL, {}, START
    try:
        for number in range(1, 4):
            planner.ask(Request(number, *parts, True))
            replies = []
            end = time.monotonic() + 20.0
            while not any(one == number and not hasattr(reply, 'value') for one, reply in replies):
                assert time.monotonic() < end
                replies += planner.take()
                time.sleep(0.01)
            assert not any(one == number and isinstance(reply, Failed) for one, reply in replies)
            planner.kill()
    finally:
        planner.close()
