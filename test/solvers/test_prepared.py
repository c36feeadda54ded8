"""Compiled functions that are called again and again with the same arrays."""

import subprocess
import sys

import numpy as np
import pytest

from tp_controller.braking import approach, bound
from tp_controller.prepared import Prepared

PLACES = {'before': 1, 'dt': 3, 'out': 6}


def prepared(out):
    n = out.size
    endless = np.full(n, np.inf)
    return Prepared(approach, np.ones(n), np.zeros(n), np.ones(n), 0.1, -endless, endless, out)


def test_numbers_and_arrays_can_be_put_in_the_place_of_others():
    out, other = np.zeros((2, 3))
    call = prepared(out)
    call.run()
    assert out == pytest.approx(0.1)
    call.put(PLACES['dt'], 0.2)
    call.run()
    assert out == pytest.approx(0.2)
    call.replace(PLACES['before'], np.full(3, 0.5))
    call.replace(PLACES['out'], other)
    call.run()
    assert other == pytest.approx(0.7)
    assert out == pytest.approx(0.2)


def test_arrays_are_read_where_they_are():
    out = np.zeros(3)
    call = prepared(out)
    call.arguments[PLACES['before']][:] = 0.5
    call.run()
    assert out == pytest.approx(0.6)


@pytest.mark.parametrize(
    ('place', 'value'),
    [
        (1, np.zeros((3, 1))),
        (1, np.zeros(3, dtype=np.int64)),
        (3, 1),
        (3, np.zeros(1)),
        (3, True),
    ],
)
def test_arguments_of_other_kinds_are_refused_before_anything_is_read(place, value):
    out = np.zeros(3)
    arguments = list(prepared(out).arguments)
    arguments[place] = value
    with pytest.raises(TypeError, match='other kinds'):
        Prepared(approach, *arguments).run()
    with pytest.raises(TypeError, match='other kinds'):
        Prepared(bound, *arguments).run()
    assert not out.any()


def test_another_array_has_to_be_of_the_same_kind():
    call = prepared(np.zeros(3))
    for other in (np.zeros((3, 1)), np.zeros(3, dtype=np.int64)):
        with pytest.raises(TypeError, match='of another kind than'):
            call.replace(1, other)


def test_an_array_of_what_no_function_takes_is_refused():
    with pytest.raises(TypeError, match='float32'):
        Prepared(approach, np.zeros(3, dtype=np.float32))


def test_an_array_with_gaps_is_refused():
    with pytest.raises(TypeError, match='gaps'):
        Prepared(approach, np.zeros((3, 2))[:, 0])
    with pytest.raises(TypeError, match='gaps'):
        prepared(np.zeros(3)).replace(1, np.zeros((3, 2))[:, 0])


def test_without_the_library_it_does_the_same():
    """Where numba compiles, the function gets the arguments themselves."""
    code = """
import numpy as np
from tp_controller import compiled
compiled.library = lambda: None
from tp_controller.braking import approach
from tp_controller.prepared import Prepared
out, endless = np.zeros(3), np.full(3, np.inf)
call = Prepared(approach, np.ones(3), np.zeros(3), np.ones(3), 0.1, -endless, endless, out)
call.put(3, 0.2)
call.replace(1, np.full(3, 0.5))
call.run()
print(type(approach).__name__, out.tolist())
"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[0] == 'CPUDispatcher'
    out = np.zeros(3)
    call = prepared(out)
    call.put(3, 0.2)
    call.replace(1, np.full(3, 0.5))
    call.run()
    assert done.stdout.split(maxsplit=1)[1] == f'{out.tolist()}\n'
