"""The own side of the step benchmark: position, orientation and posture as three levels."""

from typing import Any

from step_blocks import load_scenario, serve

from tp_controller.config import build_settings
from tp_controller.stack import Stack

RATE = 1000.0
"""Steps per second [Hz], as the other side has: ranges are kept for it."""


def stack_of(scenario: dict[str, Any]) -> Stack:
    """The three levels, with the goal and posture of a scenario."""
    goal, frame, gain = scenario['goal'].tolist(), scenario['frame'], [scenario['gain']]
    posture = {'type': 'posture', 'target': scenario['posture'].tolist(), 'gain': gain}
    parameters = {
        'rate': RATE,
        'robot': {'urdf': scenario['urdf'], 'joints': scenario['joints']},
        'hierarchy': ['position', 'orientation', 'posture'],
        'tasks': {
            'position': {'type': 'position', 'frame': frame, 'target': goal[:3], 'gain': gain},
            'orientation': {
                'type': 'orientation',
                'frame': frame,
                'target': goal[3:],
                'gain': gain,
            },
            'posture': posture,
        },
    }
    return build_settings(parameters).stack


def main() -> None:
    scenario = load_scenario()
    serve({'own': stack_of(scenario).step}, scenario['path'])


if __name__ == '__main__':
    main()
