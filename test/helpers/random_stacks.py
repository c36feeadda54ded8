"""Hypothesis strategies for arms, states and hierarchies, as parameter dictionaries.

Numbers lie on a grid of 0.01, so that a matrix is either exactly rank-deficient or well away
from it, and examples shrink to readable ones.
"""

import math
import os

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

AXES = ('x', 'y', 'z', 'xy', 'xz', 'yz', 'xyz')
TASK_TYPES = ('position', 'orientation', 'pose', 'joint')


SHARE = float(os.environ.get('EXAMPLES', '0.25'))
"""Part of the examples that is tried; the variable EXAMPLES makes it larger or smaller."""


def examples(count):
    """Settings of a property test; no deadline, machines differ."""
    return settings(max_examples=math.ceil(SHARE * count), deadline=None)


def numbers(low, high):
    return st.integers(round(100 * low), round(100 * high)).map(lambda number: number / 100)


def vectors(size, high):
    """Lists of numbers in [-high, high]; drawn as bytes, which is quick."""

    def from_bytes(drawn):
        return np.round(np.frombuffer(drawn, '<i2') * (high / 2**15), 2).tolist()

    return st.binary(min_size=2 * size, max_size=2 * size).map(from_bytes)


def positive_vectors(size, low, high):
    return vectors(size, 1.0).map(
        lambda values: [round(low + (high - low) * abs(value), 2) for value in values]
    )


def nonzero_vectors(size):
    """As `vectors` within 1, with a last 1 in place of all zeros."""
    return vectors(size, 1).map(lambda values: values if any(values) else [*values[:-1], 1.0])


def lists_of(strategy, size):
    return st.lists(strategy, min_size=size, max_size=size)


@st.composite
def arms(draw, min_joints=1, max_joints=9):
    """Block ``robot`` of a spatial arm with mixed joints, sometimes on a moved base."""
    n = draw(st.integers(min_joints, max_joints))
    quarter_turns = lists_of(st.sampled_from([0.0, math.pi / 2, -math.pi / 2]), n)
    zeros = st.just([0.0] * n)
    dh = {
        'theta': draw(vectors(n, 3) | zeros),
        'd': draw(vectors(n, 1) | zeros),
        'a': draw(vectors(n, 1)),
        'alpha': draw(vectors(n, 3) | quarter_turns),
        'types': draw(lists_of(st.sampled_from(['revolute', 'prismatic']), n)),
    }
    if draw(st.booleans()):
        dh['base_pose'] = draw(vectors(6, 3))
    if draw(st.booleans()):
        dh['convention'] = 'modified'
    return {'joints': [f'joint_{i + 1}' for i in range(n)], 'dh': dh}


@st.composite
def planar_arms(draw, min_joints=1, max_joints=6):
    """Block ``robot`` of a planar arm with revolute joints, sometimes on a moved base."""
    n = draw(st.integers(min_joints, max_joints))
    zeros = [0.0] * n
    dh = {
        'theta': zeros,
        'd': zeros,
        'a': draw(positive_vectors(n, 0.2, 1)),
        'alpha': zeros,
        'types': ['revolute'] * n,
    }
    if draw(st.booleans()):
        dh['base_pose'] = draw(vectors(6, 3))
    return {'joints': [f'joint_{i + 1}' for i in range(n)], 'dh': dh}


def states(n):
    return vectors(n, 4).map(np.array)


def stretched_states(n):
    """Configurations of a planar arm with every link along one line, folded or not."""
    folds = st.sampled_from([0.0, math.pi, -math.pi])
    return st.tuples(numbers(-3, 3), lists_of(folds, n - 1)).map(
        lambda state: np.array([state[0], *state[1]])
    )


@st.composite
def gains(draw, k):
    """One value, one per row, or a positive matrix row by row."""
    form = draw(st.sampled_from(['one', 'rows', 'matrix']))
    if form == 'one':
        return [draw(numbers(0, 5))]
    if form == 'rows':
        return draw(positive_vectors(k, 0, 5))
    root = np.array(draw(vectors(k * k, 2))).reshape(k, k)
    turn = np.array(draw(vectors(k * k, 1))).reshape(k, k)
    return (root @ root.T + turn - turn.T).ravel().tolist()


def _orientation(axes):
    return vectors(1, 7) if len(axes) == 1 else nonzero_vectors(4)


@st.composite
def tasks(draw, robot, types=TASK_TYPES, all_axes=AXES):
    """Block of a task on that arm, with gain, feedforward and target."""
    kind = draw(st.sampled_from(types))
    block = {'type': kind}
    if kind == 'joint':
        names = st.sampled_from(robot['joints'])
        block['joints'] = draw(st.lists(names, min_size=1, max_size=3, unique=True))
        k = len(block['joints'])
        target = draw(vectors(k, 7))
    else:
        block['frame'] = f'link_{draw(st.integers(1, len(robot["joints"])))}'
        if kind == 'pose':
            position = block['position_axes'] = draw(st.sampled_from(all_axes))
            orientation = block['orientation_axes'] = draw(st.sampled_from(all_axes))
        else:
            axes = block['axes'] = draw(st.sampled_from(all_axes))
            position, orientation = (axes, '') if kind == 'position' else ('', axes)
        k = len(position) + len(orientation)
        target = draw(vectors(len(position), 3))
        target += draw(_orientation(orientation)) if orientation else []
    return block | {
        'target': target,
        'gain': draw(gains(k)),
        'feedforward': draw(vectors(k, 2)),
    }


@st.composite
def parameters(draw, robots=None, max_levels=5, dampings=None, min_levels=1, types=TASK_TYPES):
    """Parameters of a stack of 1 to 5 levels, some with two tasks, and one idle task."""
    robot = draw(arms() if robots is None else robots)
    sizes = draw(st.lists(st.sampled_from([1, 1, 2]), min_size=min_levels, max_size=max_levels))
    names = [f'task_{i}' for i in range(sum(sizes) + 1)]
    blocks = {name: draw(tasks(robot, types)) for name in names}
    hierarchy, used = [], 0
    for size in sizes:
        hierarchy.append(' + '.join(names[used : used + size]))
        used += size
    return {
        'robot': robot,
        'solver': {'damping': draw(numbers(0.01, 1) if dampings is None else dampings)},
        'hierarchy': hierarchy,
        'tasks': blocks,
    }
