from functools import cache

import numpy as np
import pytest
from scipy import stats

from hybrid_rt.materials import Dielectric, Lambertian, Metal, Mirror, Mix, Phong
from hybrid_rt.materials.table import color_factor, compile_materials
from hybrid_rt.sampling.kernels.sobol import sobol_points
from hybrid_rt.shading.kernels.bsdf import sample_lobes, scattered
from hybrid_rt.shading.kernels.lobes.register import EVERY, WIDE
from meshing.kernels.jit import kernel

N = 2**16
# One false alarm in about ten thousand runs of all the chi-square tests here.
ALARM = 1e-4 / 40

MATERIALS = {
    "matt": Lambertian((0.2, 0.5, 1.0)),
    "glossy": Phong(0.0, 1.0, 30.0),
    "matt and glossy": Phong(0.5, (0.5, 0.2, 0.1), 8.0),
    "metal": Metal((1.0, 0.8, 0.6), 0.3),
    "rough metal": Metal(1.0, 1.0),
    "mix": Mix([(0.5, Metal(0.9, 0.5)), (0.2, Phong(0.4, 0.6, 5.0)), (0.2, Lambertian(1.0))]),
    "with specular": Mix([(0.3, Mirror(0.7)), (0.3, Dielectric(1.5)), (0.4, Lambertian(0.8))]),
}
INCOMING = [(0, 0, -1), (1, 0.3, -0.4), (1, 0, -0.05), (0.2, 0.1, 1)]

every = pytest.mark.parametrize("material", MATERIALS)
from_everywhere = pytest.mark.parametrize("incoming", INCOMING)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def table_of(material, n):
    lobes, textures = compile_materials([material])
    colors = textures.number[lobes.texture, :3] * color_factor(lobes)[:, None]
    return lobes, np.ascontiguousarray(np.broadcast_to(colors, (n, *colors.shape)))


@kernel(allocates=True)
def evaluate_lobes(lobes, material, colors, normal, direction, wi, asked, value, pdf):
    """Fill ``value`` (n, 3) with f cos and ``pdf`` (n,) for given directions; see `scattered`."""
    for i in range(material.size):
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        pdf[i] = 0.0
        if material[i] < 0:
            continue
        value[i, 0], value[i, 1], value[i, 2], pdf[i] = scattered(
            lobes, material[i], colors, i,
            normal[i, 0], normal[i, 1], normal[i, 2],
            direction[i, 0], direction[i, 1], direction[i, 2],
            wi[i, 0], wi[i, 1], wi[i, 2], 0.0, asked,
        )  # fmt: skip


def evaluated(material, incoming, leaving, asked=EVERY):
    n = len(leaving)
    lobes, colors = table_of(material, n)
    normal = np.tile([0.0, 0.0, 1.0], (n, 1))
    direction = np.array(np.broadcast_to(unit(np.asarray(incoming, float)), (n, 3)))
    value, pdf = np.empty((n, 3)), np.empty(n)
    evaluate_lobes(
        lobes, np.zeros(n, np.int32), colors, normal, direction, leaving, asked, value, pdf
    )
    return value, pdf


def sampled(material, incoming, xi, asked=EVERY):
    n = len(xi)
    lobes, colors = table_of(material, n)
    normal = np.tile([0.0, 0.0, 1.0], (n, 1))
    direction = np.tile(unit(np.asarray(incoming, float)), (n, 1))
    wi, value, pdf = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    material_id = np.zeros(n, np.int32)
    nothing = np.zeros(0)
    sample_lobes(
        lobes, material_id, colors, normal, direction, nothing, xi, nothing, asked, wi, value, pdf
    )
    return wi, value, pdf


@cache
def even_points():
    xi = np.empty((1, N, 2))
    same = np.zeros(N, np.uint64)
    sobol_points(np.uint64(1), np.arange(N, dtype=np.uint64), same, same, 0, xi)
    return xi[0]


def hemisphere(side, n_heights, n_turns):
    """Directions in the middle of cells of equal solid angle."""
    z = (np.arange(n_heights) + 0.5) / n_heights
    phi = 2 * np.pi * (np.arange(n_turns) + 0.5) / n_turns
    z, phi = (a.ravel() for a in np.meshgrid(z, phi, indexing="ij"))
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), side * z], axis=1)


HEIGHTS, TURNS, FINE = 24, 32, (30, 16)


@cache
def over_cells(material, incoming):
    """Return what the pdf adds up to in each cell of (heights, turns), and the share sent on.

    Fine, because the density of metal ends with a square root: that adds 2 to its chi-square.
    """
    cells = hemisphere(-np.sign(incoming[2]), HEIGHTS * FINE[0], TURNS * FINE[1])
    f_cos, density = evaluated(MATERIALS[material], incoming, cells)
    mass = density.reshape(HEIGHTS, FINE[0], TURNS, FINE[1]).sum(axis=(1, 3)).ravel()
    return mass * 2 * np.pi / density.size, f_cos.mean(axis=0) * 2 * np.pi


