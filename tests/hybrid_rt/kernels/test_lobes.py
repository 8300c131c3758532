import numpy as np
import pytest

from hybrid_rt.kernels.lobes import sample_lobes, scattered
from hybrid_rt.kernels.sampler import sobol_points
from hybrid_rt.materials import Lambertian, Mirror, Phong
from hybrid_rt.materials.table import compile_materials

N = 2**14


def table_of(material):
    lobes, textures = compile_materials([material])
    colors = textures.number[lobes.texture, :3]
    return lobes, np.ascontiguousarray(np.broadcast_to(colors, (N, *colors.shape)))


def even_points(dimension=7):
    xi = np.empty((N, 2))
    same = np.zeros(1, np.uint64)
    for i in range(N):
        sobol_points(np.uint64(1), np.uint64(i), same, same + np.uint64(dimension), xi[i : i + 1])
    return xi


XI = even_points()


def sampled(material, incoming):
    lobes, colors = table_of(material)
    normal = np.tile([0.0, 0.0, 1.0], (N, 1))
    direction = np.tile(np.asarray(incoming) / np.linalg.norm(incoming), (N, 1))
    wi, value = np.empty((N, 3)), np.empty((N, 3))
    sample_lobes(lobes, np.zeros(N, np.int32), colors, normal, direction, XI, wi, value)
    return wi, value, lobes, colors, direction


def sphere_integral(lobes, colors, direction, n=400):
    """Midpoint rule for f cos over the hemisphere from which the ray came."""
    z = -np.sign(direction[0, 2]) * (np.arange(n) + 0.5) / n
    phi = 2 * np.pi * (np.arange(n) + 0.5) / n
    total = np.zeros(3)
    d = direction[0]
    for height in z:
        r = np.sqrt(1 - height * height)
        for angle in phi[:: n // 100]:
            w = (r * np.cos(angle), r * np.sin(angle), height)
            total += scattered(lobes, 0, colors, 0, 0.0, 0.0, 1.0, *d, *w)
    return total * 2 * np.pi / (n * 100)


@pytest.mark.parametrize("incoming", [(0, 0, -1), (1, 0.3, -0.4), (1, 0, -0.05), (0.2, 0.1, 1)])
@pytest.mark.parametrize(
    "material",
    [Lambertian((0.2, 0.5, 1.0)), Phong(0.5, (0.5, 0.2, 0.1), 8.0), Phong(0.0, 1.0, 3.0)],
    ids=["matt", "both", "glossy"],
)
def test_mean_of_samples_is_the_albedo(material, incoming):
    _, value, lobes, colors, direction = sampled(material, incoming)
    # 2**14 Sobol points on a smooth integrand with a jump where directions leave the hemisphere.
    expected = sphere_integral(lobes, colors, direction)
    np.testing.assert_allclose(value.mean(axis=0), expected, rtol=5e-3, atol=1e-12)
    assert (value.mean(axis=0) <= 1.0 + 1e-6).all()


def test_matt_surfaces_send_on_exactly_their_color():
    _, value, *_ = sampled(Lambertian((0.2, 0.5, 1.0)), (1, 0, -2))
    np.testing.assert_allclose(value, np.tile([0.2, 0.5, 1.0], (N, 1)), rtol=1e-12)


def test_directions_leave_on_the_side_from_which_the_ray_came():
    for incoming, sign in (((1, 0, -1), 1), ((1, 0, 1), -1)):
        wi, value, *_ = sampled(Phong(0.5, 0.5, 20.0), incoming)
        assert (wi[value[:, 0] > 0, 2] * sign > 0).all()


def test_mirrors_have_no_spread_light():
    _, value, *_ = sampled(Mirror(), (1, 0, -1))
    assert not value.any()


def test_rows_without_material_give_zero():
    lobes, colors = table_of(Lambertian(0.5))
    wi, value = np.empty((N, 3)), np.empty((N, 3))
    nan = np.full((N, 3), np.nan)
    sample_lobes(lobes, np.full(N, -1, np.int32), colors, nan, nan, XI, wi, value)
    assert not value.any()
