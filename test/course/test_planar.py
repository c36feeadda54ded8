"""The plain numpy path of the course gives what the library gives, step by step."""

import numpy as np
import pytest
import yaml

import planar
from tp_controller import build_settings

FAR = [-0.9, 0.9]
HYSTERESIS = {'switching': 'hysteresis', 'activation': 0.05, 'release': 0.1}
DAMPERS = {'activation': 0.4, 'margin': 0.006}


def circles(**switching):
    return {f'tasks.obstacle_{i}.{key}': x for i in (1, 2, 3) for key, x in switching.items()}


# parameter file, seconds, changes, largest difference of a command
CASES = [
    ('a1_position', 2, {}, 1e-12),
    ('a2_configuration', 2, {}, 1e-12),
    ('a3_position_orientation', 2, {}, 1e-12),
    ('a3_position_orientation', 4, {'tasks.ee_orientation.target': [3.14159]}, 1e-12),
    ('a4_position_joint', 2, {}, 1e-12),
    ('a5_link_orientation', 2, {}, 1e-12),
    ('b1_obstacles', 6, {'tasks.ee_position.target': FAR, **circles(**HYSTERESIS)}, 1e-12),
    ('b2_joint_limits', 4, {'tasks.ee_position.target': [-1.0, 0.5]}, 1e-12),
    ('c1_algorithmic_singularity', 3, {'tasks.tip.target': [3.3, 1.0]}, 1e-11),
    (
        'c1_algorithmic_singularity',
        3,
        {'tasks.tip.target': [3.3, 1.0], 'solver.type': 'augmented'},
        1e-11,
    ),
    ('c2_macro_micro', 2, {'tasks.tip.target': [0.9, 1.4]}, 1e-12),
    ('c3_repeatability', 0.5, {'tasks.tip.target': [1.0, 2.0]}, 1e-9),
    ('singularity', 2, {'tasks.tip.target': [1.745, 0.0]}, 1e-11),
    ('d_rr', 0.5, {}, 1e-12),
    ('d_prr', 0.5, {}, 1e-12),
    ('d_prr', 0.5, {'solver.damping': 0.01}, 1e-12),
    # Rows of dampers are answered exactly in both; so the levels below have no damping here.
    (
        'b1_obstacles',
        4,
        {
            'rate': 60.0,
            'solver.damping': 0.0,
            'tasks.ee_position.target': FAR,
            **circles(**DAMPERS),
        },
        1e-9,
    ),
    (
        'a3_position_orientation',
        1,
        {
            'solver.type': 'hqp',
            'solver.damping': 0.0,
            'robot.limits.velocity': [0.3],
            'tasks.ee_position.gain': [4.0],
            'tasks.ee_orientation.gain': [4.0],
        },
        1e-9,
    ),
]


def parameters_of(path, changes):
    """Nested parameters of the controller, the first positions, and the rate."""
    text = yaml.safe_load(path.read_text(encoding='utf-8'))
    blocks = {name: block['ros__parameters'] for name, block in text.items()}
    values = blocks['/**'] | blocks['/**/tp_controller']
    rate = values.pop('rate')
    values.pop('start', None)
    values['solver'] = {**values['solver'], 'settle': False}
    for key, value in changes.items():
        *folders, name = key.split('.')
        block = values
        for folder in folders:
            block = block[folder]
        block[name] = value
    return values, np.array(blocks['/**/tp_sim']['initial_positions']), rate


@pytest.mark.parametrize(('name', 'seconds', 'changes', 'tolerance'), CASES)
def test_every_command_is_that_of_the_library(config, name, seconds, changes, tolerance):
    values, q, rate = parameters_of(config / f'{name}.yaml', changes)
    library, plain = build_settings(values).stack, planar.Stack(values)
    for _ in range(round(seconds * rate)):
        expected, found = library.step(q), plain.step(q)
        np.testing.assert_allclose(found.command, expected.command, rtol=0.0, atol=tolerance)
        for one, other in zip(found.levels, expected.levels, strict=True):
            assert one.tasks == other.tasks
            if one.tasks[0].startswith('obstacle') and 'rate' in changes:
                continue  # rows of dampers that are out are zero in the library alone
            np.testing.assert_allclose(one.achieved, other.achieved, rtol=0.0, atol=10 * tolerance)
        q = q + expected.command / rate
    for task, expected in library.tasks.items():
        found = plain.tasks[task]
        if found.set_based:
            assert found.distance == pytest.approx(expected.distance, abs=1e-9)
            assert found.active == expected.active
        else:
            assert found.error == pytest.approx(expected.error, abs=1e-9)


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'solver.type': 'weighted'}, "solver.type: 'weighted'"),
        ({'solver.saturation': 'null_space'}, 'solver.saturation'),
        ({'tasks.ee_position.type': 'gaze'}, "tasks.ee_position.type: 'gaze'"),
        ({'solver.type': 'hqp'}, 'solver.damping: 0.1'),
    ],
)
def test_what_it_does_not_know_is_refused_by_name(config, changes, said):
    values, _, _ = parameters_of(config / 'a1_position.yaml', changes)
    with pytest.raises(planar.Unknown, match=said):
        planar.Stack(values)
