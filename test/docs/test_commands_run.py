"""Commands that pages show are run: programs, and what ``ros2`` asks running nodes for.

Pages with the same parameter file share two nodes in real time. Most of the time passes in waiting
for arms, so groups of pages go side by side. `LEFT_OUT` and `LONG` of
test/helpers/shown_programs.py have what is not run here, and why.
"""

import os
import re
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from threading import Lock
from types import SimpleNamespace

import launch_stand_in
import pytest
from geometry_msgs.msg import PointStamped
from made_recording import make_recording
from rclpy.qos import ReliabilityPolicy
from shown_calls import Ros2, filled, quality
from shown_commands import commands
from shown_programs import (
    FILES,
    LEFT_OUT,
    LIVE,
    LONG,
    PLANAR,
    UP,
    launch,
    left_out,
    program,
    run,
    workplace,
)

from tp_controller.ros.robot_node import TOPIC_QOS
from tp_interfaces.action import Reach
from tp_interfaces.srv import Reset
from tp_sim.harness import Client, NodeProcess, PrivateDomain

pytestmark = pytest.mark.timeout(600)

GROUPS = (
    # What changes.md does is not undone: it is the last one.
    (
        'README',
        'start',
        'interface',
        'asking',
        'safety',
        'real_time',
        'troubleshooting',
        'changes',
    ),
    ('goals', 'around', 'recordings', 'view', 'robots'),
    ('own_stack', 'real_arms'),
    ('real_robot',),
)
OUTCOMES = {'values: [3.0, 0.0]': Reach.Result.TIMED_OUT}
"""Outcomes of goals that are not reached, as their page says."""
SEEN = set()
"""Programs that run until Ctrl-C: they do the same on every page."""
PLANT = {'plant.noise': 0.0, 'plant.blocked': False, 'plant.silent': False}
"""What the simulator has at the start."""


def page(repository, name):
    path = repository / 'README.md' if name == 'README' else repository / 'docs' / f'{name}.md'
    return path.read_text(encoding='utf-8')


def all_pages(repository):
    yield 'README', page(repository, 'README')
    for path in sorted((repository / 'docs').glob('*.md')):
        yield path.stem, path.read_text(encoding='utf-8')


def is_live(command):
    """Whether a command asks running nodes, or starts some."""
    words = command.split()
    if words[0] != 'ros2' or left_out(command):
        return False
    return words[1] != 'run' or words[3] in (*LIVE, 'simulator', 'controller', 'live')


@pytest.fixture(scope='module')
def folder(repository, tmp_path_factory):
    return workplace(repository, tmp_path_factory.mktemp('pages'))


