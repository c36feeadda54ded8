"""A complete set of parameters, nested and with dotted keys, for tests that change some."""

from small_arms import planar_block


def nested_parameters():
    """Three-joint planar arm with a task of every type; one task is idle."""
    return {
        'robot': planar_block(0.75, 0.5, 0.5)
        | {'base_frame': 'base', 'limits': {'velocity': [1.0]}},
        'solver': {'type': 'recursive', 'damping': 0.1},
        'command': {'type': 'joint_state'},
        'timeouts': {'joint_state': 0.1, 'feedforward': 0.5},
        'hierarchy': ['tip + elbow', 'turn', 'place'],
        'tasks': {
            'tip': {
                'type': 'position',
                'frame': 'link_3',
                'axes': 'xy',
                'target': [1.0, 0.5],
                'gain': [2.0, 3.0],
                'feedforward': [0.1, 0.2],
            },
            'turn': {'type': 'orientation', 'frame': 'link_2', 'axes': 'z', 'target': [0.3]},
            'place': {
                'type': 'pose',
                'frame': 'link_3',
                'position_axes': 'xy',
                'orientation_axes': 'z',
                'target': [1.0, 0.5, 0.2],
            },
            'elbow': {'type': 'joint', 'joints': ['joint_2'], 'target': [0.4]},
            'spare': {'type': 'orientation', 'frame': 'link_3', 'target': [0.0, 0.0, 0.6, 0.8]},
        },
    }


def dotted_parameters():
    """Give the same parameters with dotted keys."""
    return dict(_dotted(nested_parameters()))


def changed(changes):
    """Give dotted parameters with some changed; None takes a key, or all up to a *, away."""
    values = dotted_parameters()
    for key, value in changes.items():
        if key.endswith('*'):
            values = {k: v for k, v in values.items() if not k.startswith(key[:-1])}
        elif value is None:
            del values[key]
        else:
            values[key] = value
    return values


def _dotted(nested, prefix=''):
    for key, value in nested.items():
        if isinstance(value, dict):
            yield from _dotted(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value
