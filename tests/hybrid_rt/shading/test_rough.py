"""Lobes of rough metal and rough glass: samples as the density says, energy, and light both ways."""

import math

import numpy as np
import pytest
from scipy import special, stats

from hybrid_rt import Lambertian, Mirror, Mix, RoughConductor, RoughDielectric
from hybrid_rt.materials.rough_conductor import METALS
from hybrid_rt.materials.table import color_factor, compile_materials
from hybrid_rt.shading.kernels.bsdf import sample_lobes, scattered
from hybrid_rt.shading.kernels.lobes.register import EVERY
from hybrid_rt.shading.kernels.lobes.rough_conductor import conductor_reflectance
from meshing.kernels.jit import kernel

N = 2**16
# One false alarm in about ten thousand runs of all the chi-square tests here.
ALARM = 1e-4 / 60
ROUGHNESS = [0.01, 0.1, 0.4, 0.7, 1.0]
COSINES = [1.0, 0.5, 0.02]


@kernel(allocates=True)
def evaluate(lobes, material, colors, normal, direction, wi, ratio, value, pdf):
    for i in range(material.size):
        value[i, 0], value[i, 1], value[i, 2], pdf[i] = scattered(
            lobes, material[i], colors, i,
            normal[i, 0], normal[i, 1], normal[i, 2],
            direction[i, 0], direction[i, 1], direction[i, 2],
            wi[i, 0], wi[i, 1], wi[i, 2], ratio[i], EVERY,
        )  # fmt: skip


def table_of(material, n):
    lobes, textures = compile_materials([material])
    colors = textures.number[lobes.texture, :3] * color_factor(lobes)[:, None]
    return lobes, np.ascontiguousarray(np.broadcast_to(colors, (n, *colors.shape)))


def hits(material, directions):
    """Hits on a plane whose normal is z, from directions (n, 3) or (3,)."""
    directions = np.atleast_2d(directions).astype(float)
    n = len(directions)
    lobes, colors = table_of(material, n)
    normal = np.tile([0.0, 0.0, 1.0], (n, 1))
    return lobes, np.zeros(n, np.int32), colors, normal, directions


def evaluated(material, incoming, leaving, ratio=0.0):
    """f cos (n, 3) and pdf (n,) of ways from ``incoming`` to ``leaving``; one of them may be one."""
    incoming, leaving = np.broadcast_arrays(np.atleast_2d(incoming), np.atleast_2d(leaving))
    leaving, n = np.ascontiguousarray(leaving, dtype=float), len(leaving)
    value, pdf = np.empty((n, 3)), np.empty(n)
    table = hits(material, np.ascontiguousarray(incoming))
    evaluate(*table, leaving, np.full(n, float(ratio)), value, pdf)
    return value, pdf


def sampled(material, incoming, xi, ratio=0.0):
    """Directions, f cos / pdf and pdf for random numbers (n, 3)."""
    n = len(xi)
    lobes, ids, colors, normal, directions = hits(material, np.tile(incoming, (n, 1)))
    wi, value, pdf = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    sample_lobes(
        lobes, ids, colors, normal, directions, np.full(n, float(ratio)),
        np.ascontiguousarray(xi[:, :2]), np.ascontiguousarray(xi[:, 2]), EVERY, wi, value, pdf,
    )  # fmt: skip
    return wi, value, pdf


def arriving(cosine, turn=0.7):
    """A direction that meets the plane from above (cosine > 0) or below."""
    sine = math.sqrt(1 - cosine * cosine)
    return np.array([sine * math.cos(turn), sine * math.sin(turn), -cosine])