class Group:
    """Pages with one parameter file, and the nodes that they share."""

    def __init__(self, repository, folder, names, stack):
        self.pages = [(name, page(repository, name)) for name in names]
        self.folder = folder
        self.file = FILES.get(f'{names[0]}.md', PLANAR)
        self.domain, self.side = PrivateDomain(), PrivateDomain()
        self.client = Client(self.domain)
        self.nodes = []
        stack.callback(self.close)
        self.ros2 = Ros2(self.client)
        self.is_robot = names == ('real_robot',)
        remap = ['-r', 'joint_velocity_command:=/velocity_controller/commands'] * self.is_robot
        self._start('simulator', *remap)
        if not self.is_robot:
            self._start('controller')
            self.hierarchy = self._levels()

    def close(self):
        statuses = [node.stop() for node in self.nodes]
        self.client.close()
        self.domain.close()
        self.side.close()
        assert not any(statuses), [node.output for node in self.nodes]
        assert not any('Traceback' in node.output for node in self.nodes)

    def _start(self, executable, *ros_arguments):
        package = 'tp_sim' if executable == 'simulator' else 'tp_controller'
        environment = self.domain.environment()
        self.nodes.append(
            NodeProcess(
                package, executable, self.folder / self.file, environment, list(ros_arguments)
            )
        )

    def _levels(self):
        tasks = [task for task in self.ros2.state().tasks if task.level >= 0]
        depth = max(task.level for task in tasks)
        return [
            ' + '.join(task.name for task in tasks if task.level == level)
            for level in range(depth + 1)
        ]

    def run(self):
        """Run all commands; return those that failed, with how many there were."""
        count, failed = 0, []
        for name, text in self.pages:
            self._restore()
            for command in commands(text):
                shown = command.replace('FILE', PLANAR).partition('#')[0].strip()
                if not is_live(command) or shown in SEEN:
                    continue
                if command.split()[1] == 'launch' or program(command)[0] in UP:
                    SEEN.add(shown)
                count += 1
                try:
                    self._run(command)
                except Exception as error:
                    failed.append(f'{name}: {command}\n    {type(error).__name__}: {error}')
        return count, failed

    def _restore(self):
        """Undo what the pages before have done."""
        if self.is_robot:
            return
        self.ros2.bring_to('active')
        self.ros2("ros2 service call /tp_controller/hold std_srvs/srv/SetBool '{data: false}'")
        self.client.set_parameters('tp_sim', PLANT)
        self.client.set_parameters('tp_controller', {'hierarchy': self.hierarchy})
        for task in {name for level in self.hierarchy for name in level.split(' + ')}:
            self.client.set_parameters('tp_controller', {f'tasks.{task}.enabled': True})
        self.client.call(Reset, 'tp_sim/reset', Reset.Request())

    def _run(self, command):
        words = command.split()
        if words[1] == 'launch':
            self._launch(command)
        elif words[1] == 'run':
            alone = program(command)[0] in ('simulator', 'controller', 'live')
            domain = self.side if alone else self.domain
            run(command, domain.environment(), self.folder)
        else:
            outcome = next(
                (found for text, found in OUTCOMES.items() if text in command),
                Reach.Result.REACHED,
            )
            here = command.replace('/home/me/', f'{self.folder}/')
            self.ros2(here, outcome)

    def _launch(self, command):
        # The nodes that the other commands of the page speak with.
        stays = 'velocity_command:=' in command
        domain = self.domain if stays else self.side
        command = re.sub(r'config:=(\S+)', rf'config:={self.folder}/\1', command)
        command = command.replace(f'{self.folder}/FILE', f'{self.folder}/{PLANAR}')
        for name, process in launch(command, domain.environment()).items():
            if stays:
                self.nodes.append(process)
                self.ros2.state()
                return
            process.wait_for_output(' joints at ' if name == 'simulator' else 'waiting for', 60.0)
            assert process.stop() == 0, process.output


def test_what_pages_ask_of_running_nodes_is_done(repository, folder, monkeypatch):
    launch_stand_in.stand_in(monkeypatch)
    making = Lock()

    def run_group(names):
        with ExitStack() as stack:
            # A client enters its domain by variables of this process.
            with making:
                group = Group(repository, folder, names, stack)
            return group.run()

    # More robots in real time would disturb the tests beside this one.
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(run_group, GROUPS))
    failed = [line for _, lines in found for line in lines]
    assert not failed, '\n'.join(failed)
    assert sum(count for count, _ in found) > 60


def test_every_page_with_such_commands_is_in_a_group(repository):
    names = {name for group in GROUPS for name in group}
    for name, text in all_pages(repository):
        live = [command for command in commands(text) if is_live(command)]
        assert not live or name in names, f'{name}: {live}'


@pytest.fixture(scope='module')
def folder_with_recording(repository, tmp_path_factory):
    folder = workplace(repository, tmp_path_factory.mktemp('programs'))
    make_recording(folder / 'run.mcap', 'a4_position_joint', 2.0)
    return folder


def test_programs_that_need_no_nodes_do_what_they_are_said_to(repository, folder_with_recording):
    seen, failed = set(), []
    for name, text in all_pages(repository):
        for command in commands(text):
            if is_live(command) or command in seen or left_out(command):
                continue
            seen.add(command)
            try:
                assert run(command, dict(os.environ), folder_with_recording).strip()
            except Exception as error:
                failed.append(f'{name}: {command}\n    {error}')
    assert not failed, '\n'.join(failed)
    assert len(seen) > 8


@pytest.mark.parametrize('row', LEFT_OUT + LONG, ids=lambda row: row.pattern)
def test_everything_in_the_table_of_what_is_not_run_is_shown(repository, row):
    found = [c for _, text in all_pages(repository) for c in commands(text) if left_out(c) == row]
    assert found


def test_a_value_that_a_message_does_not_have_is_found():
    assert filled(PointStamped(), {'point': {'x': 1}}).point.x == 1.0
    with pytest.raises(AssertionError, match='Point has no w'):
        filled(PointStamped(), {'point': {'w': 1.0}})


def test_an_option_of_quality_takes_the_reliability_away():
    publishers = [SimpleNamespace(qos_profile=TOPIC_QOS)]
    assert quality([], publishers).reliability == ReliabilityPolicy.RELIABLE
    words = ['--qos-durability', 'transient_local']
    assert quality(words, publishers).reliability == ReliabilityPolicy.BEST_EFFORT
