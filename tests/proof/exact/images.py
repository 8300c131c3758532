"""Images of closed forms and meshes, judged exactly.

The judge takes a ray back by the given matrices, in fractions, and meets the surface as it was given:
quotients of fractions, or roots of polynomials that flint isolates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeAlias

import flint
import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from hybrid_rt import Box, Intersector, Plane, Rectangle, Sphere, Status, TriangleMesh
from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus

Exact: TypeAlias = list[Fraction]
Rng: TypeAlias = np.random.Generator

DIGITS = 60
VERTICES = np.array([(0, 0, 0), (1, 0.1, 0.2), (0.3, 1.1, -0.3), (0.2, 0.4, 1.3)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
SHAPES: dict[str, Any] = {
    "sphere": Sphere((0.1, 0.7, -0.3), 0.9),
    "torus": Torus((0.1, 0.7, -0.3), (0, 0, 1), 0.8, 0.3),
    "asphere": Asphere(1.7, -1.0, (0.0, -0.06), 1.6, (0.1, 0.7, -0.3), (0, 0, 1)),
    "plane": Plane((0.1, 0.7, -0.3), (1, -2, 3.3)),
    "rectangle": Rectangle((0.1, 0.7, -0.3), (1.1, 0.2, 0), (0.3, -0.4, 0.9)),
    "box": Box((0.1, 0.7, -0.3), (0.6, 1.9, 0.4)),
    "mesh": TriangleMesh(SimpleNamespace(vertices=VERTICES, faces=FACES)),
}
ROUND = (Sphere, Torus, Asphere)


# --- matrices


def similarity(rng: Rng, scale: float, far: float) -> FloatArray:
    """Return a rotation of rounded entries, perhaps a reflection, a scale and a shift."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix[:3, 3] = far * rng.uniform(-1, 1, 3)
    return matrix


def affine(rng: Rng, scale: float, far: float) -> FloatArray:
    """Return such a matrix, sheared."""
    matrix = similarity(rng, scale, far)
    matrix[:3, :3] = matrix[:3, :3] @ (np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3)))
    return matrix


def upright(rng: Rng, scale: float, far: float) -> FloatArray:
    """Return scales and a shift, which leave boxes along the axes."""
    matrix = np.diag([*(scale * rng.uniform(0.5, 2.0, 3) * (1, -1, 1)), 1.0])
    matrix[:3, 3] = far * rng.uniform(-1, 1, 3)
    return matrix


def matrices_for(given: Any, rng: Rng, scale: float, far: float) -> list[list[FloatArray]]:
    """Return two maps, to be applied one after the other, and one that is upright if the surface takes it."""
    make = similarity if isinstance(given, ROUND) else affine
    several = [[make(rng, scale, 0.3 * far / scale), make(rng, 1.0, far)]]
    return several if isinstance(given, ROUND) else [*several, [upright(rng, scale, far)]]


# --- the surfaces as given, met by a ray of fractions


