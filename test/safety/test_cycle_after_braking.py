"""When a joint state is answered that comes right after a command of braking."""

import math
import time
from array import array
from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.ros.cycle import Cycle
from tp_controller.ros.joint_states import JointStateValues
from tp_controller.ros.state_watch import StateWatch
from tp_controller.ros.warnings import Warnings
from tp_interfaces.msg import ControllerState

PERIOD, LIMIT, ACCELERATION = 0.01, 0.1, 4.0


class Commands:
    """Keeps what is sent, and when."""

    withheld = waiting = moving = False
    heard = True
    rest = 'zero command'

    def __init__(self, now):
        self._now = now
        self.velocity = np.zeros(2)
        self.sent = []

    def prepare(self, command, stamp=None):
        self.velocity[:] = command

    def send_prepared(self):
        self.sent.append((self._now(), self.velocity.copy()))

    def send(self, command, stamp=None):
        self.prepare(command)
        self.send_prepared()


class Loop:
    """An arm that carries commands out at once, its cycle, and the time."""

    def __init__(self, monkeypatch):
        self.now = 100.0
        monkeypatch.setattr(time, 'monotonic', lambda: self.now)
        limits = {'velocity': [2.0], 'acceleration': [ACCELERATION]}
        aim = {'type': 'joint', 'joints': ['joint_1', 'joint_2'], 'target': [50.0, 0.0]}
        stack = build_settings(
            {
                'robot': planar_block(1.0, 1.0) | {'limits': limits},
                'rate': 1.0 / PERIOD,
                'hierarchy': ['joints'],
                'tasks': {'joints': aim},
            }
        ).stack
        self.watch = StateWatch(LIMIT, PERIOD)
        self.waiting = []
        self.commands = Commands(lambda: self.now)
        self.q = np.zeros(2)
        self.cycle = Cycle(
            stack,
            SimpleNamespace(take=self._take),
            self.watch,
            self.commands,
            ControllerState(),
            Warnings(lambda _: None, lambda _: None, lambda: self.now),
            SimpleNamespace(info=lambda _: None),
            1.0 / PERIOD,
            LIMIT,
            AnsweredTime(),
            lambda _: None,
        )
        self.cycle.begin()

    def _take(self):
        taken, self.waiting = self.waiting, []
        return taken

    def tell(self):
        """Let a joint state come, of the present time."""
        sec, nanosec = divmod(round(1e9 * self.now), 1_000_000_000)
        state = JointStateValues(
            Time(sec=sec, nanosec=nanosec),
            ['joint_1', 'joint_2'],
            array('d', self.q),
            array('d', self.commands.velocity),
        )
        info = {'source_timestamp': round(1e9 * self.now)}
        self.waiting.append(self.watch.arrive(state, info, self.now, 0.0))

    def pass_time(self, seconds):
        self.now += seconds
        self.q += seconds * self.commands.velocity


@pytest.mark.parametrize('after', [0.1, 0.5, 0.95])
def test_a_state_right_after_a_command_of_braking_waits_for_most_of_a_period(monkeypatch, after):
    loop = Loop(monkeypatch)
    for _ in range(400):
        loop.pass_time(PERIOD)
        loop.tell()
        assert loop.cycle.work()
        assert not loop.cycle.look()
    assert loop.watch.paced
    while not loop.cycle.look():
        loop.pass_time(PERIOD)
    loop.cycle.braking.send_next()
    braked = loop.now
    loop.pass_time(after * PERIOD)
    loop.tell()
    while not loop.cycle.work():
        assert loop.now < braked + PERIOD
        loop.pass_time(0.05 * PERIOD)
    (before, slow), (now, fast) = loop.commands.sent[-2:]
    assert before == braked
    assert now - before >= 0.8 * PERIOD - 1e-9
    assert now - before == pytest.approx(max(after, 0.8) * PERIOD, abs=0.06 * PERIOD)
    assert math.isclose(abs(fast[0] - slow[0]), ACCELERATION * PERIOD, rel_tol=1e-9)
