"""Rows A27, A28 and A31: rational patches and NURBS."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches, NurbsSurface
from proof.cases.rational_surfaces import octant
from proof.stability.measure import EPS, by_times
from proof.stability.measure_exact import by_exact
from proof.stability.row import Effort, Outcome, Plot, refusal, row

# Powers of two that leave the weights of an octant within a factor of 1e6.
PACES = (2.0**-1, 2.0**-4, 2.0**-8, 2.0**-9, 2.0**4, 2.0**8)
# Knots with breaks (degree + 1), creases (degree), spans of nothing, and none at the ends.
KNOTS: tuple[tuple[FloatArray, int], ...] = (
    (np.array([0.0, 0, 0, 1, 1, 1, 2, 3, 3, 3]), 2),
    (np.array([0.0, 0, 0, 0, 1, 1, 1, 4, 4, 4, 4]), 3),
    (np.arange(10.0) * 1e6, 3),
    (np.array([-1.0, -1, 0, 0, 2, 2]), 1),
)


def aimed(n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return rays from around at points of the octant's ball."""
    away = rng.normal(size=(n, 3))
    origins = 3.0 * away / np.linalg.norm(away, axis=1)[:, None]
    to = rng.random((n, 3))
    to *= (rng.random(n) ** 0.2 / np.linalg.norm(to, axis=1))[:, None]
    return origins, to - origins


