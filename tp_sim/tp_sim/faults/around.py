"""Cases about what is around the control loop: processes, clocks and the machine."""

from __future__ import annotations

import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from tp_sim.faults import arm
from tp_sim.faults.case import Case
from tp_sim.faults.other_nodes import (
    fuzz,
    fuzz_states,
    goals,
    in_namespace,
    namespaces,
    two_controllers,
    two_simulators,
)
from tp_sim.faults.rig import Rig

START = 6.0
"""Longest time [s] from the start of a process to the first motion."""
STOPS = 20
LOOP = 'while True: pass'
ELSEWHERE = 'elsewhere'


def controller_killed(rig: Rig) -> None:
    """Kill the controller at full speed and start another one."""
    _kill_controller(rig)
    rig.controller = rig.start_controller()
    rig.recover()


def controller_elsewhere(rig: Rig) -> None:
    """The same, but the other one runs in another folder and namespace."""
    _kill_controller(rig)
    folder = rig.folder / ELSEWHERE
    folder.mkdir()
    topics = rig.judged.topics
    rig.controller = rig.start_controller(
        *in_namespace(ELSEWHERE, topics.states, topics.commands), folder=folder
    )
    rig.move_goal_topic(f'/{ELSEWHERE}/{topics.goals.lstrip("/")}')
    rig.recover()


def _kill_controller(rig: Rig) -> None:
    rig.to_full_speed()
    since = time.time()
    rig.controller.kill()
    rig.client.spin_for(1.0)
    rig.expect_rest(since)


def controller_ended(rig: Rig) -> None:
    """End the controller at full speed by a signal and start another one."""
    for number in (signal.SIGTERM, signal.SIGINT):
        rig.to_full_speed()
        rig.controller.signal(number)
        if (status := rig.controller.wait()) != 0:
            rig.wrong.append(f'controller ended with status {status}')
        rig.client.spin_for(0.3)
        rig.expect_zero_last()
        rig.controller = rig.start_controller()
        rig.wait_for(lambda: rig.relay.listeners > 0, 'the controller')
    rig.recover()


def simulator_killed(rig: Rig) -> None:
    """Kill the simulator at full speed and start one whose arm is elsewhere."""
    rig.to_full_speed()
    rig.simulator.kill()
    rig.client.spin_for(1.0)
    count = len(rig.relay.motions)
    rig.simulator = rig.start_simulator(arm.ELSEWHERE)
    rig.wait_for(lambda: len(rig.relay.motions) > count, 'joint states of the simulator')
    rig.recover()


def sim_time(rig: Rig) -> None:
    """Start the controller with ``use_sim_time`` and no clock."""
    rig.simulator = rig.start_simulator()
    rig.controller = rig.start_controller('-p', 'use_sim_time:=true')
    rig.wait_until_connected()
    rig.move(3.0)
    rig.recover()


def sim_time_both(rig: Rig) -> None:
    """Start both nodes with ``use_sim_time`` and no clock: stamps are zero."""
    rig.stamped = False
    rig.simulator = rig.start_simulator(arm.START, '-p', 'use_sim_time:=true')
    rig.controller = rig.start_controller('-p', 'use_sim_time:=true')
    rig.wait_until_connected()
    rig.move(3.0)
    rig.recover()


def stopped(rig: Rig) -> None:
    """SIGSTOP for 1 s at full speed, then SIGCONT, 20 times."""
    for _ in range(STOPS):
        rig.next_goal()
        rig.client.spin_for(0.6)
        rig.controller.signal(signal.SIGSTOP)
        rig.client.spin_for(1.0)
        rig.controller.signal(signal.SIGCONT)
        rig.client.spin_for(0.2)
    rig.recover()


def busy(rig: Rig) -> None:
    """Let four busy loops run beside the nodes."""
    loops = [rig.start_beside('loop', sys.executable, '-c', LOOP) for _ in range(4)]
    rig.move(8.0)
    for loop in loops:
        loop.kill()
    rig.recover()


