"""Aspheres: closed forms, hard rays at every singular set judged by exact roots, and the manners."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hard_rays import (
    ANY_SURFACE,
    assert_crossings_are_exact,
    assert_decided_exactly,
    at_set,
    share_met_on_the_way,
    unit,
)
from mpmath import mp

from hybrid_rt import Asphere, Intersector, Sphere, Status, SurfaceOfRevolution, reflect
from proof.cases.singular_rays import at_parameters, beside, within

ASPHERES = {
    "hyperboloid": Asphere(10, -2.25, [], 22, (0.2, -0.1, 0.3), (0.3, -0.2, 1)),
    "paraboloid": Asphere(-4, -1, [], 10, (0, 0, 0), (1, 1, 0)),
    "ellipsoid": Asphere(5, -0.5, [], 12, (1, 2, 3), (0, 0, 1)).flipped(),
    "oblate": Asphere(5, 1.3, [0, 1e-4], 5, (1, 2, 3), (0, 1, 1)),
    "gull wing": Asphere(20, -0.7, [-0.05, 0.008, -2e-4, 1e-6], 10, (0, 0, 0), (0, 0, 1)),
    "corrector": Asphere(np.inf, 0, [-0.004, 3e-4], 8, (0, 0, 0), (0.1, 0, 1)),
    "plane": Asphere(np.inf, 0, [], 2, (0, 0, 0), (0.1, 0.5, 1)),
    "steep": Asphere(1, 0, [], 2 * np.sqrt(1 - 2e-3), (0, 0, 0), (0, 0, 1)),
    "far away": Asphere(1e6, -0.4, [0, 1e-19], 1.5e6, (1e9, -2e9, 3e8), (1, 2, 3)),
}
# 1e-3 times the Chebyshev polynomial T_8(2 w - 1), but for its constant: terms up to 665, the sum 2e-3.
CANCELLING = 1e-3 * np.array([-128, 2688, -21504, 84480, -180224, 212992, -131072, 32768])


def on_asphere(asphere, n, rng, v=None):
    """Points, normals, and two unit tangents: about the axis and away from it."""
    u, v = rng.random(n), np.sqrt(rng.random(n)) if v is None else np.broadcast_to(v, n)
    about, over = asphere.partials(u, np.clip(v, 1e-9, 1))
    return asphere.point(u, v), asphere.normal(u, v), unit(about), unit(over)


RIM = [(None, 0.0), (None, 1.0)]  # of either orientation, and its vertex
RAYS = {
    "rim, past": at_set(at_parameters(RIM, True), beside),
    "rim, flatly": at_set(at_parameters(RIM, True), within),
    "vertex": at_set(at_parameters([(0.0, 0.0), (0.0, 1.0)], False), beside),
    **ANY_SURFACE,
}


@pytest.mark.parametrize("kind", RAYS)
@pytest.mark.parametrize("name", ASPHERES)
def test_hard_rays_are_decided_as_the_exact_roots_say(name, kind):
    asphere, rng = ASPHERES[name], np.random.default_rng(len(name) + 100 * len(kind))
    assert_decided_exactly(asphere, *RAYS[kind](asphere, 40, rng))


def test_closed_forms():
    """Conics are quadrics: c r^2 + c (1 + k) z^2 = 2 z."""
    tracer = Intersector([
        Asphere(5, 0, [], 8, (0, 0, 0), (0, 0, 1)),
        Asphere(2, -1, [], 4, (10, 0, 0), (0, 0, 1)),
        Asphere(1, -5, [], 40, (30, 0, 0), (0, 0, 1)),
        Asphere(np.inf, 0, [0, 0.25], 4, (60, 0, 0), (0, 0, 1)),
    ])  # fmt: skip
    origins = [(3, 0, -5), (0, 0, 9), (11, 0, -3), (10, -9, 0.5), (30, 12, -9), (61, 0, -1)]
    directions = [(0, 0, 1), (0, 0, -2), (0, 0, 1), (0, 1, 0), (0, 0, 2), (0, 0, 1)]
    # Hyperboloid: r^2 = 2 z + 4 z^2.
    exact = [6, 4.5, 3.25, 9 - np.sqrt(2), (9 + (np.sqrt(4 + 16 * 144) - 2) / 8) / 2, 1.25]
    hits = tracer.intersect(origins, directions)
    assert hits.object_id.tolist() == [0, 0, 1, 1, 2, 3]
    assert np.abs(hits.t - exact).max() < 4e-15
    assert (np.abs(hits.t - exact) <= hits.t_bound).all()
    assert (hits.t_bound < 1e-13).all()
    np.testing.assert_allclose(hits.normal[0], [0.6, 0, -0.8], atol=1e-15)
    assert hits.front_face.tolist() == [True, False, True, True, True, True]
    np.testing.assert_allclose(hits.v, [0.75, 0, 0.5, np.sqrt(2) / 2, 0.6, 0.5], atol=1e-15)
    np.testing.assert_allclose(hits.u, [0, 0, 0, 0.75, 0.25, 0])
    assert tracer.intersect((4.001, 0, -5), (0, 0, 1)).status[0] == Status.MISS
    assert tracer.intersect((4, 0, -5), (0, 0, 1)).status[0] == Status.TANGENT


def test_a_cap_of_a_sphere_is_met_as_the_sphere():
    rng = np.random.default_rng(3)
    cap, ball = Asphere(2, 0, [], 3.9, (0, 0, 0), (0, 0, 1)), Sphere((0, 0, 2), 2)
    targets = ball.point(rng.random(20_000), 0.3 * rng.random(20_000))
    targets = targets[np.hypot(*targets[:, :2].T) < 1.9]
    origins = targets + unit(rng.normal(size=targets.shape)) * (0, 0, 5) - (0, 0, 4)
    ours = Intersector([cap]).intersect(origins, targets - origins)
    theirs = Intersector([ball]).intersect(origins, targets - origins)
    assert len(ours) > 10_000
    same = np.abs(ours.t - theirs.t) <= ours.t_bound + theirs.t_bound
    # The sphere's other half may come first.
    assert (same | (theirs.position[:, 2] > 1.5)).all()
    # A shift by the rounding of the ray and the sag, over the slope; where that is small, by its root.
    slope = np.abs(np.einsum("ij,ij->i", ours.normal, targets - origins))
    is_steep = slope > 1e-3
    assert (ours.t_bound * slope)[is_steep].max() < 4e-14


@pytest.mark.parametrize("name", list(ASPHERES)[:6])
def test_departures_are_not_met_again_and_the_other_roots_are(name):
    rng = np.random.default_rng(9)
    assert share_met_on_the_way(ASPHERES[name], on_asphere, 0.02, rng) == 0.0


def test_all_crossings_are_the_roots_of_the_polynomial():
    asphere, rng = ASPHERES["gull wing"], np.random.default_rng(2)
    targets, _, _, over = on_asphere(asphere, 300, rng)
    origins = targets - 15 * unit(over + 0.2 * rng.normal(size=(300, 3)))
    assert_crossings_are_exact(asphere, origins, targets - origins, {1, 2, 3, 4})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 0, [], 1), "radius is 0: pass a number but 0"),
        ((np.nan, 0, [], 1), "radius is nan"),
        ((1, np.inf, [], 1), "conic is inf"),
        ((1, 0, [1, np.nan], 1), "coefficient a_4 is nan"),
        ((1, 0, [0] * 17, 1), "at most 16"),
        ((1, 0, [], 0), "aperture is 0"),
        ((1e200, 0, [], 1e200), r"aperture is 1e\+200: .* at most 1e\+60"),
        (
            (1e-3, 0, [], 1e57),
            "turns vertical within it, pass at most 0.00199.*conic of at most -1",
        ),
        (
            (10, 0, [], 20),
            "turns vertical within it, pass at most 19.98.*, or a conic of at most -0.001",
        ),
        ((10, 3, [], 12), "turns vertical within it, pass at most 9.99"),
        ((10, -1, [], 1000), r"slope dz / dr of the sag reaches 50.*pass a smaller aperture"),
        (
            (-0.0049, -131.6, [], 25.4),
            r"radius is -0.0049 with .* pass a radius of 0.013 or more, or, for the tip of an axicon",
        ),
    ],
)
def test_what_cannot_be_a_surface_is_refused(arguments, message):
    with pytest.raises(ValueError, match=f"Asphere .*{message}"):
        Asphere(*arguments, (0, 0, 0), (0, 0, 1))


def jacobi(m):
    """P_m^(0,4)(2 x - 1) by powers of x: the polynomials of a Qcon asphere (Forbes 2007)."""
    powers = [Fraction(0)] * (m + 1)
    for i in range(m + 1):
        for j in range(i + 1):
            powers[m - i + j] += comb(m, i) * comb(m + 4, i) * comb(i, j) * (-1) ** (i - j)
    return powers


def qcon(weights, rim):
    """a_2, a_4, ... of r^4 times a sum of Jacobi polynomials in (r / rim)^2."""
    total = [Fraction(0)] * len(weights)
    for m, weight in enumerate(weights):
        for j, power in enumerate(jacobi(m)):
            total[j] += Fraction(weight) * power
    return [0.0] + [float(a / Fraction(rim) ** (4 + 2 * j)) for j, a in enumerate(total)]


# Even powers whose terms are up to 1e5 times their sum. Of the last, terms add up to 665, the sum to 2e-3.
CANCELLING_TERMS = {
    **{
        f"{n} Qcon terms": (
            (55.0, -0.8),
            qcon(np.random.default_rng(n).uniform(-0.05, 0.05, n) * 0.6 ** np.arange(n), 20.0),
            39.96,
        )
        for n in (7, 13, 15)
    },
    "rough": ((-40.0, 0.3), qcon(np.random.default_rng(1).uniform(-0.3, 0.3, 14), 20.0), 39.9),
    "Chebyshev": ((np.inf, 0.0), CANCELLING.tolist(), 2.0),
    "large conic": ((-0.049, -131.6), [], 25.4),
}


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1e5, -7e4, 3e4)])
@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize("name", CANCELLING_TERMS)
def test_terms_that_cancel_are_traced_within_their_bounds(name, size, place):
    """Roots of the sag in 60 digits, next to those found; the bounds stay near those of few terms."""
    (radius, conic), terms, aperture = CANCELLING_TERMS[name]
    radius, aperture, at = size * radius, size * aperture, size * np.array(place)
    terms = [a * size ** -(2 * i + 1) for i, a in enumerate(terms)]
    asphere = Asphere(radius, conic, terms, aperture, at, (0, 0, 1))
    rng = np.random.default_rng(4)
    targets = asphere.point(rng.random(12), np.sqrt(rng.random(12)))
    d = unit(rng.normal(size=(12, 3)) * (2, 2, 0.3) + (0, 0, 1))
    o = targets - 1.7 * aperture * d
    hits = Intersector(asphere).intersect(o, d)
    assert hits.hit.sum() >= 11
    with mp.workdps(60):
        curvature = mp.mpf(1) / mp.mpf(radius)
        for k in np.flatnonzero(hits.hit):
            start = [mp.mpf(float(p)) - mp.mpf(float(q)) for p, q in zip(o[k], at, strict=True)]
            way = [mp.mpf(float(p)) for p in d[k]]

            def above(t, start=start, way=way):
                x, y, z = (p + t * q for p, q in zip(start, way, strict=True))
                w = x * x + y * y
                root = mp.sqrt(1 - (1 + mp.mpf(conic)) * curvature**2 * w)
                polynomial = sum((mp.mpf(a) * w ** (i + 1) for i, a in enumerate(terms)), mp.mpf(0))
                return z - curvature * w / (1 + root) - polynomial

            t, bound = mp.mpf(float(hits.t[k])), mp.mpf(float(hits.t_bound[k]))
            # Two values of opposite sign have a root between: no iteration.
            assert above(t - bound) * above(t + bound) < 0
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal, d))[hits.hit]
    # The band over the cosine; rounding of the rough one is 30 bands.
    width = 100 if name == "rough" else 1
    assert (hits.t_bound[hits.hit] * cosine < width * 64 * 2.0**-52 * 2 * aperture).all()
    assert (hits.residual[hits.hit] < width * 64 * 2.0**-52 * 2 * aperture).all()


@pytest.mark.parametrize("times", [2000.0, 4000.0])
@pytest.mark.parametrize("n", [7, 13])
def test_the_slope_that_is_refused_is_that_of_the_surface(n, times):
    """From exact fractions on a fine grid: the message states within 4 % of it, as printed to 3 digits."""
    terms = [times * a for a in CANCELLING_TERMS[f"{n} Qcon terms"][1]]
    rings = [Fraction(i, 25) for i in range(500)]
    exact = [
        abs(sum((2 * i + 2) * Fraction(a) * r ** (2 * i + 1) for i, a in enumerate(terms)))
        for r in rings
    ]
    with pytest.raises(ValueError, match="slope dz / dr") as refused:
        Asphere(np.inf, 0, terms, 39.96, (0, 0, 0), (0, 0, 1))
    stated = float(str(refused.value).split("reaches ")[1].split(",")[0])
    assert 0.995 * float(max(exact)) < stated < 1.04 * float(max(exact))


def test_a_steep_paraboloid_is_told_the_profile_that_does_it():
    """Its message holds the profile; that mirror brings parallel light to the focus."""
    with pytest.raises(ValueError, match="slope dz / dr of the sag reaches 268") as refused:
        Asphere(0.5625, -1.0, [], 302.0, (0, 0, 0), (0, 0, 1))
    profile = str(refused.value).split("the profile ")[1]
    mirror = SurfaceOfRevolution(eval(profile, {"a": 149.0, "b": 151.0}), (0, 0, 0), (0, 0, 1))
    r = np.linspace(149.01, 150.99, 50)
    hits = Intersector(mirror).intersect(np.stack([r, 0 * r, 0 * r + 3e4], 1), (0, 0, -1))
    out = reflect((0, 0, -1), hits.normal)
    z = hits.position[:, 2] - hits.position[:, 0] / out[:, 0] * out[:, 2]
    # Normals are good to some ulp, and the focus is 2e4 away.
    assert np.abs(z - 0.28125).max() < 2e4 * 2.0**-45


def test_the_sag_is_the_formula():
    asphere = ASPHERES["gull wing"]
    r = np.linspace(0, 5, 50)
    c, (a2, a4, a6, a8) = 1 / 20, asphere.coefficients
    z = (
        c * r**2 / (1 + np.sqrt(1 - 0.3 * c**2 * r**2))
        + a2 * r**2
        + a4 * r**4
        + a6 * r**6
        + a8 * r**8
    )
    np.testing.assert_allclose(asphere.sag_at(r), z, atol=1e-14)
    np.testing.assert_array_equal(asphere.sag_at(-r), asphere.sag_at(r))
    with pytest.raises(ValueError, match=r"r is 5\.1: pass heights from the axis of at most 5"):
        asphere.sag_at([1, 5.1])
    again = eval(repr(asphere), {"Asphere": Asphere})
    assert repr(again) == repr(asphere)
    assert np.array_equal(again.bounds, asphere.bounds)


def test_bounds_of_zones_hold():
    """Dense samples do not leave the bounds that the certificate rests on."""
    for asphere in ASPHERES.values():
        sag, zones = asphere.sag.scaled(-asphere.local_exponent), asphere.local_zones
        w = sag.w_max * np.linspace(0, 1, 64 * 50 + 1)
        for values, bounds in zip(sag.at(w), zones[:3], strict=True):
            for part in (np.arange(64) * 50, (np.arange(64) + 1) * 50):
                zone = np.minimum(part // 50, 63) if part[0] == 0 else np.arange(64)
                inside = values[part[:, None] + (np.arange(50) if part[0] == 0 else 0)]
                assert (inside >= bounds[zone, :1]).all()
                assert (inside <= bounds[zone, 1:]).all()