class Chart:
    """Cells of directions, (rings, turns), by the facets that send light there.

    A facet's slope is alpha x in direction phi; rings are even in 1 - 1 / sqrt(1 + x^2): GGX has
    no end of slopes, and from the side the steep ones are seen most. Solid angles of cells come from differences of the mirrored or refracted directions.
    """

    RINGS, TURNS, FINE = 16, 12, 12

    def __init__(self, incoming, alpha, ratio=None):
        self.to_source, self.alpha, self.ratio = -np.asarray(incoming), alpha, ratio
        # Up is the side from which light comes.
        self.up = math.copysign(1.0, self.to_source[2])

    def facets(self, share, phi):
        """Normals of facets, (..., 3)."""
        slope = self.alpha * np.sqrt(1 / (1 - share) ** 2 - 1)
        m = np.stack([slope * np.cos(phi), slope * np.sin(phi), self.up + 0 * slope], axis=-1)
        return m / np.linalg.norm(m, axis=-1, keepdims=True)

    def leaving(self, share, phi):
        """Where facets send light, (..., 3); nan where none arrives or passes."""
        m = self.facets(share, phi)
        facing = m @ self.to_source
        facing[facing <= 0] = np.nan
        if self.ratio is None:
            w = 2 * facing[..., None] * m - self.to_source
            return np.where(w[..., 2:] * self.up > 0, w, np.nan)
        cos2 = 1 - (1 - facing**2) / self.ratio**2
        cos_t = np.sqrt(np.where(cos2 > 0, cos2, np.nan))
        w = (facing / self.ratio - cos_t)[..., None] * m - self.to_source / self.ratio
        return np.where(w[..., 2:] * self.up < 0, w, np.nan)

    def directions(self):
        """Middles of the parts of cells (n, 3), and the solid angles of the parts (n,)."""
        share = (np.arange(self.RINGS * self.FINE) + 0.5) / (self.RINGS * self.FINE)
        phi = 2 * np.pi * (np.arange(self.TURNS * self.FINE) + 0.5) / (self.TURNS * self.FINE)
        share, phi = np.meshgrid(share, phi, indexing="ij")
        step = 1e-3 / share.size**0.5
        along = self.leaving(share + step, phi) - self.leaving(share - step, phi)
        around = self.leaving(share, phi + step) - self.leaving(share, phi - step)
        area = np.linalg.norm(np.cross(along, around), axis=-1) / (2 * step) ** 2
        solid = area * 2 * np.pi / share.size
        return self.leaving(share, phi).reshape(-1, 3), solid.ravel()

    def masses(self, density, solid):
        """What densities at the middles of parts add up to in each cell."""
        mass = np.nan_to_num(density * solid)
        parts = mass.reshape(self.RINGS, self.FINE, self.TURNS, self.FINE)
        return parts.sum(axis=(1, 3)).ravel()

    def cells(self, w):
        """The cell of each direction, by the facet between it and the source."""
        m = self.to_source + (1.0 if self.ratio is None else self.ratio) * w
        slope = m[:, :2] * self.up / m[:, 2:] / self.alpha
        x2 = np.square(slope).sum(axis=1)
        ring = ((1 - 1 / np.sqrt(1 + x2)) * self.RINGS).astype(int)
        turn = np.arctan2(slope[:, 1], slope[:, 0]) / (2 * np.pi) % 1.0
        return ring * self.TURNS + np.minimum((turn * self.TURNS).astype(int), self.TURNS - 1)


def chi_square(counts, expected):
    """The p-value; cells expected to hold few are taken together."""
    order = np.argsort(expected)
    counts, expected = counts[order], expected[order]
    few = np.searchsorted(np.cumsum(expected), 20.0) + 1
    counts = np.append(counts[few:], counts[:few].sum())
    expected = np.append(expected[few:], expected[:few].sum())
    big = expected >= 20.0
    rest = counts[~big].sum(), expected[~big].sum()
    counts, expected = counts[big], expected[big]
    if rest[1] > 20.0:
        counts, expected = np.append(counts, rest[0]), np.append(expected, rest[1])
    statistic = ((counts - expected) ** 2 / expected).sum()
    return stats.chi2.sf(statistic, expected.size - 1)