def octant_times(origins: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the first t > 0 on the octant, by the sphere's quadratic in long double; inf for none."""
    o, d = origins.astype(np.longdouble), directions.astype(np.longdouble)
    a, b, c = (d * d).sum(axis=1), (o * d).sum(axis=1), (o * o).sum(axis=1) - 1
    first = np.full(len(o), np.inf, np.longdouble)
    with np.errstate(invalid="ignore", divide="ignore"):
        q = -(b + np.sign(b) * np.sqrt(b * b - a * c))
        for t in (q / a, c / q):
            is_on = (t > 0) & (o + t[:, None] * d >= 0).all(axis=1)
            first = np.where(is_on & (t < first), t, first)
    return first.astype(np.float64)


def by_basis(surface: NurbsSurface, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return points by Cox and de Boor's recursion for the basis functions, (u, v) in [0, 1]."""
    shares = []
    for x, knots, degree in zip((u, v), surface.knots, surface.degree, strict=True):
        n = len(knots) - degree - 1
        at = knots[degree] + x * (knots[n] - knots[degree])
        basis = [
            ((knots[i] <= at) & (at < knots[i + 1])).astype(float) for i in range(len(knots) - 1)
        ]
        for k in range(1, degree + 1):
            for i in range(len(knots) - 1 - k):
                total = np.zeros_like(at)
                if knots[i + k] > knots[i]:
                    total += (at - knots[i]) / (knots[i + k] - knots[i]) * basis[i]
                if knots[i + k + 1] > knots[i + 1]:
                    share = (knots[i + k + 1] - at) / (knots[i + k + 1] - knots[i + 1])
                    total += share * basis[i + 1]
                basis[i] = total
        shares.append(np.stack(basis[:n], axis=1))
    weights = surface.weights
    w = np.ones(surface.control.shape[:2]) if weights is None else weights
    joint = shares[0][:, :, None] * shares[1][:, None, :] * w
    points: FloatArray = np.einsum("kij,ijc->kc", joint, surface.control)
    points /= joint.sum(axis=(1, 2))[:, None]
    return points


def random_nurbs(
    u: tuple[FloatArray, int], v: tuple[FloatArray, int], rng: np.random.Generator
) -> NurbsSurface:
    """Return a bumpy sheet with weights on given knots and degrees."""
    p, q = len(u[0]) - u[1] - 1, len(v[0]) - v[1] - 1
    x, y = np.meshgrid(np.arange(p), np.arange(q), indexing="ij")
    net = np.stack([x, y, 0.7 * rng.normal(size=(p, q))], axis=-1)
    return NurbsSurface(net, u[0], v[0], (u[1], v[1]), np.exp(0.5 * rng.normal(size=(p, q))))


@row("A27", "rational patches with weights that are none", "refusal")
def bad_weights(effort: Effort) -> Outcome:
    """Zero, negative, infinite and nan weights are refused by name; so are any a million apart."""
    total, (net, weights) = Outcome(), octant()
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    for value in (0.0, -0.0, -1.0, -1e-300, np.inf, np.nan, 1e-7, 1e8):
        i, j = effort.rng(27).integers(3, size=2)
        bad = weights.copy()
        bad[i, j] = value
        word = "apart" if value in {1e-7, 1e8} else f"at ({i}, {j})"
        total += refusal(partial(BezierPatches, [net, net], [weights, bad]), "patch 1", word)
        total += refusal(partial(NurbsSurface, net, knots, knots, 2, bad), "NurbsSurface", word)
    for shape in ((3, 4), (9,), (3, 3, 1)):
        total += refusal(partial(BezierPatches, [net], [np.ones(shape)]), "has shape")
    return total


@row("A28", "rational patches with weights 1e-6 to 1e6", "closed form; exact crossings")
def weights_far_apart(effort: Effort) -> Outcome:
    """An octant of the sphere stays one when weights w_i c^i drive all parameters to one end."""
    total, plot = Outcome(), Plot("ratio of weights", "octant of a sphere")
    origins, directions = aimed(effort.count(20_000, 300), effort.rng(28))
    t = octant_times(origins, directions)
    n = effort.count(500, 1)
    for pace_u, pace_v in [(c, 1.0) for c in PACES] + [(c**0.5, c**0.5) for c in PACES]:
        net, weights = octant(pace_u, pace_v)
        surface = BezierPatches([net], [weights])
        total += by_times([surface], origins, directions, t)
        total += by_exact([surface], origins[:n], directions[:n])
        u, v = effort.rng(29).random((2, 1000))
        gap = np.abs(np.linalg.norm(surface.point(u, v), axis=1) - 1.0)
        # Quotients of sums whose terms are all positive: some roundings, whatever the weights.
        total += plot.add(float(weights.max() / weights.min()), gap, np.full(1000, 16 * EPS))
    return Outcome(curves=(plot,)) + total


@row("A31", "NURBS with breaks and spans of nothing", "the basis functions; exact crossings")
def breaks_and_empty_spans(effort: Effort) -> Outcome:
    """Points are those of the definition, one patch for each span, and rays pass through breaks."""
    total, rng = Outcome(), effort.rng(31)
    for k, u in enumerate(KNOTS):
        v = KNOTS[k - 1]
        surface = random_nurbs(u, v, rng)
        spans = [len(np.unique(x[d : len(x) - d])) - 1 for x, d in (u, v)]
        total = total.checked(
            len(surface) == spans[0] * spans[1],
            f"{surface!r} is not {spans[0]} x {spans[1]} patches",
        )
        a, b = rng.random((2, effort.count(10_000, 200)))
        gap = np.abs(surface.point(a, b) - by_basis(surface, a, b)).max(axis=1)
        # Knots of 1e6 are rounded to 1e-16 of them, so parameters to 1e-16 times ten spans.
        total += Outcome(rays=a.size, error=float(gap.max() / (256 * EPS * surface.size)))
        n = effort.count(400, 8)
        low, high = surface.bounds
        to = rng.uniform(low, high, (n, 3))
        origins = to + surface.size * (0.2 * rng.normal(size=(n, 3)) + (0.0, 0.0, 1.0))
        total += by_exact([surface], origins, to - origins)
    flat = np.stack(
        [*np.meshgrid([0.0, 1.0, 3.0, 4.0], [0.0, 1.0], indexing="ij"), np.zeros((4, 2))], -1
    )
    torn = NurbsSurface(flat, [0, 0, 1, 1, 2, 2], [0, 0, 1, 1], 1)
    x = np.array([0.5, 1.0 - 1e-9, 1.0 + 1e-9, 2.0, 3.0 - 1e-9, 3.0 + 1e-9, 3.5])
    origins = np.stack([x, np.full(7, 0.5), np.ones(7)], axis=1)
    hit = (x < 1) | (x > 3)
    return total + by_times(
        [torn], origins, np.tile((0.0, 0.0, -1.0), (7, 1)), np.where(hit, 1.0, np.inf)
    )
