"""Benchmarks of the nodes, each printed as a table: `make bench`."""

import argparse

import command_age
import memory


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=60.0, help='of joint states at 1 kHz')
    parser.add_argument('--cycles', type=int, default=100_000, help='of the memory benchmark')
    arguments = parser.parse_args()
    command_age.run(arguments.seconds)
    memory.run(arguments.cycles)


if __name__ == '__main__':
    main()
