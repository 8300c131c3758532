"""Small scenes of all kinds on which the stated noise is tested.

Each is a dozen surfaces at most in 16 x 16 pixels, so that hundreds of renders tell how often the
intervals hold; `tools/calibrate.py` says what stands in for the truth. The intervals of
`hybrid_rt.sensor.intervals` were first chosen by figures of `SEEN`, without those of `UNSEEN`; skewness
and light from farther away by the first 300 seeds of all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import trimesh

from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.options import Options
from hybrid_rt.lights import GradientSky, ImageEnvironment, PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.light import Environment, Light
from hybrid_rt.materials import Dielectric, Lambertian, Metal, Mirror, Mix, Phong
from hybrid_rt.materials.material import Material
from hybrid_rt.materials.rough_conductor import RoughConductor
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture

SIDE = 16
GREY, DIM = Lambertian(0.6), GradientSky((0.2, 0.2, 0.2), (0.4, 0.5, 0.7), (0, 0, 1))


@dataclass(frozen=True)
class NoiseScene:
    """A scene and how it is rendered; ``options`` of None are those of the integrator itself."""

    scene: Scene
    integrator: str = "path"
    options: Options | None = field(default=None)


def _picture(
    objects: Sequence[Object],
    lights: Sequence[Light] = (),
    environment: Environment | None = None,
    floor: Material = GREY,
    field_of_view: float = 40.0,
) -> Scene:
    """Return objects about the origin, on a floor before a wall."""
    camera = Camera((0.3, -4.6, 2.2), (0, 0, 0.7), (0, 0, 1), field_of_view, SIDE, SIDE)
    around = [
        Object(Rectangle((-4, -6, 0), (8, 0, 0), (0, 9, 0)), floor, "floor"),
        Object(Rectangle((-4, 3, 0), (8, 0, 0), (0, 0, 5)).flipped(), GREY, "wall"),
    ]
    return Scene(camera, [*objects, *around], lights, environment)


def _ball(x: float, y: float, radius: float, material: Material) -> Object:
    return Object(Sphere((x, y, radius), radius), material)


def _lamp(x: float, y: float, z: float, side: float, radiance: float) -> RectangleLight:
    return RectangleLight((x, y, z), (0, side, 0), (side, 0, 0), radiance)


def glass_mirror_lamp() -> NoiseScene:
    """Return a glass and a mirror ball beneath a lamp."""
    balls = [_ball(-0.8, 0.3, 0.7, Mirror(0.95)), _ball(0.7, -0.4, 0.6, Dielectric(1.5))]
    return NoiseScene(_picture(balls, [_lamp(-0.4, -0.4, 3.5, 0.8, 12.0)]))


def rough_metal() -> NoiseScene:
    """Return satin and matt metals beneath a lamp and a dim sky."""
    metals = ((-1.0, "gold", 0.1), (0.0, "copper", 0.3), (1.0, "aluminium", 0.6))
    balls = [_ball(x, 0.0, 0.5, RoughConductor.of(name, rough)) for x, name, rough in metals]
    return NoiseScene(_picture(balls, [_lamp(-1.5, -1.5, 3.0, 0.5, 30.0)], DIM))


def textures_under_sky() -> NoiseScene:
    """Return a finely checked floor with a Phong ball, lit by a sky alone."""
    floor = Lambertian(CheckerTexture((0.9, 0.85, 0.8), (0.05, 0.05, 0.1), 40, "uv"))
    balls = [_ball(0.0, 0.0, 0.7, Phong(0.3, 0.5, 60.0))]
    return NoiseScene(_picture(balls, [], DIM, floor))


def tiny_bright_lamp() -> NoiseScene:
    """Return a tiny lamp in sight above a polished floor, beside a mirror ball."""
    floor = Mix([(0.8, Lambertian(0.5)), (0.2, Mirror(0.9))])
    balls = [_ball(-0.6, 0.2, 0.6, Metal(0.9, 0.02))]
    return NoiseScene(_picture(balls, [SphereLight((0.7, 0.4, 1.4), 0.03, 900.0)], None, floor))


def point_light_caustic() -> NoiseScene:
    """Return the caustic of a point light under a glass ball, by photons."""
    balls = [_ball(0.0, 0.0, 0.7, Dielectric(1.5)), _ball(1.1, 0.4, 0.4, Mirror(0.9))]
    scene = _picture(balls, [PointLight((-1.5, -1.0, 3.0), 30.0)])
    return NoiseScene(scene, "ppm", PPMOptions(2000))


def lamp_by_photon_map() -> NoiseScene:
    """Return glass and metal beneath a lamp, by a photon map."""
    balls = [_ball(-0.7, 0.0, 0.6, Dielectric(1.5, (0.1, 0.5, 0.8))), _ball(0.7, 0, 0.5, GREY)]
    scene = _picture(balls, [_lamp(-0.4, -0.4, 3.5, 0.8, 12.0)])
    return NoiseScene(scene, "photon_map", PhotonMapOptions(3000, 30))


def mirrors_by_whitted() -> NoiseScene:
    """Return glass and mirror by Whitted's method."""
    return NoiseScene(glass_mirror_lamp().scene, "whitted")


