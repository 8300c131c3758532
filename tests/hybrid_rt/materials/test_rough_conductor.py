import numpy as np
import pytest

from hybrid_rt import Mix, RoughConductor
from hybrid_rt.materials.rough_conductor import METALS, WIDE_FROM
from hybrid_rt.materials.table import compile_materials
from hybrid_rt.shading.kernels.lobes.register import NARROW, WIDE

# Wavelength in micrometres, eta, k: of what is in the literature, the part that is seen.
MEASURED = {
    # Johnson and Christy, 1972
    "gold": """
        0.3815 1.46 1.933  0.3974 1.47 1.952  0.4133 1.46 1.958  0.4305 1.45 1.948
        0.4509 1.38 1.914  0.4714 1.31 1.849  0.4959 1.04 1.833  0.5209 0.62 2.081
        0.5486 0.43 2.455  0.5821 0.29 2.863  0.6168 0.21 3.272  0.6595 0.14 3.697
        0.7045 0.13 4.103  0.7560 0.14 4.542  0.8211 0.16 5.083""",
    "copper": """
        0.3815 1.33 2.045  0.3974 1.32 2.116  0.4133 1.28 2.207  0.4305 1.25 2.305
        0.4509 1.24 2.397  0.4714 1.25 2.483  0.4959 1.22 2.564  0.5209 1.18 2.608
        0.5486 1.02 2.577  0.5821 0.70 2.704  0.6168 0.30 3.205  0.6595 0.22 3.747
        0.7045 0.21 4.205  0.7560 0.24 4.665  0.8211 0.26 5.180""",
    "silver": """
        0.3815 0.05 1.864  0.3974 0.05 2.070  0.4133 0.05 2.275  0.4305 0.04 2.462
        0.4509 0.04 2.657  0.4714 0.05 2.869  0.4959 0.05 3.093  0.5209 0.05 3.324
        0.5486 0.06 3.586  0.5821 0.05 3.858  0.6168 0.06 4.152  0.6595 0.05 4.483
        0.7045 0.04 4.838  0.7560 0.03 5.242  0.8211 0.04 5.727""",
    # Rakic, 1995
    "aluminium": """
        0.36466 0.39877 4.3957  0.41328 0.52135 5.0008  0.44280 0.60790 5.3676
        0.47687 0.72780 5.7781  0.51660 0.87340 6.2418  0.56357 1.07280 6.7839
        0.61993 1.36600 7.4052  0.65225 1.57240 7.7354  0.68881 1.83010 8.0601
        0.72932 2.16060 8.3565  0.77491 2.61540 8.4914  0.79478 2.76750 8.3866""",
    # Querry, 1985: every second line
    "brass": """
        0.3800 1.487 1.818  0.4000 1.445 1.805  0.4200 1.350 1.786  0.4400 1.191 1.797
        0.4600 0.994 1.883  0.4800 0.816 2.046  0.5000 0.686 2.250  0.5200 0.602 2.464
        0.5400 0.549 2.668  0.5600 0.505 2.860  0.5800 0.468 3.059  0.6000 0.450 3.253
        0.6200 0.449 3.434  0.6400 0.444 3.609  0.6600 0.445 3.778  0.6800 0.444 3.943
        0.7000 0.446 4.106  0.7200 0.450 4.266  0.7400 0.455 4.424  0.7600 0.458 4.579
        0.7800 0.464 4.737  0.8000 0.473 4.890""",
    # Johnson and Christy, 1974
    "iron": """
        0.368 2.02 2.43  0.381 2.12 2.50  0.397 2.24 2.58  0.413 2.35 2.65
        0.431 2.48 2.71  0.451 2.59 2.77  0.471 2.67 2.82  0.496 2.74 2.88
        0.521 2.86 2.91  0.549 2.95 2.93  0.582 2.94 2.99  0.617 2.88 3.05
        0.659 2.92 3.10  0.704 2.86 3.19  0.756 2.87 3.28  0.821 2.94 3.39""",
    "nickel": """
        0.368 1.70 2.40  0.381 1.72 2.48  0.397 1.72 2.57  0.413 1.70 2.69
        0.431 1.71 2.82  0.451 1.73 2.95  0.471 1.78 3.09  0.496 1.82 3.25
        0.521 1.85 3.42  0.549 1.92 3.61  0.582 1.96 3.80  0.617 1.99 4.02
        0.659 1.99 4.26  0.704 2.06 4.50  0.756 2.13 4.73  0.821 2.26 4.97""",
    "chromium": """
        0.368 1.87 2.69  0.381 1.92 2.74  0.397 2.00 2.83  0.413 2.08 2.93
        0.431 2.19 3.04  0.451 2.33 3.14  0.471 2.51 3.24  0.496 2.75 3.30
        0.521 2.94 3.33  0.549 3.18 3.33  0.582 3.22 3.30  0.617 3.17 3.30
        0.659 3.09 3.34  0.704 3.05 3.39  0.756 3.08 3.42  0.821 3.20 3.48""",
}


