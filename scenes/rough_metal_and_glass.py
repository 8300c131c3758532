"""Gold, copper and aluminium from satin to matt, and frosted glass, under a window.

Roughness grows from left to right: the lamp's reflection widens and dims. The balls are measured
metals; in front stand a clear and two frosted balls of the same glass.

Run it: python scenes/rough_metal_and_glass.py --passes 256
"""

import sys

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Dielectric,
    GradientSky,
    Lambertian,
    Object,
    Rectangle,
    RectangleLight,
    RoughConductor,
    RoughDielectric,
    Scene,
    Sphere,
)

METALS = ("gold", "copper", "aluminium")
ROUGHNESS = (0.1, 0.3, 0.5, 0.8)


def scene() -> Scene:
    """Describe the picture."""
    objects = [
        Object(
            Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)),
            Lambertian(CheckerTexture((0.36, 0.34, 0.32), (0.14, 0.14, 0.15), 36, "uv")),
            "table",
        ),
        Object(
            Rectangle((-9, 4.5, 0), (18, 0, 0), (0, 0, 9)).flipped(),
            Lambertian((0.3, 0.33, 0.38)),
            "wall",
        ),
    ]
    for row, metal in enumerate(METALS):
        for column, roughness in enumerate(ROUGHNESS):
            center = (1.15 * (column - 1.5), 2.6 - 1.25 * row, 0.48)
            material = RoughConductor.of(metal, roughness)
            objects.append(Object(Sphere(center, 0.48), material, f"{metal} {roughness}"))
    for column, glass in enumerate(
        (Dielectric(1.5), RoughDielectric(1.5, 0.25), RoughDielectric(1.5, 0.5))
    ):
        center = (1.3 * (column - 1.0), -1.3, 0.5)
        objects.append(Object(Sphere(center, 0.5), glass, f"glass {column}"))
    return Scene(
        camera=Camera(
            look_from=(0.0, -7.2, 4.3),
            look_at=(0.0, 0.45, 0.4),
            up=(0.0, 0.0, 1.0),
            vertical_fov=35.0,
            width=640,
            height=480,
        ),
        objects=objects,
        lights=[RectangleLight((-4.2, -2.2, 5.0), (0, 2.4, 0), (1.6, 0, 1.6), (13, 12.5, 12))],
        environment=GradientSky((0.1, 0.1, 0.11), (0.35, 0.4, 0.5), (0, 0, 1)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
