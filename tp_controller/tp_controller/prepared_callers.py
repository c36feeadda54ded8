"""What the library has for `Prepared`: functions that take their arguments out of words."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from tp_controller.prepared import key

KINDS = {'float64': 'f', 'int64': 'i', 'bool': 'b'}


def prepared_caller(lean: Any, signature: Any) -> tuple[Callable[..., Any], Any]:
    """Function of words that calls another one, and its signature.

    Parameters
    ----------
    lean
        The other function, as numba compiles it.
    signature
        Its signature, with types of numba.
    """
    types = importlib.import_module('numba').types
    scope: dict[str, Any] = {'lean': lean, 'key': key(map(_kind, signature.args))}
    calls, place = [], 1
    for i, kind in enumerate(signature.args):
        scope[f'read_{i}'] = _reader(kind)
        calls.append(f'read_{i}(words, {place})')
        place += 1 + getattr(kind, 'ndim', 0)
    source = f"""
def caller(words):
    if words[0] != key:
        raise TypeError('arguments of other kinds than the function takes')
    return lean({', '.join(calls)})
"""
    exec(source, scope)
    return scope['caller'], signature.return_type(types.int64[::1])


def _kind(kind: Any) -> str:
    """Kind of an argument, see `key`."""
    if hasattr(kind, 'ndim'):
        return f'{KINDS[str(kind.dtype)]}{kind.ndim}'
    return KINDS[str(kind)]


def _reader(kind: Any) -> Any:
    """Function that makes an argument of its words from a place on."""
    numba = importlib.import_module('numba')
    arrays = importlib.import_module('numba.np.arrayobj')
    extending = importlib.import_module('numba.extending')
    size = numba.types.intp

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        first = arrays.make_array(signature.args[0])(context, builder, arguments[0]).data

        def word(i: int) -> Any:
            place = builder.add(arguments[1], context.get_constant(size, i))
            return builder.load(builder.gep(first, [place]))

        if kind == numba.types.float64:
            return builder.bitcast(word(0), context.get_value_type(kind))
        if kind == numba.types.boolean:
            return builder.icmp_signed('!=', word(0), context.get_constant(size, 0))
        if kind == numba.types.int64:
            return word(0)
        data_type = context.get_data_type(kind.dtype)
        item = context.get_constant(size, context.get_abi_sizeof(data_type))
        shape = [word(1 + i) for i in range(kind.ndim)]
        strides: list[Any] = []
        stride = item
        for length in reversed(shape):
            strides.insert(0, stride)
            stride = builder.mul(stride, length)
        made = arrays.make_array(kind)(context, builder)
        arrays.populate_array(
            made,
            data=builder.inttoptr(word(0), data_type.as_pointer()),
            shape=shape,
            strides=strides,
            itemsize=item,
            meminfo=None,
        )
        return made._getvalue()

    def read(_: Any, words: Any, place: Any) -> Any:
        return kind(words, place), generate

    return extending.intrinsic(read)