def disk_full(rig: Rig) -> None:
    """Start the controller with its log on a full disk."""
    rig.simulator = rig.start_simulator()
    disk = rig.folder / 'disk'
    disk.mkdir()
    rig.environment['ROS_LOG_DIR'] = str(disk)
    wrapped, what = _on_full_disk(disk)
    rig.notes.append(what)
    rig.controller = rig.start_controller(folder=disk, wrapped=wrapped)
    rig.wait_until_connected()
    rig.move(4.0)
    if not rig.judged.command:
        _expect_no_save(rig, disk)
    rig.recover()


def _on_full_disk(disk: Path) -> tuple[list[str], str]:
    """Command that runs another one with a full disk in a folder, and how it does that."""
    script = (
        'mount -t tmpfs -o size=16k tmpfs "$0" && '
        '{ dd if=/dev/zero of="$0/filler" bs=1k 2>/dev/null; cd "$0"; exec "$@"; }'
    )
    unshare = ['unshare', '--user', '--map-root-user', '--mount', 'sh', '-c']
    if shutil.which('unshare'):
        tried = subprocess.run([*unshare, script, str(disk), 'true'], check=False)
        if tried.returncode == 0:
            return [*unshare, script, str(disk)], 'a full tmpfs of 16 kB'
    limit = (
        'import os, resource, signal, sys; '
        f'resource.setrlimit(resource.RLIMIT_FSIZE, (1024, {resource.RLIM_INFINITY})); '
        'os.execvp(sys.argv[1], sys.argv[1:])'
    )
    return [sys.executable, '-c', limit], 'files limited to 1 kB by RLIMIT_FSIZE'


def _expect_no_save(rig: Rig, disk: Path) -> None:
    """The stack cannot be saved there; the answer has to say so."""
    from tp_interfaces.srv import Save

    rig.next_goal()
    request = Save.Request(path=str(disk / 'saved.yaml'))
    answer = rig.client.call(Save, f'{rig.judged.node}/save', request)
    if answer.success or not answer.message:
        rig.wrong.append('~/save says that it wrote to a full disk')
    else:
        rig.notes.append(f'~/save: {answer.message}')


CASES: tuple[Case, ...] = (
    Case(
        'sim_time',
        'use_sim_time for the controller, no clock',
        sim_time,
        'all as without it',
        started=False,
    ),
    Case(
        'sim_time_both',
        'use_sim_time for both nodes, no clock',
        sim_time_both,
        'all as without it',
        started=False,
    ),
    Case('goals_4000', '4,000 goals a second', goals),
    Case(
        'fuzz',
        '10,000 malformed messages, bytes, parameters and service calls',
        fuzz,
        'refusals; every call is answered',
    ),
    Case(
        'fuzz_states',
        '2,000 malformed joint states and bytes between the right ones',
        fuzz_states,
        'they are ignored',
    ),
    Case(
        'sigstop',
        'SIGSTOP for 1 s, then SIGCONT, 20 times at full speed',
        stopped,
        'motion by states of the last moment; the arm starts from rest',
    ),
    Case('busy', 'four busy loops', busy),
    Case(
        'disk_full',
        'a full disk for logs and ~/save',
        disk_full,
        'lines of the log are lost; ~/save says why not',
        started=False,
    ),
    Case(
        'controller_killed',
        'SIGKILL at full speed, started again',
        controller_killed,
        'the arm stops by the time-out of its driver',
        START,
    ),
    Case(
        'controller_elsewhere',
        'the same, started in another folder and namespace',
        controller_elsewhere,
        'the arm stops by the time-out of its driver',
        START,
    ),
    Case(
        'controller_ended',
        'SIGTERM and SIGINT at full speed, started again',
        controller_ended,
        'the last command is zero, status 0',
        START,
    ),
    Case(
        'simulator_killed',
        'SIGKILL of the simulator, another one with the arm elsewhere',
        simulator_killed,
        'one more state until the arm is believed to be there',
    ),
    Case(
        'two_controllers',
        'a second controller on the same topics for 4 s',
        two_controllers,
        'each keeps the limits of speed; changes and braking are not judged in this case',
    ),
    Case(
        'two_simulators',
        'a second simulator with its arm elsewhere for 4 s',
        two_simulators,
        'rest while the arm seems to jump',
        2.0,
    ),
    Case(
        'namespaces',
        'three robots in namespaces, one controller killed and started again',
        namespaces,
        'the others do not notice',
        START,
        started=False,
    ),
)
