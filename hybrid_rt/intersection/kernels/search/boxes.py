"""One ray against eight boxes at once, in vector registers, and the stack of those it meets.

numba unrolls a plain loop over eight children into scalar code; here LLVM is told that they are
vectors of eight numbers. What is met goes onto the stack in one store, sorted by a bitonic network
(Batcher 1968, "Sorting networks and their applications"): no branch depends on the ray.

A place on the stack is a key and the number of the node whose child it is. The key orders places by
where the ray enters the box: the bits of that float32, turned so that they compare as an integer,
with the number of the child in the last three, so t is rounded down by at most 2**-20 of itself.

`push_boxes_plain` and `sort_key_plain` say the same in plain Python, and stand in where kernels run
interpreted.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic

# One subtraction, one reciprocal, one product on each side: 3 * 2**-24 each, and as much again.
FAR_GROWTH = np.float32(8 * 2.0**-23)
LANES = 8
# Below every key, and above.
NEVER_MET, FARTHEST = -(2**31), 2**31 - 1


class BoxRay(NamedTuple):
    """A ray as eight boxes meet it: float32, and where the near bounds of each axis stand."""

    x: Any  # the origin
    y: Any
    z: Any
    rx: Any  # reciprocals of the direction
    ry: Any
    rz: Any
    sx: int  # 0 where the direction is positive, 3 where it is negative
    sy: int
    sz: int


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


def sort_key_plain(x: Any) -> int:
    """Return an integer that orders as the float32 ``x`` does."""
    bits = int(np.float32(x).view(np.int32))
    return bits if bits >= 0 else bits ^ 0x7FFFFFFF


def push_boxes_plain(
    rows: Any, node: Any, ray: BoxRay, t_lo: Any, t_hi: Any, keys: Any, parents: Any, top: int
) -> tuple[int, int]:
    """Push those of a node's eight boxes that a ray meets, the nearest on top.

    ``keys`` (m,) int32.
    ``rows`` (n, 8, 8) float32: of each node six rows: lower bounds in x, y, z, then upper bounds;
    two rows of links.
    ``parents`` (m,) uint32: eight places from ``top`` on are overwritten, however many boxes are
    met.
    Returns ``top``: the new height.
    ``nearest``: the key that is now on top; `FARTHEST` if no box is met.
    """
    x, y, z, rx, ry, rz, sx, sy, sz = ray
    met = []
    for k in range(LANES):
        near = max((rows[node, 1 + sy, k] - y) * ry, (rows[node, sx, k] - x) * rx)
        near = max(near, (rows[node, 2 + sz, k] - z) * rz, t_lo)
        far = min((rows[node, 4 - sy, k] - y) * ry, (rows[node, 3 - sx, k] - x) * rx)
        far = min(far, (rows[node, 5 - sz, k] - z) * rz)
        # Boxes of children that are not there run from inf to -inf, which makes this a NaN: no box.
        with np.errstate(invalid="ignore"):
            far += abs(far) * FAR_GROWTH
        far = t_hi if t_hi < far else far  # noqa: FURB136
        if near <= far:
            met.append((sort_key_plain(near) & ~7) | k)
    for place, key in enumerate(sorted(met, reverse=True)):
        keys[top + place], parents[top + place] = key, node
    return top + len(met), min(met, default=FARTHEST)


def _push_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    rows, keys, parents = (
        context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (0, 5, 6)
    )
    node, top = arguments[1], arguments[7]
    ray = cgutils.unpack_tuple(builder, arguments[2])
    single, i32, i64 = ir.FloatType(), ir.IntType(32), ir.IntType(64)
    floats, integers = ir.VectorType(single, LANES), ir.VectorType(i32, LANES)
    lanes = range(LANES)

    def fixed(values: Any) -> Any:
        return ir.Constant(integers, list(values))

    def row(index: Any) -> Any:
        place = builder.add(builder.mul(node, i64(64)), builder.mul(index, i64(8)))
        return load(builder, rows.data, place, floats)

    def larger(a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", a, b), a, b)

    def smaller(a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered("<", a, b), a, b)

    near, far = None, None
    for axis in range(3):
        origin = spread(builder, ray[axis], floats)
        reciprocal = spread(builder, ray[3 + axis], floats)
        sign = ray[6 + axis]
        first = row(builder.add(sign, i64(axis)))
        last = row(builder.sub(i64(3 + axis), sign))
        first = builder.fmul(builder.fsub(first, origin), reciprocal)
        last = builder.fmul(builder.fsub(last, origin), reciprocal)
        near = first if near is None else larger(first, near)
        far = last if far is None else smaller(last, far)
    near = larger(spread(builder, arguments[3], floats), near)
    size = larger(far, builder.fneg(far))
    growth = spread(builder, ir.Constant(single, float(FAR_GROWTH)), floats)
    far = builder.fadd(far, builder.fmul(size, growth))
    far = smaller(spread(builder, arguments[4], floats), far)
    is_met = builder.fcmp_ordered("<=", near, far)

    bits = builder.bitcast(near, integers)
    turned = builder.and_(builder.ashr(bits, fixed([31] * LANES)), fixed([0x7FFFFFFF] * LANES))
    key = builder.and_(builder.xor(bits, turned), fixed([-8] * LANES))
    key = builder.or_(key, fixed(lanes))
    # The nearest, in half the steps that sorting takes: the walk goes on with it at once.
    nearest = builder.select(is_met, key, fixed([FARTHEST] * LANES))
    for step in (4, 2, 1):
        other = builder.shuffle_vector(nearest, nearest, fixed(k ^ step for k in lanes))
        nearest = builder.select(builder.icmp_signed("<", nearest, other), nearest, other)
    nearest = builder.sext(builder.extract_element(nearest, i32(0)), i64)
    key = builder.select(is_met, key, fixed([NEVER_MET] * LANES))
    # Falling keys, those of missed boxes last.
    for block in (2, 4, 8):
        step = block // 2
        while step:
            other = builder.shuffle_vector(key, key, fixed(k ^ step for k in lanes))
            is_larger = builder.icmp_signed(">", key, other)
            high = builder.select(is_larger, key, other)
            low = builder.select(is_larger, other, key)
            takes_high = [((k & step) == 0) == ((k & block) == 0) for k in lanes]
            choice = fixed(k if takes_high[k] else LANES + k for k in lanes)
            key = builder.shuffle_vector(high, low, choice)
            step //= 2
    for array, value in (
        (keys, key),
        (parents, spread(builder, builder.trunc(node, i32), integers)),
    ):
        pointer = builder.bitcast(builder.gep(array.data, [top]), integers.as_pointer())
        builder.store(value, pointer, align=4)
    count = builder.ctpop(builder.bitcast(is_met, ir.IntType(LANES)))
    return cgutils.pack_array(builder, [builder.add(top, builder.zext(count, i64)), nearest])


def _key_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    del context, signature
    i32 = ir.IntType(32)
    bits = builder.bitcast(arguments[0], i32)
    return builder.xor(bits, builder.and_(builder.ashr(bits, i32(31)), i32(0x7FFFFFFF)))


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    push_boxes, sort_key = push_boxes_plain, sort_key_plain
else:

    @intrinsic
    def push_boxes(
        typing: Any, rows: Any, node: Any, ray: Any, t_lo: Any, t_hi: Any,
        keys: Any, parents: Any, top: Any,
    ) -> Any:  # fmt: skip
        """Do what `push_boxes_plain` does."""
        del typing, node, t_lo, t_hi, top
        fields = [types.float32] * 6 + [types.int64] * 3
        ray = types.NamedTuple(fields, ray.instance_class)
        result, single = types.UniTuple(types.int64, 2), types.float32
        return result(
            rows, types.int64, ray, single, single, keys, parents, types.int64
        ), _push_code

    @intrinsic
    def sort_key(typing: Any, x: Any) -> Any:
        """Do what `sort_key_plain` does."""
        del typing, x
        return types.int32(types.float32), _key_code
