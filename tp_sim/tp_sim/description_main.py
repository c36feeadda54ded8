"""Executable that prints the description which the simulator publishes; no ROS is needed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tp_controller.command_line import OneLineParser
from tp_controller.config import build_robot, describe_robot, read_parameter_file, shared_schema
from tp_controller.config.schema import DESCRIPTION
from tp_controller.errors import InvalidValue
from tp_controller.parameters import read_all

REFUSED = 2


def main() -> int:
    """Write the URDF of a parameter file's robot to the standard output.

    Returns
    -------
    int
        Exit status: 0 written, 2 refused.
    """
    path = _parser().parse_args().config
    try:
        print(_description(path), end='')
    except InvalidValue as error:
        print(f'description: {error}', file=sys.stderr)
        return REFUSED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='description',
        description='Write the URDF of the robot that a parameter file gives to the simulator, '
        'for robot_state_publisher and RViz.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='example:\n'
        '  ros2 run tp_sim description --config config/a1_position.yaml > arm.urdf',
    )
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    return parser


def _description(path: Path) -> str:
    given = {
        key: value
        for key, value in read_parameter_file(path, 'tp_sim').items()
        if key == DESCRIPTION or key.startswith('robot.')
    }
    values = read_all(given, shared_schema(given))
    # Nothing is printed that the nodes would refuse.
    build_robot(values)
    return describe_robot(values)