def weights(nanometres):
    """How red, green and blue of linear sRGB weigh a spectrum, each adding up to one.

    Colour matching functions of 1931 by Wyman, Sloan and Shirley, "Simple analytic approximations
    to the CIE XYZ color matching functions", JCGT 2(2), 2013.
    """

    def bell(middle, below, above):
        width = np.where(nanometres < middle, below, above)
        return np.exp(-0.5 * ((nanometres - middle) / width) ** 2)

    x = 1.056 * bell(599.8, 37.9, 31.0) + 0.362 * bell(442.0, 16.0, 26.7)
    x -= 0.065 * bell(501.1, 20.4, 26.2)
    y = 0.821 * bell(568.8, 46.9, 40.5) + 0.286 * bell(530.9, 16.3, 31.1)
    z = 1.217 * bell(437.0, 11.8, 36.0) + 0.681 * bell(459.0, 26.0, 13.8)
    to_srgb = [
        [3.2406255, -1.5372080, -0.4986286],
        [-0.9689307, 1.8757561, 0.0415175],
        [0.0557101, -0.2040211, 1.0569959],
    ]
    rgb = np.array(to_srgb) @ [x, y, z]
    return rgb / rgb.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("metal", METALS)
def test_indices_are_the_measured_ones_weighted_by_the_eye(metal):
    table = np.array(MEASURED[metal].split(), dtype=float).reshape(-1, 3)
    wavelength = np.arange(380.0, 781.0)
    eta, k = (np.interp(wavelength, 1e3 * table[:, 0], table[:, i]) for i in (1, 2))
    of_eye = weights(wavelength)
    # As many digits as stand there.
    np.testing.assert_allclose(METALS[metal], [of_eye @ eta, of_eye @ k], atol=6e-5)
    reflectance = of_eye @ (((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2))
    found = RoughConductor.of(metal, 0.3).lobes[0].color.row.number[:3]
    np.testing.assert_allclose(found, np.minimum(reflectance, 0.98), atol=0.014)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: RoughConductor(0.0, 3.0, 0.5), "eta"),
        (lambda: RoughConductor((1, 2), 3.0, 0.5), "eta has shape"),
        (lambda: RoughConductor(1.0, (1, 1, -1), 0.5), "k"),
        (lambda: RoughConductor(1.0, np.nan, 0.5), "k"),
        (lambda: RoughConductor(1.0, 1e4, 0.5), "k"),
        (lambda: RoughConductor(1.0, 3.0, 0.00999), "roughness.*use Mirror"),
        (lambda: RoughConductor(1.0, 3.0, np.nan), "roughness"),
        (lambda: RoughConductor(1.0, 3.0, 1.5), "roughness"),
        (
            lambda: RoughConductor.of("bronze", 0.5),
            r"gold, copper, silver, aluminium, brass, iron, nickel, chromium; or RoughConductor\(eta, k, roughness\) with its optical constants",
        ),
    ],
)
def test_impossible_metals_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_wide_from_where_a_quarter_of_the_hemisphere_holds_half_the_light():
    # The solid angle of a cone of half angle 2 atan(alpha).
    assert 1 - np.cos(2 * np.arctan(WIDE_FROM)) == pytest.approx(0.25)
    lobes, _ = compile_materials(
        [RoughConductor.of("gold", r) for r in (0.6, 0.62)]
        + [Mix([(0.5, RoughConductor.of("copper", 1.0))])]
    )
    assert lobes.traits.tolist() == [NARROW, WIDE, WIDE]
    assert lobes.weight.tolist() == [1.0, 1.0, 0.5]