def _dot(a: Iterable[Fraction], b: Iterable[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _cross(a: Exact, b: Exact) -> Exact:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def _less(a: Exact, b: Exact) -> Exact:
    return [x - y for x, y in zip(a, b, strict=True)]


def _exact(values: Iterable[float]) -> Exact:
    return [Fraction(float(x)) for x in values]


def taken_back(matrix: FloatArray, o: Exact, d: Exact) -> tuple[Exact, Exact]:
    """Return the ray whose image under the matrix is this one."""
    rows = [_exact(row[:3]) for row in matrix[:3]]
    cofactors = [_cross(rows[i - 2], rows[i - 1]) for i in range(3)]
    volume = _dot(rows[0], cofactors[0])
    a, b = (
        [_dot((c[i] for c in cofactors), x) / volume for i in range(3)]
        for x in (_less(o, _exact(matrix[:3, 3])), d)
    )
    return a, b


def crossings(given: Any, o: Exact, d: Exact) -> list[Any]:
    """Return all t at which a ray meets a surface."""
    if isinstance(given, Plane):
        n, c = _exact(given.exact_normal), _exact(given.origin)
        return [_dot(n, _less(c, o)) / _dot(n, d)] if _dot(n, d) != 0 else []
    if isinstance(given, ROUND):
        return _of_round(given, o, d)
    if isinstance(given, Rectangle):
        faces = [(_exact(given.corner), _exact(given.edge_u), _exact(given.edge_v))]
    elif isinstance(given, Box):
        lo, size = _exact(given.lo), _less(_exact(given.hi), _exact(given.lo))
        edges = [[size[k] * (k == i) for k in range(3)] for i in range(3)]
        upper = [[x + y for x, y in zip(lo, edge, strict=True)] for edge in edges]
        faces = [(c, edges[i - 2], edges[i - 1]) for i in range(3) for c in (lo, upper[i])]
    else:
        corners = [[_exact(given.vertices[k]) for k in face] for face in given.faces]
        faces = [(a, _less(b, a), _less(c, a)) for a, b, c in corners]
    found = []
    for corner, e, f in faces:
        n, away = _cross(e, f), _less(o, corner)
        if _dot(n, d) == 0:
            continue
        t = -_dot(n, away) / _dot(n, d)
        p = [a + t * b for a, b in zip(away, d, strict=True)]
        u, v = _dot(_cross(p, f), n), _dot(_cross(e, p), n)
        whole = _dot(n, n)
        if min(u, v) >= 0 and (u + v if given.is_triangular else max(u, v)) <= whole:
            found.append(t)
    return found


def _of_round(given: Any, o: Exact, d: Exact) -> list[Any]:
    center = _exact(given.center if isinstance(given, Sphere) else given.origin)
    line = [[b, a] for a, b in zip(_less(o, center), d, strict=True)]
    x2, y2, z2 = (_times(x, x) for x in line)
    if isinstance(given, Sphere):
        return _real_roots(_plus(x2, y2, z2, [-(Fraction(given.radius) ** 2)]))
    if isinstance(given, Torus):
        big, small = Fraction(given.major_radius) ** 2, Fraction(given.minor_radius) ** 2
        left = _plus(x2, y2, z2, [big - small])
        return _real_roots(_plus(_times(left, left), _times([-4 * big], _plus(x2, y2))))
    # A paraboloid, and two terms.
    w = _plus(x2, y2)
    a, b = _exact(given.coefficients)
    bend = -1 / (2 * Fraction(given.radius)) - a
    height = _plus(line[2], _times([bend], w), _times([-b], w, w))
    most, square = mpf(0.5 * given.aperture) ** 2, [_mpf(x) for x in w]
    p, q, r = square
    return [t for t in _real_roots(height) if (p * t + q) * t + r <= most]


def _times(*polynomials: Exact) -> Exact:
    result = [Fraction(1)]
    for p in polynomials:
        n = len(result) + len(p) - 1
        longer = [Fraction(0)] * n
        for i, x in enumerate(result):
            for k, y in enumerate(p):
                longer[i + k] += x * y
        result = longer
    return result


def _plus(*polynomials: Exact) -> Exact:
    n = max(map(len, polynomials))
    filled = [[Fraction(0)] * (n - len(p)) + p for p in polynomials]
    return [sum(terms, Fraction(0)) for terms in zip(*filled, strict=True)]


def _real_roots(coefficients: Exact) -> list[Any]:
    # Flint tells real roots from pairs that nearly meet for certain, and refines them to its precision.
    whole = math.lcm(*(c.denominator for c in coefficients))
    polynomial = flint.fmpz_poly([int(c * whole) for c in reversed(coefficients)])
    with flint.ctx.workprec(4 * DIGITS):
        found: Any = polynomial.complex_roots()
        roots = [x for x, _ in found if x.imag == 0]
    return [mpf(int(m)) * mpf(2) ** int(e) for m, e in (x.real.mid().man_exp() for x in roots)]


def _mpf(x: Any) -> Any:
    return mpf(x.numerator) / x.denominator if isinstance(x, Fraction) else x


# --- rays, and the judge


def rays_at(image: Any, size: float, rng: Rng, n: int) -> tuple[FloatArray, FloatArray]:
    """Return rays of four sorts in turn: chords, and rays that graze; each from afar, and from the surface.

    The latter two pass the surface, or its borders, by more and by less than rounding.
    """
    u, v = rng.uniform(0, 1, (2, n))
    ids = rng.integers(len(image), size=n)
    border = (rng.random(n) < 0.4) & (np.arange(n) % 4 > 0)
    v = v * (1.0 - u) if image.is_triangular else v
    ends = rng.integers(2, size=n) * (1.0 - v if image.is_triangular else 1.0)
    u = np.where(border, ends, u)
    if isinstance(image, Plane):
        u, v = (x + image.origin[axis] for x, axis in zip((u, v), image.axes, strict=True))
    point, normal = image.point(u, v, ids), image.normal(u, v, ids)
    d = rng.normal(size=(n, 3))
    grazing = np.arange(n) % 4 >= 2
    along = d - np.einsum("ij,ij->i", d, normal)[:, None] * normal
    d = np.where((grazing & ~border)[:, None], along, d)
    aside = np.where(border[:, None], rng.normal(size=(n, 3)), normal)
    by = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-3, 2, n) * (image.moved + 1e-14 * size)
    point = point + (grazing * by)[:, None] * aside
    d /= np.linalg.norm(d, axis=1)[:, None]
    back = np.where(np.arange(n) % 2 == 0, 10.0 ** rng.uniform(-1, 1, n) * size, 0.0)
    return point - back[:, None] * d, d * rng.choice([0.3, 1.0, 40.0], n)[:, None]


class Judged(NamedTuple):
    """What of n rays was wrong."""

    hits: HitRecord
    wrong: NDArray[np.int64]  # rows that hit or miss, without TANGENT, where the exact ray does not
    broken: NDArray[np.int64]  # rows whose t is farther from the exact one than t_bound


def judge(
    given: Any, matrices: Sequence[FloatArray], rng: Rng, n: int, others: Sequence[Any] = ()
) -> Judged:
    """Trace rays at the image under one matrix after the other, and compare with the exact image.

    ``others`` are surfaces that these rays do not meet, far away.
    """
    image = given
    for matrix in matrices:
        image = image.transformed(matrix)
    scale = float(np.prod([abs(np.linalg.det(m[:3, :3])) for m in matrices]) ** (1 / 3))
    o, d = rays_at(image, image.size or scale, rng, n)
    hits = Intersector([*others, image], coarse="none", threads=1).intersect(o, d)
    wrong, broken = [], []
    with mpmath.mp.workdps(DIGITS):
        for i in range(n):
            ray = _exact(o[i]), _exact(d[i])
            for matrix in reversed(matrices):
                ray = taken_back(matrix, *ray)
            everywhere = crossings(given, *ray)
            found = [t for t in everywhere if t > 0]
            t, bound = mpf(float(hits.t[i])), mpf(float(hits.t_bound[i]))
            if hits.status[i] == Status.TANGENT:
                # The exact ray meets these in the same place, or not at all.
                is_one = isinstance(given, Sphere | Plane)
                gap = min((abs(_mpf(x) - t) for x in everywhere), default=0)
                if hits.hit[i] and is_one and gap > bound:
                    broken.append(i)
            elif bool(found) != bool(hits.hit[i]):
                wrong.append(i)
            elif found and abs(_mpf(min(found)) - t) > bound:
                broken.append(i)
    return Judged(hits, np.array(wrong, np.int64), np.array(broken, np.int64))