def assert_distributed_as_pdf(material, incoming, charts, ratio=0.0):
    """Chi-square over the cells of charts, and one more for what is lost."""
    wi, _, pdf = sampled(material, incoming, np.random.default_rng(3).random((N, 3)), ratio)
    went = pdf > 0
    counts, expected = [], []
    for chart in charts:
        w, solid = chart.directions()
        _, density = evaluated(material, incoming, np.nan_to_num(w), ratio)
        expected.append(N * chart.masses(density, solid))
        above = wi[:, 2] * chart.up > 0
        cells = chart.cells(wi[went & (above if chart.ratio is None else ~above)])
        counts.append(np.bincount(cells, minlength=chart.RINGS * chart.TURNS))
    expected = np.concatenate(expected)
    # A midpoint rule of parts that the horizon cuts is good to a few thousandths.
    assert expected.sum() <= N * 1.003
    counts = np.append(np.concatenate(counts), N - went.sum())
    assert chi_square(counts, np.append(expected, max(N - expected.sum(), 0.0))) > ALARM


class TestConductor:
    @pytest.mark.statistical
    @pytest.mark.parametrize("roughness", ROUGHNESS)
    @pytest.mark.parametrize("cosine", [*COSINES, -0.5])
    def test_directions_are_distributed_as_the_pdf_says(self, roughness, cosine):
        incoming = arriving(cosine)
        copper = RoughConductor.of("copper", roughness)
        assert_distributed_as_pdf(copper, incoming, [Chart(incoming, roughness**2)])

    @pytest.mark.parametrize("roughness", ROUGHNESS)
    @pytest.mark.parametrize("cosine", COSINES)
    def test_energy_is_that_of_facets_seen_once(self, roughness, cosine):
        """Against an integral over slopes, which shares nothing with the lobe but Smith's shadows.

        A white metal (k large) in radiance one: the share of light that leaves after one facet.
        """
        white = RoughConductor(1.0, 1e3, roughness)
        incoming = arriving(cosine)
        xi = np.random.default_rng(5).random((2 * N, 3))
        _, value, _ = sampled(white, incoming, xi)
        mean, error = value[:, 0].mean(), value[:, 0].std() / math.sqrt(len(value))
        expected = leaving_after_one_facet(roughness**2, cosine)
        assert expected <= 1.0
        assert value.max() <= 1.0 + 1e-9
        # k = 1000 reflects all but 4e-6 at normal incidence; the error may be zero.
        assert abs(mean - expected) < 5 * error + 1e-4

    @pytest.mark.parametrize("roughness", ROUGHNESS)
    def test_light_goes_both_ways_alike(self, roughness):
        rng = np.random.default_rng(8)
        gold = RoughConductor.of("gold", roughness)
        a = arriving(0.6)
        # About the mirror direction, where a narrow lobe is not zero.
        b = a * [1, 1, -1] + 3 * roughness**2 * rng.normal(size=(500, 3))
        b /= np.linalg.norm(b, axis=1)[:, None]
        b = b[b[:, 2] > 1e-3]
        there, _ = evaluated(gold, a, b)
        back, _ = evaluated(gold, -b, np.broadcast_to(-a, b.shape))
        assert there.max() > 0
        np.testing.assert_allclose(there / b[:, 2:], back / 0.6, rtol=1e-9)

    def test_reflectance_is_that_of_a_complex_index(self):
        for cosine in (1.0, 0.7, 0.1, 1e-3, 1e-9):
            for eta, k in ((0.1, 3.5), (1.5, 1e-3), (1.44, 7.5), (1e-3, 1e-3), (1e3, 1e3), (3, 1)):
                index = complex(eta, k)
                cos_t = np.sqrt(1 - (1 - cosine**2) / index**2)
                across = (cosine - index * cos_t) / (cosine + index * cos_t)
                along = (index * cosine - cos_t) / (index * cosine + cos_t)
                expected = (abs(across) ** 2 + abs(along) ** 2) / 2
                found = conductor_reflectance(cosine, eta, k)
                assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)

    def test_color_at_normal_incidence_is_the_metals(self):
        """The smoothest gold, seen along the normal: its whole reflectance."""
        for metal, (eta, k) in METALS.items():
            index = np.array(eta) + 1j * np.array(k)
            expected = np.abs((index - 1) / (index + 1)) ** 2
            _, value, pdf = sampled(
                RoughConductor.of(metal, 0.01), (0, 0, -1), np.full((1, 3), 0.3)
            )
            assert pdf[0] > 0
            np.testing.assert_allclose(value[0], expected, rtol=1e-6)

    def test_a_mixture_sends_on_the_sum_of_its_parts(self):
        gold = RoughConductor.of("gold", 0.5)
        mixed = Mix([(0.3, gold), (0.5, Mirror())])
        w, _ = Chart(arriving(0.5), 0.25).directions()
        w = w[w[:, 2] > 0][::97]
        alone, _ = evaluated(gold, arriving(0.5), w)
        found, _ = evaluated(mixed, arriving(0.5), w)
        np.testing.assert_allclose(found, 0.3 * alone, rtol=1e-12)


