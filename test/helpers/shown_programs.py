"""Commands of pages as processes: what they need, and what is not run and why."""

import re
import shlex
import signal
import sys
import time
from pathlib import Path
from typing import NamedTuple

import yaml
from launch_stand_in import ros_arguments, started

from tp_sim.harness import Process, executable_path

PLANAR = 'config/a4_position_joint.yaml'
PATIENCE = 60.0
"""Time [s] for what takes a moment on an idle machine."""
UP = {
    'simulator': ' joints at ',
    'controller': 'waiting for joint states',
    'watch': '/tp_controller',
    'view': 'http://',
    'live': 'http://',
    'record': 'Ctrl-C ends it',
}
"""What programs print that run until Ctrl-C, once they are up."""
LIVE = ('send_goal', 'record', 'watch', 'view')
"""Programs that need a running controller."""


class LeftOut(NamedTuple):
    """Commands that are not run here."""

    pattern: str
    reason: str


LEFT_OUT = (
    LeftOut('make ', 'installs, or does for minutes what other tests do by parts'),
    LeftOut(r'source setup\.bash', 'this test runs in it'),
    LeftOut('pip install', 'installs'),
    LeftOut('dask |xacro |check_urdf |ros2 control ', 'programs of others'),
    LeftOut('ros2 run (robot_state_publisher|controller_manager) ', 'packages of others'),
    LeftOut(
        'ros2 run tp_controller measure_arm',
        'asks in the terminal before it moves the arm: test/node/test_measure_arm.py',
    ),
    LeftOut('python examples/gallery/', 'writes pictures of docs: test/docs/test_gallery.py'),
    LeftOut('python course/run.py', 'a minute: test/course'),
    LeftOut('.*/faults --(only|record|page|controller)', 'minutes: test/node/test_faults.py'),
    LeftOut('python tools/view_pictures.py', 'needs a browser: test/node/test_view_page.py'),
    LeftOut('ros2 run tp_sim demo', 'half a minute: test/node/test_demo.py'),
)
LONG = (
    LeftOut('python benchmarks/', 'seconds to hours'),
    LeftOut('python examples/singularity.py', 'some seconds'),
    LeftOut('ros2 run tp_sim (stress|compare)', 'seconds to hours'),
    LeftOut('ros2 run tp_controller batch --config', 'some seconds to hours'),
)
"""Run by tools/docs_commands.py, in their short forms."""
SHORT = (
    (r'--(steps|runs|count|goals|draws) \d+', {'steps': 500, 'draws': 20}),
    (r'(stress (?!.*--steps).*)', '--steps 500'),
    (r'(benchmarks/(around|no_way|around_real_time)\.py(?!.*--count).*)', '--count 1'),
    # Goals for table_pose are drawn until one needs a planned way.
    (r'(benchmarks/first_motion\.py).*', '--files ur5_pose --count 1'),
    # The other libraries are those of `make bench`.
    (r'(benchmarks/reach\.py(?!.*--arms).*)', '--arms ur5'),
    (r'(benchmarks/reach\.py.*)', '--sides own --count 3'),
    # An arm that comes to rest later than the benchmark wants ends it with status 1.
    (r'(benchmarks/unreachable\.py.*)', '--arms planar panda'),
    (r'(benchmarks/priority_leak\.py(?!.*--draws).*)', '--draws 20'),
    (r'(benchmarks/transitions\.py.*)', '--minutes 0.1'),
    (r'(benchmarks/soak\.py.*)', '--minutes 0.5'),
    (r'(benchmarks/(record_cost|view_cost)\.py.*)', '--rounds 1 --seconds 3'),
    (r'(benchmarks/task_changes\.py.*)', '--seconds 5'),
    (r'(benchmarks/schemes\.py.*)', '--blocks 1 --steps 100'),
    (r'(benchmarks/hqp_time\.py.*)', '--rounds 1'),
)
"""Options that make a command short: numbers of some, or further ones."""
NAMES = r'ros2 run \w+ (controller|simulator|send_goal|solve)|python -m tp_controller\.\w+'
"""Commands that are named, not called: their help is asked for."""
FILES = {
    'own_stack.md': 'my_stack.yaml',
    'real_arms.md': 'my_stack.yaml',
    'real_robot.md': 'my_arm.yaml',
}
"""Parameter files of pages; the others have that of the planar arm."""


