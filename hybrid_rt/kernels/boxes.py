"""One ray against eight boxes at once, in vector registers.

numba unrolls the plain loop over eight children into scalar code; here LLVM is told that they are
vectors of eight float32. The arithmetic is that of the loop, lane by lane, and so are its results:
`test_boxes_plain` is that loop, and stands in where kernels run interpreted.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.extending import intrinsic

# One subtraction, one reciprocal, one product on each side: 3 * 2**-24 each, and as much again.
FAR_GROWTH = np.float32(8 * 2.0**-23)


def test_boxes_plain(
    rows: Any, node: int, x: Any, y: Any, z: Any, rx: Any, ry: Any, rz: Any,
    sx: int, sy: int, sz: int, t_lo: Any, t_hi: Any, entry: Any,
) -> int:  # fmt: skip
    """Intersect a ray with the eight boxes of a node.

    Parameters
    ----------
    rows : (n, 8, 8) float32
        Of each node six rows: lower bounds in x, y, z, then upper bounds; two rows of links.
    x, y, z, rx, ry, rz : float32
        The ray's origin, and the reciprocals of its direction.
    sx, sy, sz : int
        0 where the direction is positive, 3 where it is negative.
    t_lo, t_hi : float32
    entry : (8,) float32
        Receives where the ray enters each box.

    Returns
    -------
    int
        Bit k is set where box k is met between t_lo and t_hi.
    """
    mask = 0
    for k in range(8):
        near = max((rows[node, 1 + sy, k] - y) * ry, (rows[node, sx, k] - x) * rx)
        near = max(near, (rows[node, 2 + sz, k] - z) * rz, t_lo)
        far = min((rows[node, 4 - sy, k] - y) * ry, (rows[node, 3 - sx, k] - x) * rx)
        far = min(far, (rows[node, 5 - sz, k] - z) * rz)
        far = min(t_hi, far + abs(far) * FAR_GROWTH)
        entry[k] = near
        if near <= far:
            mask |= 1 << k
    return mask


def _vector_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    rows_type, entry_type = signature.args[0], signature.args[13]
    rows = context.make_array(rows_type)(context, builder, arguments[0])
    entry = context.make_array(entry_type)(context, builder, arguments[13])
    node = arguments[1]
    single, i64 = ir.FloatType(), ir.IntType(64)
    eight = ir.VectorType(single, 8)

    def spread(value: Any) -> Any:
        one = builder.insert_element(ir.Constant(eight, ir.Undefined), value, ir.IntType(32)(0))
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), 8), [0] * 8)
        return builder.shuffle_vector(one, ir.Constant(eight, ir.Undefined), lanes)

    def row(index: Any) -> Any:
        place = builder.add(builder.mul(node, i64(64)), builder.mul(index, i64(8)))
        pointer = builder.bitcast(builder.gep(rows.data, [place]), eight.as_pointer())
        return builder.load(pointer, align=4)

    def larger(a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", a, b), a, b)

    def smaller(a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered("<", a, b), a, b)

    near, far = None, None
    for axis in range(3):
        origin, reciprocal = spread(arguments[2 + axis]), spread(arguments[5 + axis])
        sign = arguments[8 + axis]
        first = row(builder.add(sign, i64(axis)))
        last = row(builder.sub(i64(3 + axis), sign))
        first = builder.fmul(builder.fsub(first, origin), reciprocal)
        last = builder.fmul(builder.fsub(last, origin), reciprocal)
        near = first if near is None else larger(first, near)
        far = last if far is None else smaller(last, far)
    near = larger(spread(arguments[11]), near)
    size = larger(far, builder.fneg(far))
    growth = spread(ir.Constant(single, float(FAR_GROWTH)))
    far = smaller(spread(arguments[12]), builder.fadd(far, builder.fmul(size, growth)))
    builder.store(near, builder.bitcast(entry.data, eight.as_pointer()), align=4)
    is_met = builder.fcmp_ordered("<=", near, far)
    return builder.zext(builder.bitcast(is_met, ir.IntType(8)), i64)


def _lowest_bit_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    del context, signature
    return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    test_boxes = test_boxes_plain

    def lowest_bit(mask: int) -> int:
        """Return the number of the lowest bit that is set."""
        return (mask & -mask).bit_length() - 1

else:

    @intrinsic
    def test_boxes(
        typing: Any, rows: Any, node: Any, x: Any, y: Any, z: Any, rx: Any, ry: Any, rz: Any,
        sx: Any, sy: Any, sz: Any, t_lo: Any, t_hi: Any, entry: Any,
    ) -> Any:  # fmt: skip
        """Do what `test_boxes_plain` does."""
        del typing, node, x, y, z, rx, ry, rz, sx, sy, sz, t_lo, t_hi
        numbers = [types.float32] * 6 + [types.int64] * 3 + [types.float32] * 2
        return types.int64(rows, types.int64, *numbers, entry), _vector_code

    @intrinsic
    def lowest_bit(typing: Any, mask: Any) -> Any:
        """Return the number of the lowest bit that is set."""
        del typing, mask
        return types.int64(types.int64), _lowest_bit_code
