"""Calls of kernels with arguments that are stored: a kernel makes any of them, given an address.

A kernel that calls another one by its name is compiled for the types of that one's arguments, and with all of
its code. One that makes a stored call is compiled once, whatever it calls, and the code that it calls is that
of the kernel as Python calls it. Passing two hundred words costs 30 to 50 ns.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import extending
from numba.core import cgutils, types

from meshing.kernels.jit import kernel

# Words of a stored call: the function that reads its arguments; the kernel; the address of a number without which
# the call is left out, or 0; what the kernel returned. Then its arguments, in words of 8 bytes.
FORWARD, KERNEL, CONDITION, RESULT, ARGUMENTS = 0, 1, 2, 3, 7
_WORD = ir.IntType(64)
intrinsic: Any = extending.intrinsic


def _word_at(builder: Any, words: Any, place: int) -> Any:
    return builder.load(builder.gep(words, [ir.Constant(_WORD, place)]))


def _read(context: Any, builder: Any, words: Any, place: int, kind: Any) -> tuple[Any, int]:
    """Emit code that reads a value of a type from ``words``; return it and the place behind it."""
    if isinstance(kind, types.Array):
        array = cgutils.create_struct_proxy(kind)(context, builder)
        found = [_word_at(builder, words, place + k) for k in range(3 + 2 * kind.ndim)]
        array.data = builder.inttoptr(found[0], array.data.type)
        array.nitems, array.itemsize = found[1:3]
        array.shape = cgutils.pack_array(builder, found[3 : 3 + kind.ndim])
        array.strides = cgutils.pack_array(builder, found[3 + kind.ndim :])
        return array._getvalue(), place + len(found)
    if isinstance(kind, types.BaseTuple):
        values = []
        for part in list(kind):  # type: ignore[call-overload]
            value, place = _read(context, builder, words, place, part)
            values.append(value)
        return context.make_tuple(builder, kind, values), place
    if isinstance(kind, types.NoneType):
        return context.get_dummy_value(), place
    word = _word_at(builder, words, place)
    if isinstance(kind, types.CPointer):  # of what another call has returned
        return builder.load(builder.inttoptr(word, _WORD.as_pointer())), place + 1
    value_type = context.get_value_type(kind)
    if isinstance(value_type, ir.DoubleType):
        return builder.bitcast(word, value_type), place + 1
    return builder.trunc(word, value_type) if value_type.width < 64 else word, place + 1


@intrinsic
def _pass_on(_typing: Any, address: Any, arguments: Any, returns: Any) -> Any:
    """Call the kernel of a stored call; ``arguments`` and ``returns`` are its types."""

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        words = builder.inttoptr(values[0], _WORD.as_pointer())
        stored, place, passed = list(arguments.instance_type), ARGUMENTS, []
        for kind in stored:
            value, place = _read(context, builder, words, place, kind)
            passed.append(value)
        kinds = [types.int64 if isinstance(k, types.CPointer) else k for k in stored]
        result = returns.instance_type
        function = context.call_conv.get_function_type(result, kinds).as_pointer()
        kernel = builder.inttoptr(_word_at(builder, words, KERNEL), function)
        _, value = context.call_conv.call_function(builder, kernel, result, kinds, passed)
        if isinstance(result, types.BaseTuple):
            for k, part in enumerate(cgutils.unpack_tuple(builder, value)):
                builder.store(part, builder.gep(words, [ir.Constant(_WORD, RESULT + k)]))
        return context.get_dummy_value()

    return types.none(address, arguments, returns), generate


@kernel
def _forward(address, arguments, returns):
    _pass_on(address, arguments, returns)


_FORWARD_TYPES = [types.int64, types.TypeRef(types.none), types.TypeRef(types.none)]


@intrinsic
def call_stored(_typing: Any, address: Any) -> Any:
    """Make a stored call, given its address, unless its condition is 0."""

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        words = builder.inttoptr(values[0], _WORD.as_pointer())
        condition, zero = _word_at(builder, words, CONDITION), ir.Constant(_WORD, 0)
        # Without a condition, the address of the kernel stands for one that is met.
        where = builder.select(
            builder.icmp_signed("==", condition, zero),
            builder.gep(words, [ir.Constant(_WORD, KERNEL)]),
            builder.inttoptr(condition, _WORD.as_pointer()),
        )
        with builder.if_then(builder.icmp_signed("!=", builder.load(where), zero)):
            function = context.call_conv.get_function_type(types.none, _FORWARD_TYPES).as_pointer()
            forward = builder.inttoptr(_word_at(builder, words, FORWARD), function)
            none = context.get_dummy_value()
            context.call_conv.call_function(
                builder, forward, types.none, _FORWARD_TYPES, [values[0], none, none]
            )
        return context.get_dummy_value()

    return types.none(address), generate


class Returned:
    """What a stored call returned last, one of several integers, as an argument of another."""

    def __init__(self, call: StoredCall, place: int) -> None:
        self.address = call.address + 8 * (RESULT + place)


class StoredCall:
    """A call of a kernel with arguments that stay where they are; it has an ``address`` while it lives.

    ``function``, a kernel, returns nothing, or up to four integers of 64 bits. ``arguments`` are arrays, numbers,
    named tuples of them, None, or `Returned`. ``only_if``: not 0 if the call is to be made.
    """

    def __init__(self, function: Any, *arguments: Any, only_if: Returned | None = None) -> None:
        self._arguments = arguments
        key = function, *map(_mark_of, arguments)
        if key not in _FOUND:
            kinds = tuple(map(_type_of, arguments))
            signature = tuple(types.int64 if isinstance(k, types.CPointer) else k for k in kinds)
            target, returns = _compiled(function, signature)
            stored = (types.int64, types.TypeRef(types.Tuple(kinds)), types.TypeRef(returns))
            _FOUND[key] = _compiled(_forward, stored)[0], target
        words = [
            *_FOUND[key],
            only_if.address if only_if else 0,
            *[0] * 4,
        ]
        self._words = np.array([*words, *_words_of(arguments)], np.int64)
        self.address: int = self._words.ctypes.data

    def keep(self, others: Any) -> None:
        """Let other calls, which this one makes, live as long."""
        self._arguments += (others,)


# Addresses of compiled code for what `_mark_of` tells of arguments: numba takes a millisecond to tell it.
_FOUND: dict[tuple[Any, ...], tuple[int, int]] = {}


def _mark_of(value: Any) -> Any:
    """Return what tells the type of an argument."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.ndim, value.flags.num
    return (type(value), *map(_mark_of, value)) if isinstance(value, tuple) else type(value)


def _type_of(argument: Any) -> Any:
    return types.CPointer(types.int64) if isinstance(argument, Returned) else numba.typeof(argument)


def _words_of(value: Any) -> list[int]:
    if isinstance(value, np.ndarray):
        return [value.ctypes.data, value.size, value.itemsize, *value.shape, *value.strides]
    if isinstance(value, tuple):
        return [word for part in value for word in _words_of(part)]
    if value is None:
        return []
    if isinstance(value, Returned):
        return [value.address]
    return [int(np.float64(value).view(np.int64)) if isinstance(value, float) else int(value)]


def _compiled(function: Any, signature: tuple[Any, ...]) -> tuple[int, Any]:
    """Return the address of a kernel's code for these types, and the type of what it returns."""
    function.compile(signature)
    found = function.overloads[signature]
    return found.library.get_pointer_to_function(
        found.fndesc.llvm_func_name
    ), found.signature.return_type
