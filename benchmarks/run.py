"""Benchmarks, each printed as a table: `make bench`."""

import argparse

import command_age
import memory
import start
from field import run as field

PARTS = ('command_age', 'memory', 'start', 'field')


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', choices=PARTS, help='run one')
    parser.add_argument('--seconds', type=float, default=60.0, help='of joint states at 1 kHz')
    parser.add_argument('--cycles', type=int, default=100_000, help='of the memory benchmark')
    parser.add_argument('--starts', type=int, default=10, help='of the controller')
    parser.add_argument('--blocks', type=int, default=20, help='of steps of every library')
    parser.add_argument('--steps', type=int, default=200, help='in a block')
    parser.add_argument('--draws', type=int, default=300, help='of the priority leak')
    arguments = parser.parse_args()
    if arguments.only in (None, 'field'):
        field.run(arguments.blocks, arguments.steps, arguments.draws)
    if arguments.only in (None, 'command_age'):
        command_age.run(arguments.seconds)
    if arguments.only in (None, 'memory'):
        memory.run(arguments.cycles)
    if arguments.only in (None, 'start'):
        start.run(arguments.starts)


if __name__ == '__main__':
    main()