def leaving_after_one_facet(alpha, cosine, ratio=None):
    """The share of light that leaves a rough mirror, or glass, after one facet.

    An integral over slopes. A facet of slopes (p, q) takes the share max(v . m, 0) P(p, q) of what
    is projected, over the whole; what it mirrors leaves with the probability that Smith's function
    gives, G2 / G1, and what it refracts with that of two sides, by Euler's beta function. Slopes
    q and -q do the same. Where total reflection begins the sum is off by up to 7e-4, else by 1e-4.
    """
    sine = math.sqrt(1 - cosine * cosine)
    n = 400
    u = 14 * (np.arange(-n, n) + 0.5) / n
    slope, step = alpha * np.sinh(u), alpha * np.cosh(u) * 14 / n
    p, q = np.meshgrid(slope, slope[n:], indexing="ij")
    density = 1 / (math.pi * alpha**2 * (1 + (p * p + q * q) / alpha**2) ** 2)
    seen = np.maximum(cosine - p * sine, 0.0) * density * step[:, None] * step[n:]
    length2 = 1 + p * p + q * q
    facing = (cosine - p * sine) / np.sqrt(length2)
    # Of the mirrored direction: 2 (v . m) m - v.
    out = 2 * facing / np.sqrt(length2) - cosine

    def smith(c):
        return (np.sqrt(1 + alpha**2 * (1 - c * c) / (c * c)) - 1) / 2

    with np.errstate(divide="ignore", invalid="ignore"):
        leaves = np.where(out > 0, (1 + smith(cosine)) / (1 + smith(cosine) + smith(out)), 0.0)
        if ratio is not None:
            cos_t = np.sqrt(np.maximum(1 - (1 - facing**2) / ratio**2, 0.0))
            across = (facing - ratio * cos_t) / (facing + ratio * cos_t)
            level = (ratio * facing - cos_t) / (ratio * facing + cos_t)
            mirrors = np.where(cos_t > 0, 0.5 * (across**2 + level**2), 1.0)
            # Of the refracted direction: (v . m / ratio - cos_t) m - v / ratio, downward.
            down = cosine / ratio - (facing / ratio - cos_t) / np.sqrt(length2)
            through = (1 + smith(cosine)) * special.beta(1 + smith(cosine), 1 + smith(down))
            leaves = mirrors * leaves + (1 - mirrors) * np.where(down > 0, through, 0.0)
            leaves = np.where(facing > 0, leaves, 0.0)
    return float((seen * leaves).sum() / seen.sum())


