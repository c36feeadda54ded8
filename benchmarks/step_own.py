"""The own side of the step benchmark: position, orientation and posture as three levels."""

from step_blocks import load_scenario, serve

from tp_controller.config import build_settings

RATE = 1000.0
"""Steps per second [Hz], as the other side has: ranges are kept for it."""


def main() -> None:
    scenario = load_scenario()
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
    serve({'own': build_settings(parameters).stack.step}, scenario['path'])


if __name__ == '__main__':
    main()
