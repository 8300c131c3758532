"""A bicubic patch and its tangents at one point, all coordinates at a time in vector registers.

So are rational patches of degree 3 x 3, and of degree 2 x 2, as most machined surfaces are.

Control points are rows of four float64, so that one load brings a point; the last of them is the
weight of a homogeneous net, else unused.
The arithmetic is that of `evaluate_bicubic_plain`, which stands in where kernels run interpreted.
"""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic

from hybrid_rt.intersection.kernels.search.boxes import load, spread


def evaluate_bicubic_plain(control: Any, start: int, u: float, v: float) -> Any:
    """Return S, S_u, S_v (nine numbers) of the patch whose net begins at row ``start``.

    ``control`` (total, 4).
    """
    out = _plain(3, control, start, u, v)
    return tuple(out[4 * k + c] for k in range(3) for c in range(3))


def evaluate_rational_bicubic_plain(control: Any, start: int, u: float, v: float) -> Any:
    """Return S, S_u, S_v of a rational patch, rows (w P, w); parameters as above."""
    return _quotient(*_plain(3, control, start, u, v))


def evaluate_rational_biquadratic_plain(control: Any, start: int, u: float, v: float) -> Any:
    """As `evaluate_rational_bicubic_plain`, of degree 2."""
    return _quotient(*_plain(2, control, start, u, v))


def _quotient(*sums: float) -> Any:
    """Return X / W and its partials from X, W, their partials along u and those along v."""
    inverse = 1.0 / sums[3]
    point = [x * inverse for x in sums[:3]]
    slopes = (sums[7] * inverse, sums[11] * inverse)
    partials = [
        sums[4 + 4 * k + c] * inverse - slopes[k] * point[c] for k in range(2) for c in range(3)
    ]
    return (*point, *partials)


def _plain(degree: int, control: Any, start: int, u: float, v: float) -> Any:
    values_u, slopes_u = _bernstein(degree, u)
    values_v, slopes_v = _bernstein(degree, v)
    slopes = (0.0, *slopes_u, 0.0)
    out = [0.0] * 12
    for i in range(degree + 1):
        for c in range(4):
            points = [float(control[start + (degree + 1) * i + j, c]) for j in range(degree + 1)]
            point = sum(values_v[j] * points[j] for j in range(degree + 1))
            slope = sum(slopes_v[j] * (points[j + 1] - points[j]) for j in range(degree))
            out[c] += values_u[i] * point
            out[4 + c] += (slopes[i] - slopes[i + 1]) * point
            out[8 + c] += values_u[i] * slope
    return tuple(out)


def _bernstein(degree: int, x: float) -> Any:
    """Return the Bernstein polynomials, and the degree times those of one degree less."""
    y = 1.0 - x
    if degree == 2:
        return (y * y, 2.0 * y * x, x * x), (2.0 * y, 2.0 * x)
    values = (y * y * y, 3.0 * y * y * x, 3.0 * y * x * x, x * x * x)
    return values, (3.0 * y * y, 6.0 * y * x, 3.0 * x * x)


def _vector_code(degree: int, rational: bool, builder: Any, data: Any, arguments: Any) -> Any:
    start, u, v = arguments
    double, i64 = ir.DoubleType(), ir.IntType(64)
    four = ir.VectorType(double, 4)
    add, sub, mul = builder.fadd, builder.fsub, builder.fmul

    def number(x: float) -> Any:
        return ir.Constant(double, x)

    def bernstein(x: Any) -> Any:
        y = sub(number(1.0), x)
        if degree == 2:
            y2, x2 = mul(number(2.0), y), mul(number(2.0), x)
            return (mul(y, y), mul(y2, x), mul(x, x)), (y2, x2)
        y3, x3 = mul(number(3.0), y), mul(number(3.0), x)
        values = (mul(mul(y, y), y), mul(mul(y3, y), x), mul(mul(y3, x), x), mul(mul(x, x), x))
        return values, (mul(y3, y), mul(mul(number(6.0), y), x), mul(x3, x))

    values_u, slopes_u = bernstein(u)
    values_v, slopes_v = bernstein(v)
    weights = (
        builder.fneg(slopes_u[0]),
        *(sub(slopes_u[i], slopes_u[i + 1]) for i in range(degree - 1)),
        slopes_u[degree - 1],
    )
    values_v, slopes_v = ([spread(builder, x, four) for x in p] for p in (values_v, slopes_v))
    out: list[Any] = [None] * 3
    for i in range(degree + 1):
        points = []
        for j in range(degree + 1):
            place = builder.mul(builder.add(start, i64((degree + 1) * i + j)), i64(4))
            points.append(load(builder, data, place, four))
        point = mul(values_v[0], points[0])
        for j in range(1, degree + 1):
            point = add(point, mul(values_v[j], points[j]))
        slope = mul(slopes_v[0], sub(points[1], points[0]))
        for j in range(1, degree):
            slope = add(slope, mul(slopes_v[j], sub(points[j + 1], points[j])))
        value, weight = (spread(builder, x[i], four) for x in (values_u, weights))
        for k, term in enumerate((mul(value, point), mul(weight, point), mul(value, slope))):
            out[k] = term if i == 0 else add(out[k], term)
    if rational:
        # (W S)_u = W S_u + W_u S.
        last = ir.IntType(32)(3)
        inverse = spread(
            builder, builder.fdiv(number(1.0), builder.extract_element(out[0], last)), four
        )
        out = [mul(vector, inverse) for vector in out]
        for k in (1, 2):
            slope = spread(builder, builder.extract_element(out[k], last), four)
            out[k] = sub(out[k], mul(slope, out[0]))
    numbers = [
        builder.extract_element(vector, ir.IntType(32)(c)) for vector in out for c in range(3)
    ]
    return cgutils.pack_array(builder, numbers)


def _compiled(degree: int, rational: bool, control: Any) -> Any:
    """Return signature and code of an intrinsic that takes (control, start, u, v)."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return _vector_code(degree, rational, builder, array.data, arguments[1:])

    result = types.UniTuple(types.float64, 9)
    return result(control, types.int64, types.float64, types.float64), code


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    evaluate_bicubic = evaluate_bicubic_plain
    evaluate_rational_bicubic = evaluate_rational_bicubic_plain
    evaluate_rational_biquadratic = evaluate_rational_biquadratic_plain
else:

    @intrinsic
    def evaluate_bicubic(typing: Any, control: Any, start: Any, u: Any, v: Any) -> Any:
        """Do what `evaluate_bicubic_plain` does."""
        del typing, start, u, v
        return _compiled(3, False, control)

    @intrinsic
    def evaluate_rational_bicubic(typing: Any, control: Any, start: Any, u: Any, v: Any) -> Any:
        """Do what `evaluate_rational_bicubic_plain` does."""
        del typing, start, u, v
        return _compiled(3, True, control)

    @intrinsic
    def evaluate_rational_biquadratic(typing: Any, control: Any, start: Any, u: Any, v: Any) -> Any:
        """Do what `evaluate_rational_biquadratic_plain` does."""
        del typing, start, u, v
        return _compiled(2, True, control)