def chi_square(counts, expected):
    """Return the p-value; cells expected to hold few are taken together."""
    order = np.argsort(expected)
    counts, expected = counts[order], expected[order]
    few = np.searchsorted(np.cumsum(expected), 10.0) + 1
    counts = np.concatenate([[counts[:few].sum()], counts[few:]])
    expected = np.concatenate([[expected[:few].sum()], expected[few:]])
    big = expected >= 10.0
    counts = np.append(counts[big], counts[~big].sum())
    expected = np.append(expected[big], expected[~big].sum())
    if expected[-1] < 10.0:
        counts, expected = counts[:-1], expected[:-1]
    statistic = ((counts - expected) ** 2 / expected).sum()
    return stats.chi2.sf(statistic, expected.size - 1)


@pytest.mark.statistical
@every
@from_everywhere
def test_directions_are_distributed_as_the_pdf_says(material, incoming):
    xi = np.random.default_rng(3).random((N, 2))
    wi, _, pdf = sampled(MATERIALS[material], incoming, xi)
    went = pdf > 0
    side = -np.sign(incoming[2])
    mass, _ = over_cells(material, incoming)
    i = np.minimum((wi[went, 2] * side * HEIGHTS).astype(int), HEIGHTS - 1)
    j = (np.arctan2(wi[went, 1], wi[went, 0]) / (2 * np.pi) % 1.0 * TURNS).astype(int) % TURNS
    counts = np.bincount(i * TURNS + j, minlength=HEIGHTS * TURNS)
    # What led into the surface, or went to a mirror or glass, is one more cell.
    counts = np.append(counts, N - went.sum())
    expected = N * np.append(mass, max(1.0 - mass.sum(), 0.0))
    assert chi_square(counts, expected) > ALARM


@every
@from_everywhere
def test_mean_of_samples_is_the_integral(material, incoming):
    _, value, _ = sampled(MATERIALS[material], incoming, even_points())
    # Sobol points and a midpoint rule, both with a jump where directions leave the hemisphere.
    _, expected = over_cells(material, incoming)
    np.testing.assert_allclose(value.mean(axis=0), expected, rtol=5e-3, atol=1e-3)


@every
@from_everywhere
def test_no_energy_is_made(material, incoming):
    _, sent_on = over_cells(material, incoming)
    assert (sent_on <= 1.0 + 1e-3).all()


@every
def test_light_goes_both_ways_alike(material):
    rng = np.random.default_rng(8)
    a, b = (unit(rng.normal(size=(500, 3))) for _ in range(2))
    a[:, 2], b[:, 2] = np.abs(a[:, 2]), np.abs(b[:, 2])
    there, _ = evaluated(MATERIALS[material], -a, b)
    back, _ = evaluated(MATERIALS[material], -b, a)
    # f cos of the one over its cosine is f of both.
    np.testing.assert_allclose(there / b[:, 2:], back / a[:, 2:], rtol=1e-9, atol=1e-12)


def test_matt_surfaces_send_on_exactly_their_color():
    _, value, _ = sampled(MATERIALS["matt"], (1, 0, -2), even_points())
    np.testing.assert_allclose(value, np.tile([0.2, 0.5, 1.0], (N, 1)), rtol=1e-12)


@pytest.mark.parametrize("material", [Mirror(), Dielectric(), Metal(1.0, 0.0)])
def test_single_directions_are_no_spread_light(material):
    _, value, pdf = sampled(material, (1, 0, -1), even_points())
    assert not value.any()
    assert not pdf.any()


def test_whitted_chooses_among_matt_and_glossy_lobes_only():
    material = Mix([(0.5, Metal(1.0, 0.5)), (0.5, Lambertian(1.0))])
    cells = hemisphere(1, 20, 20)
    value, pdf = evaluated(material, (1, 0, -1), cells, WIDE)
    np.testing.assert_allclose(value[:, 0], 0.5 * cells[:, 2] / np.pi)
    np.testing.assert_allclose(pdf, cells[:, 2] / np.pi)


def test_rows_without_material_give_zero():
    lobes, colors = table_of(Lambertian(0.5), 8)
    wi, value, pdf = np.empty((8, 3)), np.empty((8, 3)), np.empty(8)
    nan = np.full((8, 3), np.nan)
    nothing = np.full(8, -1, np.int32)
    no = np.zeros(0)
    sample_lobes(lobes, nothing, colors, nan, nan, no, nan[:, :2], no, EVERY, wi, value, pdf)
    assert not value.any()
