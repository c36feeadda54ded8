"""Benchmarks, each printed as a table: `make bench`."""

import argparse

import command_age
import memory
import step_time


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', choices=('command_age', 'memory', 'step_time'), help='run one')
    parser.add_argument('--seconds', type=float, default=60.0, help='of joint states at 1 kHz')
    parser.add_argument('--cycles', type=int, default=100_000, help='of the memory benchmark')
    parser.add_argument('--blocks', type=int, default=40, help='of steps beside Pink')
    parser.add_argument('--steps', type=int, default=250, help='in a block')
    arguments = parser.parse_args()
    if arguments.only in (None, 'step_time'):
        step_time.run(arguments.blocks, arguments.steps)
    if arguments.only in (None, 'command_age'):
        command_age.run(arguments.seconds)
    if arguments.only in (None, 'memory'):
        memory.run(arguments.cycles)


if __name__ == '__main__':
    main()
