"""Shared by kernels written in LLVM IR: vector registers."""

from typing import Any

from llvmlite import ir


def spread(builder: Any, value: Any, kind: Any) -> Any:
    """Return a vector of type ``kind`` with ``value`` in all its lanes."""
    nothing = ir.Constant(kind, ir.Undefined)
    one = builder.insert_element(nothing, value, ir.IntType(32)(0))
    lanes = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    return builder.shuffle_vector(one, nothing, lanes)


def load(builder: Any, data: Any, place: Any, kind: Any) -> Any:
    """Return the numbers of an array from ``place`` on as a vector of type ``kind``."""
    pointer = builder.bitcast(builder.gep(data, [place]), kind.as_pointer())
    return builder.load(pointer, align=4 if kind.element == ir.FloatType() else 8)
