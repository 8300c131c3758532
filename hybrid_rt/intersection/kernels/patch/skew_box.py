"""One ray against the skew box of a cell, its three slabs at a time in vector registers.

Each column of the box's basis is four float64, the last of them something else that a cell's
record holds, so that one load brings a coordinate of all three rows. The arithmetic is that of
`meet_box_plain`, which stands in where kernels run interpreted.
"""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic

from hybrid_rt.intersection.kernels.search.boxes import load, spread

# Where a record of a cell (see `patch.cells`) has columns along u, v, n, and the bounds.
COLUMN = 4
LOWER, UPPER = 3 * COLUMN, 4 * COLUMN
RECORD = 24  # 192 bytes: three lines of the cache
CENTRE = 3  # of the box: number 3 of each column
INFINITY = float("inf")


def meet_box_plain(
    record: Any, cell: int, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> Any:
    """Return where a ray is within the skew box of a cell, and the ray in the cell's basis.

    ``record`` (n, `RECORD`).
    ``x``, ``y``, ``z``, ``dx``, ``dy``, ``dz``: the ray's origin and direction, frame units.
    Returns ``t0``, ``t1`` it enters and leaves; t0 > t1 where it misses the box.
    ``ou``, ``ov``, ``on`` the origin from the middle of the box, along u, v and n.
    ``du``, ``dv``, ``dn`` the direction.
    """
    r = [float(number) for number in record[cell]]
    px, py, pz = x - r[CENTRE], y - r[COLUMN + CENTRE], z - r[2 * COLUMN + CENTRE]
    t0, t1 = -INFINITY, INFINITY
    along = []
    for axis in range(3):
        o = r[axis] * px + r[COLUMN + axis] * py + r[2 * COLUMN + axis] * pz
        d = r[axis] * dx + r[COLUMN + axis] * dy + r[2 * COLUMN + axis] * dz
        lo, hi = r[LOWER + axis] - o, r[UPPER + axis] - o
        if d == 0.0:
            is_within = lo <= 0.0 <= hi
            far = INFINITY if is_within else -INFINITY
            near = -far
        else:
            a, b = lo * (1.0 / d), hi * (1.0 / d)
            near, far = (b, a) if a > b else (a, b)
        t0 = max(t0, near)
        t1 = min(t1, far)
        along.append((o, d))
    (ou, du), (ov, dv), (on, dn) = along
    return t0, t1, ou, ov, on, du, dv, dn


def _vector_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    double, i32, i64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
    four = ir.VectorType(double, 4)
    add, sub, mul, select = builder.fadd, builder.fsub, builder.fmul, builder.select
    first = builder.mul(arguments[1], i64(RECORD))

    def fixed(value: float) -> Any:
        return ir.Constant(four, [value] * 4)

    def column(place: int) -> Any:
        return load(builder, array.data, builder.add(first, i64(place)), four)

    columns = [column(COLUMN * k) for k in range(3)]
    origin, direction = None, None
    for k, rows in enumerate(columns):
        away = sub(arguments[2 + k], builder.extract_element(rows, i32(CENTRE)))
        o = mul(rows, spread(builder, away, four))
        d = mul(rows, spread(builder, arguments[5 + k], four))
        origin = o if origin is None else add(origin, o)
        direction = d if direction is None else add(direction, d)
    lo, hi = sub(column(LOWER), origin), sub(column(UPPER), origin)
    inverse = builder.fdiv(fixed(1.0), direction)
    a, b = mul(lo, inverse), mul(hi, inverse)
    turned = builder.fcmp_ordered(">", a, b)
    near, far = select(turned, b, a), select(turned, a, b)
    # Along a slab: within it for ever, or never.
    is_flat = builder.fcmp_ordered("==", direction, fixed(0.0))
    is_within = builder.and_(
        builder.fcmp_ordered("<=", lo, fixed(0.0)), builder.fcmp_ordered(">=", hi, fixed(0.0))
    )
    least, most = fixed(-INFINITY), fixed(INFINITY)
    near = select(is_flat, select(is_within, least, most), near)
    far = select(is_flat, select(is_within, most, least), far)
    t0, t1 = ir.Constant(double, -INFINITY), ir.Constant(double, INFINITY)
    for axis in range(3):
        n, f = builder.extract_element(near, i32(axis)), builder.extract_element(far, i32(axis))
        t0 = select(builder.fcmp_ordered(">", n, t0), n, t0)
        t1 = select(builder.fcmp_ordered("<", f, t1), f, t1)
    numbers = [
        builder.extract_element(vector, i32(axis))
        for vector in (origin, direction)
        for axis in range(3)
    ]
    return cgutils.pack_array(builder, [t0, t1, *numbers])


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    meet_box = meet_box_plain
else:

    @intrinsic
    def meet_box(
        typing: Any, record: Any, cell: Any, x: Any, y: Any, z: Any, dx: Any, dy: Any, dz: Any
    ) -> Any:
        """Do what `meet_box_plain` does."""
        del typing, cell, x, y, z, dx, dy, dz
        numbers = [types.float64] * 6
        return types.UniTuple(types.float64, 8)(record, types.int64, *numbers), _vector_code