def left_out(command, rows=LEFT_OUT + LONG):
    """Row of the table for a command, None if it is to be run."""
    command = re.sub(r'^([A-Z_]+=\S+ |chrt -f \d+ )+', '', command)
    return next((row for row in rows if re.match(row.pattern, command)), None)


def short(command):
    """A command in its short form."""
    (pattern, numbers), *rows = SHORT
    command = re.sub(pattern, lambda m: f'--{m[1]} {numbers.get(m[1], 2)}', command)
    for pattern, options in rows:
        command = re.sub(pattern + '$', rf'\1 {options}', command)
    return command


def workplace(root, folder):
    """Fill a folder in which commands of all pages find their files."""
    for path in root.iterdir():
        if path.name != 'out' and not path.name.startswith('.'):
            (folder / path.name).symlink_to(path)
    own, real = (
        yaml.safe_load(re.findall(r'```yaml\n(.*?)```', text, flags=re.DOTALL)[0])
        for text in (
            (root / 'docs' / name).read_text(encoding='utf-8')
            for name in ('own_stack.md', 'real_robot.md')
        )
    )
    (folder / 'my_stack.yaml').write_text(yaml.safe_dump(own))
    # As the page says: a URDF, and where the simulator begins.
    robots = [blocks['/**']['ros__parameters']['robot'] for blocks in (own, real)]
    robots[1]['urdf'] = robots[0]['urdf']
    real['/**/tp_sim'] = own['/**/tp_sim']
    (folder / 'my_arm.yaml').write_text(yaml.safe_dump(real))
    return folder


def program(command):
    """Name of the program of a command and its words, with the path of the executable."""
    command = re.sub(r'\bFILE\b', PLANAR, command)
    if re.fullmatch(NAMES, command):
        command += ' --help'
    words = shlex.split(command, comments=True)
    if words[:2] == ['ros2', 'run']:
        return words[3], [str(executable_path(*words[2:4])), *words[4:]]
    if words[0] == 'python':
        return words[1], [sys.executable, *words[1:]]
    return Path(words[0]).name, words


def run(command, environment, folder):
    """Run a command to its end, or to a Ctrl-C once it is up; raise AssertionError if it fails."""
    status, output = ended(command, environment, folder)
    assert status == 0, f'status {status}:\n{output}'
    return output


def ended(command, environment, folder, seconds=PATIENCE):
    """Status and output of a command that is run as by `run`, with a time [s] to its end."""
    name, words = program(command)
    process = Process(name, words, environment, folder)
    try:
        if name in UP and '--help' not in words:
            process.wait_for_output(UP[name], seconds)
            if name == 'record':
                _wait_for_file(folder / words[1], process)
            process.signal(signal.SIGINT)
        status = process.wait(seconds)
    finally:
        if process.running:
            process.kill()
    assert 'Traceback' not in process.output, process.output
    return status, process.output


def _wait_for_file(path, process):
    """Wait until a recording has messages of all kinds, some seconds of them."""
    end = time.monotonic() + PATIENCE
    while not path.exists() or path.stat().st_size < 30_000:
        assert process.running, process.output
        assert time.monotonic() < end, process.output
        time.sleep(0.1)


def launch(command, environment):
    """Processes that a launch command would start, by name."""
    _, _, package, name, *given = shlex.split(command, comments=True)
    arguments = dict(word.split(':=') for word in given)
    found = started(package, name, **arguments)
    return {
        name: Process(
            name,
            [str(executable_path(node.package, name)), '--ros-args', *ros_arguments(node)],
            environment,
        )
        for name, node in found.items()
        if node.made == 'Node'
    }