def many_lamps() -> NoiseScene:
    """Return 25 lamps of very different power over glossy balls."""
    lamps = [
        _lamp(0.9 * i - 2.0, 0.9 * j - 2.0, 3.0, 0.1, 20.0 * (1.0 + 7.0 * ((3 * i + j) % 5)))
        for i in range(5)
        for j in range(5)
    ]
    balls = [_ball(-0.7, 0.0, 0.6, Phong(0.3, 0.6, 300.0)), _ball(0.7, 0.0, 0.5, GREY)]
    return NoiseScene(_picture(balls, lamps))


def absorbing_glass_in_a_room() -> NoiseScene:
    """Return coloured glass and a mirror in a closed room with a small ceiling lamp."""
    scene = _picture(
        [
            _ball(-0.7, 0.1, 0.7, Dielectric(1.5, (0.2, 1.2, 2.0))),
            Object(Box((0.3, -0.6, 0.001), (0.9, 0.2, 1.2)), Dielectric(1.4, (2.0, 0.6, 0.1))),
            Object(Rectangle((2.0, -1.0, 0.2), (0, 2, 0), (0, 0, 2)), Mirror(0.9)),
            Object(Box((-3, -5, -0.1), (3, 2.5, 4)).flipped(), Lambertian((0.7, 0.5, 0.4))),
        ],
        [_lamp(-0.2, -0.2, 3.9, 0.4, 40.0)],
    )
    return NoiseScene(scene)


def sphere_light() -> NoiseScene:
    """Return a sphere light in sight behind frosted glass, and a glossy ball."""
    balls = [_ball(-0.6, -0.6, 0.5, RoughDielectric(1.5, 0.2)), _ball(0.6, 0, 0.5, Metal(0.9, 0.2))]
    return NoiseScene(_picture(balls, [SphereLight((-0.9, 1.2, 1.4), 0.3, 15.0)]))


def smooth_mesh() -> NoiseScene:
    """Return a mesh with smooth normals, glossy, under an environment with a small sun."""
    texels = np.full((16, 32, 3), 0.3)
    texels[4, 9] = 120.0
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.8)
    mesh.apply_translation((0.0, 0.0, 0.8))
    ball = Object(TriangleMesh(mesh), Phong(0.4, 0.4, 40.0), smooth=True)
    return NoiseScene(_picture([ball], [], ImageEnvironment(texels, up=(0, 0, 1))))


def frosted_glass_by_ppm() -> NoiseScene:
    """Return clear and frosted glass with a small lamp in sight, by photons."""
    balls = [_ball(-0.7, 0.0, 0.6, RoughDielectric(1.5, 0.2)), _ball(0.7, 0, 0.5, Dielectric(1.5))]
    scene = _picture(balls, [SphereLight((0.2, 1.0, 1.9), 0.1, 120.0)])
    return NoiseScene(scene, "ppm", PPMOptions(2000))


def metals_by_photon_map() -> NoiseScene:
    """Return polished metal balls under a sky and a lamp, by a photon map."""
    balls = [_ball(-0.7, 0.0, 0.6, Metal(0.9, 0.05)), _ball(0.7, 0.0, 0.5, Phong(0.4, 0.4, 80.0))]
    scene = _picture(balls, [_lamp(1.0, -1.5, 3.0, 0.5, 30.0)], DIM)
    return NoiseScene(scene, "photon_map", PhotonMapOptions(3000, 30))


def mirror_cabinet() -> NoiseScene:
    """Return a matt ball between two mirrors with a lamp in sight, by paths from both ends."""
    mirrors = [
        Object(Rectangle((-1.3, -1.5, 0), (0, 3.5, 0), (0, 0, 2.2)), Mirror(0.95)),
        Object(Rectangle((1.3, -1.5, 0), (0, 3.5, 0), (0, 0, 2.2)), Mirror(0.95)),
    ]
    lamp = _lamp(-0.15, 1.0, 1.9, 0.3, 30.0)
    return NoiseScene(_picture([_ball(0.2, 0.3, 0.5, GREY), *mirrors], [lamp]))


SEEN: dict[str, Callable[[], NoiseScene]] = {
    "glass, mirror, lamp": glass_mirror_lamp,
    "rough metal": rough_metal,
    "textures under a sky": textures_under_sky,
    "tiny bright lamp": tiny_bright_lamp,
    "point light, caustic": point_light_caustic,
    "lamp by photon map": lamp_by_photon_map,
    "mirrors by whitted": mirrors_by_whitted,
}
UNSEEN: dict[str, Callable[[], NoiseScene]] = {
    "many lamps": many_lamps,
    "absorbing glass": absorbing_glass_in_a_room,
    "sphere light": sphere_light,
    "smooth mesh": smooth_mesh,
    "frosted glass by ppm": frosted_glass_by_ppm,
    "metals by photon map": metals_by_photon_map,
    "mirror cabinet": mirror_cabinet,
}
