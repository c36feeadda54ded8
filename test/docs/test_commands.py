"""Every command that a page shows exists: executables, options, files, parameters, messages."""

import pytest
from shown_commands import Known, commands

from tp_controller.errors import InvalidValue


@pytest.fixture(scope='module')
def known(repository):
    return Known(repository)


def test_every_command_of_the_pages_exists(repository, known):
    paths = [repository / 'README.md', repository / 'CONTRIBUTING.md']
    paths += sorted((repository / 'docs').glob('*.md'))
    paths.append(repository / 'examples' / 'own_task' / 'README.md')
    count, wrong = 0, []
    for path in paths:
        for command in commands(path.read_text(encoding='utf-8')):
            count += 1
            try:
                known.check(command)
            except Exception as error:
                wrong.append(f'{path.name}: {command}\n    {type(error).__name__}: {error}')
    assert not wrong, '\n'.join(wrong)
    assert count > 80


@pytest.mark.parametrize(
    ('command', 'error', 'said'),
    [
        ('make nothing', AssertionError, 'make: nothing'),
        ('make demo COLOUR=red', AssertionError, 'make: COLOUR'),
        ('ros2 run tp_sim nothing', AssertionError, 'no executable nothing'),
        (
            'ros2 run tp_sim stress --confg config/b3_pressed.yaml',
            AssertionError,
            'no option --confg',
        ),
        ('ros2 run tp_sim stress --config config/b4_pressed.yaml', AssertionError, 'b4_pressed'),
        ('ros2 launch tp_sim simulation.launch.py confg:=my.yaml', AssertionError, 'confg'),
        ('ros2 param set /tp_controller tasks.tip.gian "[1.0]"', LookupError, 'gian'),
        (
            'ros2 param set /tp_controller rate 100.0',
            AssertionError,
            'does not change while running',
        ),
        ('ros2 param set /tp_controller hierarchy "3"', InvalidValue, 'hierarchy'),
        ('ros2 service call /tp_sim/reset tp_interfaces/srv/Rest', AttributeError, 'Rest'),
        (
            'ros2 service call /tp_controller/hold std_srvs/srv/SetBool "{dat: true}"',
            AssertionError,
            'has no dat',
        ),
        (
            "ros2 topic pub /goal geometry_msgs/msg/PointStamped '{point: {w: 1.0}}'",
            AssertionError,
            'has no w',
        ),
        ('python benchmarks/nothing.py', AssertionError, 'nothing.py'),
        ('python benchmarks/reach.py --counts 3', AssertionError, 'no option --counts'),
        ('gazebo world', AssertionError, 'unknown program gazebo'),
    ],
)
def test_one_that_does_not_is_found(known, command, error, said):
    with pytest.raises(error, match=said):
        known.check(command)