class TestGlass:
    """``ratio`` is the index beyond over that before: above 1 from outside, below 1 from inside."""

    RATIOS = (1.5, 1 / 1.5, 1.0 + 1e-4)

    @pytest.mark.statistical
    @pytest.mark.parametrize("roughness", ROUGHNESS)
    @pytest.mark.parametrize("cosine", [*COSINES, -0.5])
    @pytest.mark.parametrize("ratio", RATIOS)
    def test_directions_are_distributed_as_the_pdf_says(self, roughness, cosine, ratio):
        incoming, alpha = arriving(cosine), roughness**2
        charts = [Chart(incoming, alpha), Chart(incoming, alpha, ratio)]
        assert_distributed_as_pdf(RoughDielectric(1.5, roughness), incoming, charts, ratio)

    @pytest.mark.statistical
    def test_directions_of_a_mixture_are_distributed_as_the_pdf_says(self):
        """Matt and mirrored light besides: no lobe leads to another lobe's side."""
        parts = [(0.3, RoughDielectric(1.5, 0.7)), (0.3, RoughConductor.of("gold", 1.0))]
        material = Mix([*parts, (0.2, Lambertian(0.9))])
        incoming = arriving(0.3)
        charts = [Chart(incoming, 0.7), Chart(incoming, 0.7, 1.5)]
        assert_distributed_as_pdf(material, incoming, charts, 1.5)

    @pytest.mark.parametrize("roughness", ROUGHNESS)
    @pytest.mark.parametrize("cosine", COSINES)
    @pytest.mark.parametrize("ratio", [1.5, 1 / 1.5])
    def test_energy_is_that_of_facets_seen_once(self, roughness, cosine, ratio):
        """Power, not radiance: what passes is brought back by the index squared."""
        glass = RoughDielectric(1.5, roughness)
        xi = np.random.default_rng(5).random((2 * N, 3))
        wi, value, _ = sampled(glass, arriving(cosine), xi, ratio)
        power = value[:, 0] * np.where(wi[:, 2] < 0, ratio**2, 1.0)
        error = power.std() / math.sqrt(len(power))
        expected = leaving_after_one_facet(roughness**2, cosine, ratio)
        assert power.max() <= 1.0 + 1e-9
        assert expected <= 1.0 + 1e-9
        assert abs(power.mean() - expected) < 5 * error + 1e-4

    @pytest.mark.parametrize("roughness", ROUGHNESS)
    @pytest.mark.parametrize("ratio", RATIOS)
    def test_light_goes_both_ways_alike(self, roughness, ratio):
        """Reflected: f is the same. Through: f over the index squared of where light goes is."""
        glass, d = RoughDielectric(1.5, roughness), arriving(0.8)
        for chart in (Chart(d, roughness**2), Chart(d, roughness**2, ratio)):
            w, _ = chart.directions()
            w = w[np.isfinite(w[:, 0])][::37]
            w = w[np.abs(w[:, 2]) > 1e-3]
            through = chart.ratio is not None
            there, _ = evaluated(glass, d, w, ratio)
            back, _ = evaluated(glass, -w, -d, 1 / ratio if through else ratio)
            assert there.max() > 0
            f, reverse = there / np.abs(w[:, 2:]), back / 0.8
            np.testing.assert_allclose(f * (ratio**2 if through else 1.0), reverse, rtol=1e-7)

    def test_tint_colors_what_passes_only(self):
        d = arriving(0.6)
        clear, tinted = RoughDielectric(1.5, 0.5), RoughDielectric(1.5, 0.5, tint=(0.2, 0.5, 1))
        for ratio, factor in ((None, (1, 1, 1)), (1.5, (0.2, 0.5, 1))):
            w, _ = Chart(d, 0.25, ratio).directions()
            w = w[np.isfinite(w[:, 0])][::97]
            a, b = evaluated(clear, d, w, 1.5)[0], evaluated(tinted, d, w, 1.5)[0]
            np.testing.assert_allclose(b, a * np.array(factor), rtol=1e-13)

    def test_hidden_glass_spreads_nothing(self):
        w, _ = Chart(arriving(0.6), 0.25).directions()
        w = np.concatenate([w, -w])[np.isfinite(np.concatenate([w, w])[:, 0])]
        value, pdf = evaluated(RoughDielectric(1.5, 0.5), arriving(0.6), w, 0.0)
        assert not value.any()
        assert not pdf.any()
