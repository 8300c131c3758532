import numpy as np
import pytest

from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Metal, Mirror, Mix, Phong
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.materials.table import compile_materials
from hybrid_rt.shading.kernels.lobes.register import DIELECTRIC, DIFFUSE, METAL, MIRROR, PHONG
from hybrid_rt.textures import CheckerTexture

CHECKER = CheckerTexture(0.9, 0.1)


def test_lobes_of_all_materials_lie_in_one_table():
    materials = [Lambertian(CHECKER), Phong(CHECKER, 0.1, 7.0), Mirror(), Dielectric(1.3, 0.2)]
    lobes, textures = compile_materials(materials)
    assert lobes.kind.tolist() == [DIFFUSE, DIFFUSE, PHONG, MIRROR, DIELECTRIC]
    assert lobes.first.tolist() == [0, 1, 3, 4, 5]
    assert lobes.number[2, 0] == 7.0
    assert lobes.number[4].tolist() == [1.3, 0.0, 0.2, 0.2, 0.2, 0.0]
    # The checker is stored once.
    assert lobes.texture[0] == lobes.texture[1]
    assert textures.kind.size == 4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Lambertian(1.1), "Lambertian color"),
        (lambda: Lambertian((0.1, np.nan, 0)), "Lambertian color"),
        (lambda: Lambertian(CheckerTexture(1.5, 0)), "brightest colour of CheckerTexture"),
        (lambda: Phong(0.6, 0.6, 10), "diffuse \\+ specular"),
        (lambda: Phong(0.1, 0.6, 0), "exponent"),
        (lambda: Dielectric(1e-7), "ior"),
        (lambda: RoughDielectric(1.5, 0.00999), "RoughDielectric roughness"),
        (lambda: RoughDielectric(1.5, 1.0001), "RoughDielectric roughness"),
        (lambda: Dielectric(float("nan")), "ior"),
        (lambda: Dielectric(1.5, -1), "absorption"),
        (lambda: Dielectric(1.5, tint=1.5), "tint"),
        (lambda: Dielectric(priority=np.inf), "priority"),
        (lambda: Metal(0.5, 1.1), "fuzz"),
        (lambda: Mix([(0.6, Mirror()), (0.6, Mirror())]), "Mix weights add up to 1.2"),
        (lambda: Mix([(0.1, Mirror()), (0.1, Emissive(1.0))]), "Mix part 1 shines"),
        (lambda: Mix([(0.5, Dielectric()), (0.5, Dielectric())]), "more than one part"),
        (lambda: Emissive(-1), "Emissive radiance"),
        (
            lambda: Emissive(np.ones((8, 8))),
            r"Emissive radiance has shape \(8, 8\): pass one number, three, or for a picture ImageTexture",
        ),
        (lambda: Emissive(1, Emissive(1)), "Emissive base"),
    ],
)
def test_impossible_materials_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_other_types_are_refused():
    with pytest.raises(TypeError, match="Mix part 1"):
        Mix([(0.5, Mirror()), Mirror()])
    with pytest.raises(TypeError, match="Mix part 0"):
        Mix([(0.5, "gold")])


def test_mixtures_within_mixtures_multiply_their_weights():
    inner = Mix([(0.5, Lambertian(0.8)), (0.5, Mirror())])
    lobes, _ = compile_materials([Mix([(0.5, inner), (0.25, Metal(0.9, 0.2))])])
    assert lobes.kind.tolist() == [DIFFUSE, MIRROR, METAL]
    assert lobes.weight.tolist() == [0.25, 0.25, 0.25]


def test_metal_without_fuzz_is_a_mirror():
    assert Metal(0.5, 0.0).lobes[0].kind == MIRROR
