"""One point of a Bezier patch, with its tangents."""

from hybrid_rt.intersection.kernels.patch.bicubic import evaluate_bicubic
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
def evaluate(control, start, degree_u, degree_v, u, v, basis):
    """Return S, S_u, S_v (nine numbers). ``basis`` is scratch of shape (4, > degree)."""
    bu, du, bv, dv = basis[0], basis[1], basis[2], basis[3]
    bernstein_basis(degree_u, u, bu, du)
    bernstein_basis(degree_v, v, bv, dv)
    x = y = z = xu = yu = zu = xv = yv = zv = 0.0
    row = start
    for i in range(degree_u + 1):
        cx = cy = cz = ex = ey = ez = 0.0
        for j in range(degree_v + 1):
            px, py, pz = control[row + j, 0], control[row + j, 1], control[row + j, 2]
            b, e = bv[j], dv[j]
            cx += b * px
            cy += b * py
            cz += b * pz
            ex += e * px
            ey += e * py
            ez += e * pz
        row += degree_v + 1
        b, e = bu[i], du[i]
        x += b * cx
        y += b * cy
        z += b * cz
        xu += e * cx
        yu += e * cy
        zu += e * cz
        xv += b * ex
        yv += b * ey
        zv += b * ez
    return x, y, z, xu, yu, zu, xv, yv, zv


@inlined
def evaluate_any(control, start, degree_u, degree_v, u, v, basis):
    """Take the vector code for bicubic patches, the general one for all others.

    Where ``basis`` is None all patches are bicubic: the compiler then leaves the general code out.
    """
    if basis is None:
        return evaluate_bicubic(control, start, u, v)
    if degree_u == 3 and degree_v == 3:
        return evaluate_bicubic(control, start, u, v)
    return evaluate(control, start, degree_u, degree_v, u, v, basis)
