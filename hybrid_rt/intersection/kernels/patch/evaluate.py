"""One point of a Bezier patch, with its tangents."""

from hybrid_rt.intersection.kernels.patch.bicubic import (
    evaluate_bicubic,
    evaluate_rational_bicubic,
    evaluate_rational_biquadratic,
)
from meshing.kernels.jit import inlined, inner


@inner
def bernstein_basis(degree, x, value, slope):
    """Fill the Bernstein polynomials of a degree at x and their derivatives (stable recurrence)."""
    y = 1.0 - x
    value[0] = 1.0
    for k in range(1, degree):
        carry = 0.0
        for j in range(k):
            old = value[j]
            value[j] = carry + y * old
            carry = x * old
        value[k] = carry
    # `value` holds degree - 1: differences give the derivative, one more step the value.
    slope[0] = -degree * value[0]
    for j in range(1, degree):
        slope[j] = degree * (value[j - 1] - value[j])
    slope[degree] = degree * value[degree - 1]
    carry = 0.0
    for j in range(degree):
        old = value[j]
        value[j] = carry + y * old
        carry = x * old
    value[degree] = carry


@inner
def evaluate_columns(control, start, degree_u, degree_v, u, v, basis):
    """Return W S, its partials along u and v, each followed by that of W: twelve numbers."""
    bu, du, bv, dv = basis[0], basis[1], basis[2], basis[3]
    bernstein_basis(degree_u, u, bu, du)
    bernstein_basis(degree_v, v, bv, dv)
    x = y = z = w = xu = yu = zu = wu = xv = yv = zv = wv = 0.0
    row = start
    for i in range(degree_u + 1):
        cx = cy = cz = cw = ex = ey = ez = ew = 0.0
        for j in range(degree_v + 1):
            px, py, pz = control[row + j, 0], control[row + j, 1], control[row + j, 2]
            pw = control[row + j, 3]
            b, e = bv[j], dv[j]
            cx += b * px
            cy += b * py
            cz += b * pz
            cw += b * pw
            ex += e * px
            ey += e * py
            ez += e * pz
            ew += e * pw
        row += degree_v + 1
        b, e = bu[i], du[i]
        x += b * cx
        y += b * cy
        z += b * cz
        w += b * cw
        xu += e * cx
        yu += e * cy
        zu += e * cz
        wu += e * cw
        xv += b * ex
        yv += b * ey
        zv += b * ez
        wv += b * ew
    return x, y, z, w, xu, yu, zu, wu, xv, yv, zv, wv


@inner
def evaluate(control, start, degree_u, degree_v, u, v, basis):
    """Return S, S_u, S_v (nine numbers). ``basis`` is scratch of shape (4, > degree)."""
    # Nobody asks for the last column: the compiler leaves it out.
    x, y, z, _, xu, yu, zu, _, xv, yv, zv, _ = evaluate_columns(
        control, start, degree_u, degree_v, u, v, basis
    )
    return x, y, z, xu, yu, zu, xv, yv, zv


@inner
def _evaluate_rational(control, start, degree_u, degree_v, u, v, basis):
    x, y, z, w, xu, yu, zu, wu, xv, yv, zv, wv = evaluate_columns(
        control, start, degree_u, degree_v, u, v, basis
    )
    # (W S)_u = W S_u + W_u S.
    inverse = 1.0 / w
    x, y, z, wu, wv = x * inverse, y * inverse, z * inverse, wu * inverse, wv * inverse
    return (
        x, y, z,
        xu * inverse - wu * x, yu * inverse - wu * y, zu * inverse - wu * z,
        xv * inverse - wv * x, yv * inverse - wv * y, zv * inverse - wv * z,
    )  # fmt: skip


@inlined
def _rational(control, start, degree_u, degree_v, u, v, basis):
    if basis is None:
        return evaluate_rational_bicubic(control, start, u, v)
    if degree_u == 3 and degree_v == 3:
        return evaluate_rational_bicubic(control, start, u, v)
    if degree_u == 2 and degree_v == 2:
        return evaluate_rational_biquadratic(control, start, u, v)
    return _evaluate_rational(control, start, degree_u, degree_v, u, v, basis)


@inlined
def _polynomial(control, start, degree_u, degree_v, u, v, basis):
    if basis is None:
        return evaluate_bicubic(control, start, u, v)
    if degree_u == 3 and degree_v == 3:
        return evaluate_bicubic(control, start, u, v)
    return evaluate(control, start, degree_u, degree_v, u, v, basis)


@inlined
def evaluate_any(control, start, degree_u, degree_v, u, v, basis, rational):
    """Return S, S_u, S_v (nine numbers), by vector code for bicubic patches (and others).

    Where ``basis`` is None all patches are bicubic, where ``rational`` is None all are polynomial:
    the compiler then leaves the other code out. Else ``rational`` tells it at run time.
    """
    if rational is None or not rational:
        return _polynomial(control, start, degree_u, degree_v, u, v, basis)
    return _rational(control, start, degree_u, degree_v, u, v, basis)
